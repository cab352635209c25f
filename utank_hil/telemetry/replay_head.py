"""The head of a frame log: what a replay needs beside the frames, and what it is compared by."""

import base64
import hashlib
import importlib.metadata
import platform
import tempfile
import zlib
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any, Final

from pydantic import ValidationError

from utank_hil.base.provenance import commit, describe, version
from utank_hil.canbus import load_catalogue
from utank_hil.configuration import ControllerConfig
from utank_hil.control import BuiltLaw
from utank_hil.control.python_law import PythonDesign
from utank_hil.telemetry import law_values

_PACKAGES: Final = ("numpy", "scipy", "daqp")
_CODE: Final = "python"
"""Kind of a law that is code of one's own."""
_SHOWN: Final = 10


class ReplayHeadError(ValueError):
    """What a log holds can't be run here; the message says why and what to do."""


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
) -> dict[str, Any]:
    """Describe a run so that it can be replayed elsewhere; ready for `json.dumps`.

    Parameters
    ----------
    command : str
        Name of the command that runs.
    law : BuiltLaw
        Of the configuration.
    folder : Path
        Where the log is written.
    options : mapping
        Of the command.
    retuner, estimating : bool
        Whether the controller has a retuner, and an estimator of sea and ship.
    commissioned : bool
        Whether it could be armed.
    seed : int, optional
        Of waves and noise, where they are simulated.

    Returns
    -------
    dict
        ``about`` (`utank_hil.base.provenance`), ``retuner``, ``estimating``, ``commissioned``,
        ``packages``, ``catalogue`` (its version), ``law`` (every number of it), ``files`` (content
        of the data files).
    """
    about = describe(command, config, folder, options=options, seed=seed)
    return {
        "about": about,
        "retuner": retuner,
        "estimating": estimating,
        "commissioned": commissioned,
        "packages": _packages(),
        "catalogue": load_catalogue().version,
        "law": law_values.encoded(law_values.law_values(law.controller())),
        "files": {
            name: base64.b85encode(zlib.compress((folder / name).read_bytes(), 9)).decode()
            for name in about["data"]
        },
    }


@contextmanager
def recorded_config(head: Mapping[str, Any]) -> Iterator[ControllerConfig]:
    """The configuration in a head, with its data files, for as long as the context lasts.

    Raises
    ------
    ReplayHeadError
        If this version can't read it, or its law is code that the log names.
    """
    with tempfile.TemporaryDirectory(prefix="utank-replay-") as folder:
        places = {}
        for number, (name, data) in enumerate(head["files"].items()):
            places[name] = str(Path(folder, f"{number}-{Path(name).name}"))
            Path(places[name]).write_bytes(zlib.decompress(base64.b85decode(data)))
        content = _put(head["about"]["configuration"], places)
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


def _code(law: Any) -> Iterator[str]:
    """Factories of a law, and of those that it holds at any depth, that are code of one's own."""
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
    """The law that was recorded, and an empty text; else the law given, and why it is not that.

    Parameters
    ----------
    config : ControllerConfig
        The recorded one.
    law : BuiltLaw
        Designed for it here. A controller of it with the recorded numbers in their places is what
        was recorded; its `linear`, for the analysis of its loop, stays the one designed here.
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
    """What differs between the recorded law and one designed here, array by array."""
    return law_values.differences(
        law_values.decoded(head["law"]), law_values.law_values(law.controller())
    )


def causes(head: Mapping[str, Any], config: ControllerConfig, folder: Path) -> list[str]:
    """What else differs between a recorded run and one of `config` here: it may change frames."""
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
        name: hashlib.sha256(zlib.decompress(base64.b85decode(data))).hexdigest()
        for name, data in head["files"].items()
    }
    here = describe("replay", config, folder, options={})
    recorded_keys = _flat(_put(about["configuration"], digests))
    replayed_keys = _flat(_put(here["configuration"], here["data"]))
    return found + few(
        [
            f"configuration, {key}: recorded {recorded_keys.get(key, 'absent')!r}, "
            f"replayed {replayed_keys.get(key, 'absent')!r}"
            for key in dict.fromkeys((*recorded_keys, *replayed_keys))
            if recorded_keys.get(key, "absent") != replayed_keys.get(key, "absent")
        ]
    )


def few(lines: list[str]) -> list[str]:
    """The first lines, and how many there are more."""
    more = len(lines) - _SHOWN
    return [*lines[:_SHOWN], f"and {more} more"] if more > 0 else lines


def _packages() -> dict[str, str]:
    return {
        "python": platform.python_version(),
        **{name: importlib.metadata.version(name) for name in _PACKAGES},
    }


def _put(value: Any, places: Mapping[str, str]) -> Any:
    """A configuration with other strings in the place of some."""
    if isinstance(value, dict):
        return {name: _put(each, places) for name, each in value.items()}
    if isinstance(value, list):
        return [_put(each, places) for each in value]
    return places.get(value, value) if isinstance(value, str) else value


def _flat(value: Any, key: str = "") -> dict[str, Any]:
    """Values of a configuration by their dotted keys."""
    if isinstance(value, dict):
        parts = value.items()
    elif isinstance(value, list):
        parts = ((str(index), each) for index, each in enumerate(value))  # type: ignore[assignment]
    else:
        return {key: value}
    return {
        name: each
        for part, content in parts
        for name, each in _flat(content, f"{key}.{part}".lstrip(".")).items()
    }
