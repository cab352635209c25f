"""docs/configuration.md: every key of every configuration file, made from the classes they fill.

The ranges are the annotations' own; what a key means stands beside its field.
"""

import inspect
import textwrap
from collections.abc import Iterator
from dataclasses import MISSING, fields, is_dataclass
from enum import Enum
from pathlib import Path
from types import NoneType, UnionType
from typing import Annotated, Any, Literal, Union, get_args, get_origin, get_type_hints

from numpydoc.docscrape import NumpyDocString
from pydantic import BaseModel
from pydantic.fields import FieldInfo
from pydantic_core import PydanticUndefined
from sphinx.pycode import ModuleAnalyzer

from firmware_sim.campaign.study import Study
from firmware_sim.scenario import Scenario
from utank_hil.base.parameters import Range
from utank_hil.configuration import ControllerConfig, Vessel

PAGE = Path(__file__).resolve().parents[2] / "docs" / "configuration.md"

HEAD = """\
# Configuration files

<!-- Written by tools/documents/configuration.py (make docs) from the classes that the files fill;
do not edit. -->

All are YAML. Lengths in metres, angles in radians, pressures in pascal: the unit is in the name of
the key. `utank-hil check FILE` names every wrong key with its file and what it must be. Where a
file stands in another, its path may stand in its place, relative to the file that names it. A key
without a default is required.
"""

FILES = (
    (Vessel, "Ship files", "`configs/ships`: a ship, its tank and its actuators. How to write one: "
     "[how-to/ship.md](how-to/ship.md)."),
    (ControllerConfig, "Controller files", "`configs/controllers`: what `utank-hil run` takes."),
    (Scenario, "Scenario files", "`configs/scenarios`: what `utank-hil bench` takes."),
    (Study, "Study files", "`configs/studies`: what `utank-hil campaign` takes, see "
     "[bench.md](bench.md)."),
)  # fmt: skip

GENERAL = {
    "action": "What the operator does; `accept` an alarm, `take` the command over, `undo`, "
    "`forbid` and `permit` retuning.",
    "amplitude_m": "Of the wave.",
    "at_s": "When the fault begins, since the start; in a campaign since its `fault_s`.",
    "bit_rate": "Of the CAN bus, bits per second.",
    "command_timeout_ms": "Silence of the controller after which the drive stops on its own.",
    "control_horizon": "Samples over which the pressure is planned.",
    "density_kg_m3": "Of the water.",
    "duration_s": "Of the run.",
    "every": "One frame of so many.",
    "for_s": "How long the fault lasts; without it till the end.",
    "gamma": "Peak enhancement of the JONSWAP spectrum.",
    "hs_m": "Significant wave height.",
    "message": "Name of the message in the catalogue.",
    "name": "As tables and pictures show it.",
    "node": "Name of the node: sensors, drive, valve, panel or controller.",
    "period_s": "Of the wave.",
    "prediction_horizon": "Samples over which the roll is predicted.",
    "rho": "Attenuation of the disturbance: the less, the greater the gain on psi (eq. 4.21).",
    "sample_time_s": "Time between two answers of the law, a whole number of ticks of 10 ms.",
    "seed": "Of waves and sensor noise: the same seed gives the same run.",
    "signals": "Names of signals of the message.",
    "speed_m_s": "Of the ship ahead, which shifts the periods that it meets the waves with.",
    "threshold_rad_m_s2": "Of the switching function, within which the valve stays as it is.",
    "time_s": "Since the start of the run.",
    "tp_s": "Peak period.",
    "values": "Signals and what they say: a number, a name of their table, or nothing.",
    "D": "Matrix of the law, see `A`.",
}
"""Keys that mean the same in every section, or whose class explains them elsewhere."""


def page() -> str:
    """The page, written anew."""
    done: set[type] = set()
    parts = [HEAD]
    for model, title, text in FILES:
        parts.append(f"## {title}\n\n{text}\n")
        waiting: list[tuple[str, type]] = [("", model)]
        while waiting:
            key, section = waiting.pop(0)
            if section in done:
                continue
            done.add(section)
            rows, inner = _rows(section, key)
            if key:
                kind = _kind(section)
                of_kind = f", `kind`: {kind}" if kind else ""
                parts.append(f"### `{key}`{of_kind}\n\n{_first_line(section)}\n")
            if rows:
                parts.append("| key | value | default | meaning |\n|---|---|---|---|\n" + rows)
            waiting += inner
    return "\n".join(parts)


def _rows(section: type, key: str) -> tuple[str, list[tuple[str, type]]]:
    """Rows of a section's table, and the sections that it holds."""
    meanings = _meanings(section)
    rows, inner = [], []
    for name, hint, default in _members(section):
        if name == "kind":
            continue
        place = f"{key}.{name}" if key else name
        inner += [(place, each) for each in _sections(hint)]
        meaning = meanings.get(name) or next(map(_first_line, _sections(hint)), GENERAL.get(name))
        if meaning is None:
            raise ValueError(f"{section.__name__}.{name} is explained nowhere: add a docstring")
        cells = (f"`{name.rstrip('_')}`", _value(hint), _default(default), meaning)
        rows.append("| " + " | ".join(cell.replace("|", "\\|") for cell in cells) + " |\n")
    return "".join(rows), inner


def _members(section: type) -> Iterator[tuple[str, Any, Any]]:
    """Name, annotation and default of each key; a default that is missing is `MISSING`."""
    hints = get_type_hints(section, include_extras=True)
    if issubclass(section, BaseModel):
        for name, info in section.model_fields.items():
            yield name, hints[name], _default_of(info)
    elif is_dataclass(section):
        for field in fields(section):
            if field.init:
                made = field.default_factory
                yield field.name, hints[field.name], field.default if made is MISSING else made()


def _default_of(info: FieldInfo) -> Any:
    made = info.default_factory
    if made is not None:
        return made()  # type: ignore[call-arg]
    return MISSING if info.default is PydanticUndefined else info.default


def _alone(hint: Any) -> Iterator[Any]:
    """The members of a union, with their marks."""
    origin = get_origin(hint)
    if origin is Annotated and get_origin(get_args(hint)[0]) in (Union, UnionType):
        yield from _alone(get_args(hint)[0])
    elif origin in (Union, UnionType):
        for each in get_args(hint):
            yield from _alone(each)
    elif origin is Annotated and _is_section(get_args(hint)[0]):
        yield get_args(hint)[0]
    elif hint is not NoneType:
        yield hint


def _is_section(hint: Any) -> bool:
    return isinstance(hint, type) and (issubclass(hint, BaseModel) or is_dataclass(hint))


def _sections(hint: Any) -> Iterator[type]:
    """Sections within an annotation, however deep in lists and mappings."""
    if _is_section(hint):
        yield hint
    for each in get_args(hint):
        yield from _sections(each)


def _value(hint: Any) -> str:
    """What a value must be, in words."""
    members = list(_alone(hint))
    named = [kind for each in members if _is_section(each) and (kind := _kind(each))]
    kinds = dict.fromkeys(kind for each in named for kind in each.split(", "))
    if len(named) > 1:
        return "section of one `kind`: " + ", ".join(kinds)
    return " or ".join(dict.fromkeys(_one(each) for each in members))


def _one(hint: Any) -> str:
    origin, arguments = get_origin(hint), get_args(hint)
    if origin is Annotated:
        demand = next((mark.demand for mark in arguments[1:] if isinstance(mark, Range)), "")
        inner = _value(arguments[0])
        return f"{inner}, {demand.removeprefix('must be ')}" if demand else inner
    if origin is Literal:
        return " or ".join(f"`{each}`" for each in arguments)
    if origin in (tuple, list):
        inner = _value(arguments[0])
        return f"list: {inner}"
    if origin is dict:
        return f"mapping of names to: {_value(arguments[1])}"
    if isinstance(hint, type) and issubclass(hint, Enum):
        return " or ".join(f"`{each.value}`" for each in hint)
    if _is_section(hint):
        return f"section of `kind`: {kind}" if (kind := _kind(hint)) else "section"
    words = {
        float: "number",
        int: "whole number",
        bool: "`true` or `false`",
        str: "text",
        Any: "any value",
    }
    return words.get(hint, "path" if hint is Path else getattr(hint, "__name__", "value"))


def _default(value: Any) -> str:
    if value is MISSING:
        return ""
    if value is None:
        return "none"
    if isinstance(value, bool):
        return f"`{str(value).lower()}`"
    if isinstance(value, Enum):
        return f"`{value.value}`"
    if isinstance(value, float):
        words = {"inf": "no limit", "nan": "none"}
        return words.get(f"{value:g}", f"`{value:g}`")
    if isinstance(value, int | str):
        return f"`{value}`"
    if isinstance(value, tuple | list) and value and not is_dataclass(value[0]):
        return "`[" + ", ".join(str(each) for each in value) + "]`"
    return "that of its keys"  # a section, or a list or mapping without entries


def _kind(section: type) -> str:
    """The value of `kind` by which a section is chosen; empty if it is not."""
    for name, hint, _ in _members(section):
        if name == "kind":
            return ", ".join(f"`{each}`" for each in get_args(hint))
    return ""


def _first_line(section: type) -> str:
    return (inspect.getdoc(section) or "").partition("\n\n")[0].replace("\n", " ")


def _meanings(section: type) -> dict[str, str]:
    """What each key means, from the docstrings of its class and of those that it extends."""
    found: dict[str, str] = {}
    for each in reversed(section.__mro__):
        text = each.__dict__.get("__doc__")
        if text and each.__module__.startswith(("utank_hil", "firmware_sim")):
            parsed = NumpyDocString(textwrap.dedent(text))
            for parameter in (*parsed["Parameters"], *parsed["Attributes"]):
                meaning = " ".join(" ".join(parameter.desc).split())
                for name in parameter.name.split(", "):
                    if not meaning.startswith("As in "):
                        found[name] = meaning
            documented = ModuleAnalyzer.for_module(each.__module__).find_attr_docs()
            for (owner, name), lines in documented.items():
                if owner == each.__name__:
                    found[name] = " ".join(" ".join(lines).split())
    return found
