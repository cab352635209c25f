"""The record of a commissioning: written by ``commission``, required by ``run``."""

import json
import math
import os
import shlex
import tempfile
from dataclasses import asdict
from pathlib import Path
from typing import Any, Final, Literal

from pydantic import BaseModel

from utank_hil.base.finite import finite
from utank_hil.base.provenance import made_by
from utank_hil.base.text_files import refuse_device
from utank_hil.base.whole_file import left_whole
from utank_hil.canbus import load_catalogue
from utank_hil.configuration import ControllerConfig, Vessel
from utank_hil.nodes.commissioning.checks import Check

SUFFIX: Final = ".commissioning.json"


def record_path(config: Path) -> Path:
    """Return the default place of a controller's record: beside its file."""
    return config.with_suffix(SUFFIX)


def commissioned_for(config: ControllerConfig) -> dict[str, Any]:
    """Return what a commissioning covers; a change of it makes the record void."""
    vessel = config.vessel
    parts = {name: getattr(vessel, name) for name in ("ship", "tank", "pump", "valve")}
    return {
        "catalogue_version": load_catalogue().version,
        **{name: asdict(part) for name, part in parts.items() if part is not None},
        "redundancy": asdict(vessel.redundancy),
        "sensors": asdict(config.sensors),
        **({} if vessel.devices is None else {"devices": vessel.devices.model_dump(mode="json")}),
        **({} if vessel.pump is None else {"stop_within_ms": vessel.stop_within_ms}),
        **({"emulated": True} if vessel.emulated else {}),
    }


def made_with(vessel: Vessel, file: Path, bus: str) -> dict[str, Any]:
    """Return what each record begins with: program, time, ship, its file, and the interface."""
    return {
        **made_by(),
        "vessel": vessel.name,
        "file": file.name,
        "bus": bus,
        "configuration_version": vessel.version,
    }


def make_record(
    config: ControllerConfig, file: Path, bus: str, checks: list[Check], ended: str
) -> dict[str, Any]:
    """Record of a commissioning on a `bus`, for `json.dumps`; `ended` says why it ended early."""
    return {
        **made_with(config.vessel, file, bus),
        "controller": config.name,
        "commissioned_for": commissioned_for(config),
        "passed": not ended and bool(checks) and all(check.passed for check in checks),
        "ended": ended,
        "checks": listed(checks),
    }


def listed(checks: list[Check]) -> list[dict[str, Any]]:
    """Return checks as a record has them."""
    return [
        {
            **asdict(check),
            "measured": check.measured if math.isfinite(check.measured) else None,
            "verdict": "pass" if check.passed else "fail",
            "remedy": "" if check.passed else check.remedy,
        }
        for check in checks
    ]


def why_not_replaceable(path: Path) -> str:
    """Return why the existing file may not be replaced by a record; empty if it may."""
    if not path.exists():
        return ""
    if not path.is_file():
        return f"{path}: is no regular file"
    if path.name.endswith(SUFFIX) or not path.stat().st_size:  # a damaged one is replaceable too
        return ""
    try:
        content = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError):
        content = None
    if isinstance(content, dict) and "commissioned_for" in content:
        return ""
    return f"{path}: is there and is no record of a commissioning"


def write_record(path: Path, record: dict[str, Any]) -> None:
    """Write a record atomically: at any time the old or the new one is complete."""
    with (
        tempfile.NamedTemporaryFile(
            "w", dir=path.parent, prefix=path.name, delete=False, encoding="utf-8"
        ) as file,
        left_whole(Path(file.name)),
    ):
        json.dump(finite(record), file, indent=1, allow_nan=False)
        file.write("\n")
        file.flush()
        os.fsync(file.fileno())
        os.chmod(file.name, 0o644)
        os.replace(file.name, path)
    _sync(path.parent)


def remove_record(path: Path) -> None:
    """Remove a record, if there is one, safely against a power cut; raises OSError if it can't."""
    path.unlink(missing_ok=True)
    _sync(path.parent)


def _sync(folder: Path) -> None:
    descriptor = os.open(folder, os.O_RDONLY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)


def why_not_commissioned(config: ControllerConfig, bus: str, file: Path, path: Path | None) -> str:
    """Return why a controller must not be armed, with the remedy; empty if it may.

    Of a ship that its file declares to be emulated no record is required unless `path` is given:
    the controller then stays in INIT until all nodes send the version of an emulated ship. A drive
    of another maker sends none, so it proves nothing. `file` is that of the configuration.
    """
    vessel = config.vessel
    proves = vessel.emulated and vessel.foreign.pump is None
    if (vessel.pump is None and vessel.valve is None) or (path is None and proves):
        return ""
    for key, reason in config.held_pressure_problems():
        return f"{file}: {key} {reason}"
    named = () if path is None else ("--record", str(path))
    path = path or record_path(file)
    words = ("utank-hil", "commission", str(file), "--bus", bus, *named)
    remedy = f"run {shlex.join(words)} at the quay"
    try:
        refuse_device(path)
        record = _Record.model_validate_json(path.read_bytes(), strict=True)
    except FileNotFoundError:
        return f"{path}: there is no record of a commissioning; {remedy}"
    except (OSError, ValueError):
        return f"{path}: is no record of a commissioning that can be read; {remedy}"
    stands_for = json.loads(json.dumps(finite(commissioned_for(config))))
    changed = _differences(finite(record.commissioned_for), stands_for)
    if changed:
        return f"{path}: since {record.date} these changed: {', '.join(changed)}; {remedy}"
    each_passed = [check.verdict == "pass" for check in record.checks]
    if not (record.passed and each_passed and all(each_passed)) or record.ended:
        return f"{path}: the commissioning of {record.date} was not passed; {remedy}"
    if record.bus != bus:
        return f"{path}: was made on {record.bus}, and this is other hardware; {remedy}"
    return ""


class _Verdict(BaseModel):
    verdict: Literal["pass", "fail"]


class _Record(BaseModel):
    commissioned_for: dict[str, Any]
    passed: bool
    ended: str
    date: str
    bus: str
    checks: list[_Verdict]


def _differences(before: Any, now: Any, key: str = "") -> list[str]:
    if isinstance(before, dict) and isinstance(now, dict):
        return [
            found
            for name in sorted({*before, *now})
            for found in _differences(before.get(name), now.get(name), f"{key}.{name}".lstrip("."))
        ]
    return [] if before == now else [key]
