"""The head of a frame log: inputs of a replay beside the frames, and values to compare it with."""

import hashlib
import importlib.metadata
import platform
import tempfile
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any, Final

import msgspec
from pydantic import BaseModel, ValidationError

from utank_hil.base.finite import mapped
from utank_hil.base.provenance import commit, describe, version
from utank_hil.canbus import load_catalogue
from utank_hil.configuration import ControllerConfig
from utank_hil.control import BuiltLaw
from utank_hil.control.python_law import PythonDesign
from utank_hil.telemetry import law_values
from utank_hil.telemetry.law_values import packed, unpacked

_PACKAGES: Final = ("numpy", "scipy", "daqp")
_CODE: Final = "python"  #: Kind of a law that is the user's own code.
_SHOWN: Final = 10  #: Differences that fit on a screen.


class ReplayHeadError(ValueError):
    """The content of a log can't be run here; the message gives reason and remedy."""


class _Head(msgspec.Struct):
    """What `replay` takes from a head."""

    about: dict[str, Any]
    retuner: bool
    packages: dict[str, str]
    catalogue: int
    law: dict[str, tuple[str, list[int], str]]
    files: dict[str, str]
    estimating: bool = False
    commissioned: bool = True


def refuse_foreign(head: Mapping[str, Any]) -> None:
    """Raise ReplayHeadError for a head that is not as `replay_head` writes it."""
    try:
        found = msgspec.convert(head, _Head)
        law_values.decoded(found.law)
        for data in found.files.values():
            unpacked(data)
    except (ValueError, TypeError) as error:
        raise _foreign(error) from error


def _foreign(error: Exception) -> ReplayHeadError:
    return ReplayHeadError(f"its head is not one that this program writes: {error!r}")


def replay_head(
    command: str,
    config: ControllerConfig,
    law: BuiltLaw,
    folder: Path,
    *,
    options: Mapping[str, Any],
    retuner: bool,
    estimating: bool,
    commissioned: bool = True,
    seed: int | None = None,
    scenario: BaseModel | None = None,
) -> dict[str, Any]:
    """Describe a run so that it can be replayed elsewhere; ready for `json.dumps`.

    `command` has the `options`, `folder` is that of the log, `seed` that of simulated waves and
    noise, `scenario` that of the waves. `retuner`, `estimating` and `commissioned` say what the
    controller has and whether it could be armed. The head holds ``about``
    (`utank_hil.base.provenance`), every number of the ``law`` and the content of the data
    ``files``.
    """
    about = describe(command, config, folder, options=options, seed=seed, scenario=scenario)
    needed = describe(command, config, folder, options={})["data"]  # not those of the sea
    return {
        "about": about,
        "retuner": retuner,
        "estimating": estimating,
        "commissioned": commissioned,
        "packages": _packages(),
        "catalogue": load_catalogue().version,
        "law": law_values.encoded(law_values.law_values(law.controller())),
        "files": {name: packed((folder / name).read_bytes()) for name in needed},
    }


@contextmanager
def recorded_config(head: Mapping[str, Any]) -> Iterator[ControllerConfig]:
    """Yield the configuration of a head, with its data files, while the context lasts.

    ReplayHeadError is raised if this version can't read it, or the log only names the law's code.
    """
    with tempfile.TemporaryDirectory(prefix="utank-replay-") as folder:
        places = {}
        try:
            for number, (name, data) in enumerate(head["files"].items()):
                places[name] = str(Path(folder, f"{number}-{Path(name).name}"))
                Path(places[name]).write_bytes(unpacked(data))
            content = _put(_in_full(head["about"]["configuration"]), places)
        except (LookupError, TypeError, AttributeError, ValueError) as error:
            raise _foreign(error) from error
        if code := next(_code(content.get("law")), None):
            raise ReplayHeadError(
                f"its law is Python code, {code}, which a log must not choose: name the "
                "configuration that it ran with by --config"
            )
        try:
            config = ControllerConfig.model_validate(content)
        except ValidationError as error:
            first = error.errors()[0]
            key = ".".join(map(str, first["loc"]))
            raise ReplayHeadError(
                f"this version does not take its configuration: {key}: {first['msg']}; name one "
                "that it takes by --config, or replay it with the version that recorded it"
            ) from error
        yield config


def _in_full(configuration: dict[str, Any]) -> dict[str, Any]:
    """Return a recorded configuration with the key that it may be too old for.

    Before it a ship had one version: that of an emulated one now.
    """
    vessel = configuration.get("vessel")
    if not isinstance(vessel, dict):
        return configuration
    return configuration | {"vessel": {"emulated": True} | vessel}


def _code(law: Any) -> Iterator[str]:
    """Return the factories of a law, and of its inner laws, that are the user's own code."""
    if isinstance(law, dict):
        if law.get("kind") == _CODE:
            yield str(law.get("factory"))
        law = list(law.values())
    if isinstance(law, list):
        for part in law:
            yield from _code(part)


def recorded_law(
    head: Mapping[str, Any], config: ControllerConfig, law: BuiltLaw
) -> tuple[BuiltLaw, str]:
    """Return the recorded law and an empty text, or the given law and why it replaces it.

    `law` is designed for the recorded `config` here; its `linear`, for loop analysis, stays.
    """
    if isinstance(config.law, PythonDesign):
        return law, "the law is Python code of one's own, which keeps its numbers where it likes"
    values = law_values.decoded(head["law"])
    make = law.controller
    try:
        law_values.restored(make(), values)
    except law_values.LawValuesError as error:
        return law, f"the recorded numbers do not fit this version's law: {error}"
    return replace(law, controller=lambda: law_values.restored(make(), values)), ""


def law_differences(head: Mapping[str, Any], law: BuiltLaw) -> list[law_values.ValueDifference]:
    """Return the differences, array by array, of the recorded law and one designed here."""
    designed = law_values.law_values(law.controller())
    return law_values.differences(law_values.decoded(head["law"]), designed)


def causes(head: Mapping[str, Any], config: ControllerConfig, folder: Path) -> list[str]:
    """Return other differences of a recorded run and one of `config` that may change frames."""
    about = head["about"]
    found = [
        f"{name}: recorded {recorded}, here {here}"
        for name, recorded, here in (
            ("version", about.get("version"), version()),
            ("commit", about.get("commit"), commit()),
            ("catalogue", head["catalogue"], load_catalogue().version),
            *((name, head["packages"].get(name), here) for name, here in _packages().items()),
        )
        if recorded not in (None, here)
    ]
    digests = {
        name: hashlib.sha256(unpacked(data)).hexdigest() for name, data in head["files"].items()
    }
    here = describe("replay", config, folder, options={})
    recorded_keys = _flat(_put(_in_full(about["configuration"]), digests))
    replayed_keys = _flat(_put(here["configuration"], here["data"]))
    return found + few(
        [
            f"configuration, {key}: recorded {recorded_keys.get(key, 'absent')!r}, "
            f"replayed {replayed_keys.get(key, 'absent')!r}"
            for key in dict.fromkeys((*recorded_keys, *replayed_keys))
            if _set(recorded_keys.get(key)) != _set(replayed_keys.get(key))
        ]
    )


def few(lines: list[str]) -> list[str]:
    """Return the first lines, and the number of further ones."""
    more = len(lines) - _SHOWN
    return [*lines[:_SHOWN], f"and {more} more"] if more > 0 else lines


def _packages() -> dict[str, str]:
    return {
        "python": platform.python_version(),
        **{name: importlib.metadata.version(name) for name in _PACKAGES},
    }


def _put(value: Any, places: Mapping[str, str]) -> Any:
    return mapped(value, lambda each: places.get(each, each) if isinstance(each, str) else each)


def _flat(value: Any, key: str = "") -> dict[str, Any]:
    if not isinstance(value, dict | list):
        return {key: value}
    found: dict[str, Any] = {}
    for part, content in value.items() if isinstance(value, dict) else enumerate(value):
        found.update(_flat(content, f"{key}.{part}".lstrip(".")))
    return found


def _set(value: object) -> object:
    """A key's value; None where it is as without the key, in a version that did not have it."""
    return None if value is False else value
