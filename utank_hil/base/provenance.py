"""Where a result comes from: program, machine, command and whole configuration, as a mapping."""

import ctypes
import hashlib
import importlib.metadata
import json
import math
import os
import platform
import subprocess
from collections.abc import Mapping
from datetime import UTC, date, datetime
from enum import Enum
from functools import cache
from pathlib import Path
from typing import Any, Final

import numpy as np
from pydantic import BaseModel

PROGRAM: Final = "utank-hil"
UNKNOWN: Final = "unknown"
_ROOT: Final = Path(__file__).resolve().parents[2]
_GIT_S: Final = 5.0  #: Limit on a call of git. Chosen; no study.
_CORE_NAMES: Final = tuple(
    f"{prefix}openblas_get_corename{suffix}" for prefix in ("scipy_", "") for suffix in ("64_", "")
)


def version() -> str:
    """The program's version; `UNKNOWN` where it is not installed."""
    try:
        return importlib.metadata.version(PROGRAM)
    except importlib.metadata.PackageNotFoundError:
        return UNKNOWN


@cache
def commit() -> str:
    """The commit that the program is of.

    As ``git describe`` says it of the source tree, with ``-dirty`` if that was changed since; else
    the one that the wheel was built from; else the one that pip noted when it installed from a
    repository; else `UNKNOWN`.
    """
    if (_ROOT / ".git").exists():
        try:
            tree = _git("describe", "--always", "--abbrev=12")
            # not --dirty, which writes the index under a lock: another git may be at work there
            changed = _git("--no-optional-locks", "status", "--porcelain", "--untracked-files=no")
        except (OSError, subprocess.SubprocessError):
            return UNKNOWN
        return f"{tree}-dirty" if changed else tree
    of_wheel = _ROOT / "utank_hil" / "commit.txt"
    if of_wheel.exists():
        return of_wheel.read_text(encoding="utf-8").strip()
    try:
        origin = importlib.metadata.distribution(PROGRAM).read_text("direct_url.json")
    except importlib.metadata.PackageNotFoundError:
        return UNKNOWN
    found = json.loads(origin or "{}").get("vcs_info", {}).get("commit_id", UNKNOWN)
    return str(found)


def _git(*words: str) -> str:
    command = ["git", "-C", str(_ROOT), *words]
    return subprocess.run(
        command, capture_output=True, text=True, timeout=_GIT_S, check=True
    ).stdout.strip()


def headline() -> str:
    """Program, version and commit in one line."""
    return f"{PROGRAM} {version()}, commit {commit()}"


def made_by() -> dict[str, str]:
    """Return what every result begins with: program, version, commit, and time (UTC)."""
    now = f"{datetime.now(UTC):%Y-%m-%dT%H:%M:%SZ}"
    return {"program": PROGRAM, "version": version(), "commit": commit(), "date": now}


def describe(
    command: str,
    configuration: BaseModel,
    folder: Path,
    *,
    options: Mapping[str, Any],
    seed: int | None = None,
    scenario: BaseModel | None = None,
) -> dict[str, Any]:
    """Describe a result, ready for `json.dumps`.

    `configuration` is what it ran with; `scenario` is that whose sea counted, where the
    configuration is none itself. Paths of data files are relative to `folder`, where the result is
    written: a file there of the content ``configuration`` loads as what ran. ``data`` are their
    SHA-256.
    """
    parts = {"configuration": configuration.model_dump()}
    if scenario is not None:
        parts["scenario_configuration"] = scenario.model_dump()
    files: dict[str, Path] = {}
    plain = _plain(parts, folder, files)
    return {
        **made_by(),
        "machine": machine(),
        "command": command,
        "options": {name: _given(value) for name, value in options.items()},
        "seed": seed,
        **plain,
        "data": {
            name: hashlib.sha256(path.read_bytes()).hexdigest()
            for name, path in sorted(files.items())
        },
    }


def _given(value: Any) -> Any:
    """An option's value; of a path outside of the working directory only its name."""
    if isinstance(value, Path):
        relative = os.path.relpath(value)
        return value.name if relative.startswith("..") else relative
    return value


def _plain(value: Any, folder: Path, files: dict[str, Path]) -> Any:
    """A value as a file in a folder can hold it, without keys at infinity, and its `files`."""
    if isinstance(value, Mapping):
        return {
            name: _plain(each, folder, files)
            for name, each in value.items()
            if not (isinstance(each, float) and math.isinf(each))
        }
    if isinstance(value, list | tuple):
        return [_plain(each, folder, files) for each in value]
    if isinstance(value, Path):
        relative = Path(os.path.relpath(value.resolve(), folder.resolve())).as_posix()
        name = relative if relative.startswith("../") else f"./{relative}"
        files[name] = value
        return name
    if isinstance(value, Enum):
        return value.value
    if isinstance(value, date):
        return value.isoformat()
    return value


@cache
def machine() -> dict[str, Any]:
    """Platform, processor, and the kernels that libraries chose for it, ready for `json.dumps`."""
    found: Any = np.show_config(mode="dicts")
    lines = _lines("/proc/cpuinfo")
    names = [line.partition(":")[2].strip() for line in lines if line.startswith("model name")]
    return {
        "platform": platform.platform(),
        "python": platform.python_version(),
        "cpus": os.cpu_count(),
        "processor": names[0] if names else platform.processor() or platform.machine(),
        "numpy": " ".join(found["SIMD Extensions"].get("found", [])) or "baseline",
        "blas": f"{found['Build Dependencies']['blas']['name']} {_blas_core()}".strip(),
        "libm": " ".join(platform.libc_ver()).strip() or "unknown",
    }


def kernels(of: dict[str, Any]) -> str:
    """Processor and kernels of a `machine` in words; empty if it does not say them."""
    if "processor" not in of:
        return ""
    return f"{of['processor']}, numpy {of['numpy']}, {of['blas']}, libm {of['libm']}"


def _blas_core() -> str:
    """Kind of processor whose kernels OpenBLAS runs; empty for another library."""
    lines = (line for line in _lines("/proc/self/maps") if "openblas" in line)
    for path in {line.split(maxsplit=5)[-1] for line in lines}:  # it may have spaces
        library = ctypes.CDLL(path)
        for name in _CORE_NAMES:
            if hasattr(library, name):
                core_name = getattr(library, name)
                core_name.restype = ctypes.c_char_p
                return str(core_name().decode())
    return ""


def _lines(path: str) -> list[str]:
    file = Path(path)
    return os.fsdecode(file.read_bytes()).split("\n") if file.exists() else []
