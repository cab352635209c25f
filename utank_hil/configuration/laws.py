"""The section ``law`` of a controller: one of the registered laws, chosen by its kind.

Laws of installed packages join by entry points of the group ``utank_hil.laws``: the name is the
kind, the value a design as `utank_hil.control.registry` lists them.
"""

from dataclasses import dataclass
from functools import reduce
from importlib.metadata import entry_points
from operator import or_
from typing import TYPE_CHECKING, Annotated, Any, Final

from pydantic import Field

from utank_hil.analysis.loop.self_tuning import SelfTunedDesign
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
class StateSpaceFromFile(StateSpaceDesign):
    """A law in matrices, which may stand in a data file."""

    system: SystemFile


_FROM_FILE: Final[dict[type[LawDesign], type[LawDesign]]] = {
    ConstrainedDesign: ConstrainedFromFile,
    StateSpaceDesign: StateSpaceFromFile,
}

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
    PumpLaw = Annotated[reduce(or_, _of_a_pump), Field(discriminator="kind")]


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
    _kinds = (*_of_a_pump, OnOffValveDesign, ClippedValveFromFile, PumpWithValveFromFile)
    Law = Annotated[reduce(or_, _kinds), Field(discriminator="kind")]


def sample_time(law: LawDesign) -> tuple[str, float] | None:
    """Dotted key below ``law`` and value of a law's sample time, if that is a parameter of it."""
    name, part = "", law
    for section in ("pump", "predictor", "system"):
        if hasattr(part, section):
            name, part = f"{name}{section}.", getattr(part, section)
    value: Any = getattr(part, "sample_time_s", None)
    return None if value is None else (f"{name}sample_time_s", value)
