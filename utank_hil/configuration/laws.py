"""The section ``law`` of a controller: one of the registered laws, chosen by its kind.

With ``tuning: auto`` the kinds `LINEAR_KINDS` take no numbers but a sea.

Laws of installed packages join by entry points of the group ``utank_hil.laws``: the name is the
kind, the value a design as `utank_hil.control.registry` lists them.
"""

from dataclasses import dataclass, fields
from functools import reduce
from importlib.metadata import entry_points
from operator import or_
from typing import TYPE_CHECKING, Annotated, Any, Final, get_args, get_type_hints

from pydantic import BeforeValidator, Discriminator, Tag

from utank_hil.analysis.auto_tuning import AutoDesign
from utank_hil.analysis.loop.scaled_law import LINEAR_KINDS
from utank_hil.analysis.loop.self_tuning import SelfTunedDesign
from utank_hil.base.parameters import refuse
from utank_hil.configuration.matrices import SystemFile
from utank_hil.configuration.spectra import LawSea
from utank_hil.control.constrained.design import ConstrainedDesign
from utank_hil.control.interface import LawDesign
from utank_hil.control.pump_with_valve import PumpWithValveDesign
from utank_hil.control.registry import LAWS
from utank_hil.control.semi_active import ClippedValveDesign, OnOffValveDesign
from utank_hil.control.state_space import StateSpaceDesign

GROUP: Final = "utank_hil.laws"


@dataclass(frozen=True, slots=True)
class ConstrainedFromFile(ConstrainedDesign):
    """A constrained law whose sea a file may name as a scenario does."""

    sea: LawSea


@dataclass(frozen=True, slots=True)
class SelfTunedFromFile(SelfTunedDesign):
    """A self-tuned law whose sea a file may name as a scenario does."""

    sea: LawSea | None = None


@dataclass(frozen=True, slots=True)
class AutoFromFile(AutoDesign):
    """With `tuning: auto`: numbers follow from ship, pump and a sea, which a file may name."""

    sea: LawSea | None = None


@dataclass(frozen=True, slots=True)
class StateSpaceFromFile(StateSpaceDesign):
    """A law in matrices, which may stand in a data file."""

    system: SystemFile


_FROM_FILE: Final[dict[type[LawDesign], type[LawDesign]]] = {
    ConstrainedDesign: ConstrainedFromFile,
    StateSpaceDesign: StateSpaceFromFile,
}

_AUTO: Final = "tuning auto"
_AUTO_KEYS: Final = frozenset(each.name for each in fields(AutoDesign))


def _tag(content: Any) -> Any:
    """Which law is meant: its kind, or `_AUTO`."""
    given = content if isinstance(content, dict) else {"kind": getattr(content, "kind", None)}
    automatic = "tuning" in given or isinstance(content, AutoDesign)
    return _AUTO if automatic and given.get("kind") in LINEAR_KINDS else given.get("kind")


def _without_numbers(content: Any) -> Any:
    """Refuse what `AutoDesign` finds itself."""
    if isinstance(content, dict):
        reason = "and tuning: auto exclude each other, for the numbers follow from it: remove one"
        given = [(name, reason) for name in content if name not in _AUTO_KEYS]
        refuse("law", given)
    return content


def _one_of(*kinds: type[LawDesign]) -> Any:
    """Annotation of a law of one of these kinds, its numbers given or not."""
    given = [
        Annotated[each, Tag(kind)]
        for each in kinds
        for kind in get_args(get_type_hints(each)["kind"])
    ]
    automatic = Annotated[AutoFromFile, BeforeValidator(_without_numbers), Tag(_AUTO)]
    return Annotated[reduce(or_, (*given, automatic)), Discriminator(_tag)]


if TYPE_CHECKING:
    PumpLaw = LawDesign
else:
    _installed = tuple(point.load() for point in entry_points(group=GROUP))
    _of_a_valve = (OnOffValveDesign, ClippedValveDesign, PumpWithValveDesign)
    _of_a_pump = tuple(
        _FROM_FILE.get(law, law)
        for law in (*LAWS, SelfTunedFromFile, *_installed)
        if law not in _of_a_valve
    )
    PumpLaw = _one_of(*_of_a_pump)


@dataclass(frozen=True, slots=True)
class ClippedValveFromFile(ClippedValveDesign):
    """A valve's law that holds a pump's law."""

    pump: PumpLaw


@dataclass(frozen=True, slots=True)
class PumpWithValveFromFile(PumpWithValveDesign):
    """A law of pump and valve that holds a pump's law."""

    pump: PumpLaw


if TYPE_CHECKING:
    Law = LawDesign
else:
    Law = _one_of(*_of_a_pump, OnOffValveDesign, ClippedValveFromFile, PumpWithValveFromFile)


def sample_time(law: LawDesign) -> tuple[str, float] | None:
    """Dotted key below ``law`` and value of a law's sample time, if that is a parameter of it."""
    name, part = "", law
    for section in ("pump", "predictor", "system"):
        if hasattr(part, section):
            name, part = f"{name}{section}.", getattr(part, section)
    value: Any = getattr(part, "sample_time_s", None)
    return None if value is None else (f"{name}sample_time_s", value)
