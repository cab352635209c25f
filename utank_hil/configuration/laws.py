"""The section ``law`` of a controller: one of the registered designs, chosen by its kind.

With ``tuning: auto`` the kinds `LINEAR_KINDS` take no numbers but a sea.

Laws of installed packages join by entry points of the group ``utank_hil.laws``: the name is the
kind, the value a design as in `LAWS`: a frozen dataclass with its kind, its parameters with their
ranges, and `build`, which designs the law for a plant (`LawDesign`).
"""

from collections.abc import Callable
from dataclasses import MISSING, Field, asdict, field, fields, make_dataclass
from functools import reduce
from importlib.metadata import entry_points
from operator import or_
from typing import TYPE_CHECKING, Annotated, Any, Final, get_args, get_type_hints

from pydantic import (
    BeforeValidator,
    Discriminator,
    PlainSerializer,
    Tag,
    ValidationInfo,
    WrapValidator,
)

from utank_hil.analysis.loop.linear_tuning import LINEAR_KINDS, AutoDesign
from utank_hil.analysis.loop.self_tuning import SelfTunedDesign
from utank_hil.base.parameters import refuse
from utank_hil.configuration.files import ALLOW_CODE
from utank_hil.configuration.matrices import SystemFile
from utank_hil.configuration.spectra import LawSea
from utank_hil.control.constrained.design import ConstrainedDesign
from utank_hil.control.feedback_linearization import FeedbackLinearizationDesign
from utank_hil.control.fuzzy.adaptive import RobustFuzzy
from utank_hil.control.fuzzy.indirect import IndirectFuzzy, SmallGainFuzzy
from utank_hil.control.gain import PassiveDesign, PDDesign
from utank_hil.control.heel_removal import HeelRemovalDesign
from utank_hil.control.interface import LawDesign
from utank_hil.control.lqg_design import LQGDesign
from utank_hil.control.predictive.design import PredictiveDesign
from utank_hil.control.python_law import PythonDesign
from utank_hil.control.sea_model import SeaModel
from utank_hil.control.semi_active import ClippedValveDesign, OnOffValveDesign, PumpWithValveDesign
from utank_hil.control.state_space import StateSpaceDesign, SystemMatrices
from utank_hil.control.stimulation import StimulationDesign

LAWS: Final[tuple[type[LawDesign], ...]] = (
    PassiveDesign,
    PDDesign,
    LQGDesign,
    PredictiveDesign,
    ConstrainedDesign,
    FeedbackLinearizationDesign,
    RobustFuzzy,
    SmallGainFuzzy,
    IndirectFuzzy,
    StimulationDesign,
    StateSpaceDesign,
    PythonDesign,
    OnOffValveDesign,
    ClippedValveDesign,
    PumpWithValveDesign,
    HeelRemovalDesign,
)


GROUP: Final = "utank_hil.laws"

_AUTO: Final = "tuning auto"
_AUTO_KEYS: Final = frozenset(each.name for each in fields(AutoDesign))


def _tag(content: Any) -> Any:
    given = content if isinstance(content, dict) else {"kind": getattr(content, "kind", None)}
    automatic = "tuning" in given or isinstance(content, AutoDesign)
    return _AUTO if automatic and given.get("kind") in LINEAR_KINDS else given.get("kind")


def _without_numbers(content: Any) -> Any:
    """Refuse keys that `AutoDesign` computes itself."""
    if isinstance(content, dict):
        reason = "and tuning: auto exclude each other, for the numbers follow from it: remove one"
        given = [(name, reason) for name in content if name not in _AUTO_KEYS]
        refuse("law", given)
    return content


def _code_allowed(content: Any, info: ValidationInfo) -> Any:
    """Refuse code unless the reader of the file allows it."""
    if isinstance(content, dict) and not (info.context or {}).get(ALLOW_CODE):
        reason = (
            f"is python: it runs {content.get('factory', 'code')}, which the file names; allow it "
            "by --allow-code if you trust the file and that code"
        )
        refuse("law", [("kind", reason)])
    return content


def _as_written(design: Any, sections: dict[Any, Any]) -> Any:
    """Return the annotation of a design whose `sections`, by type, have other written forms."""
    hints = get_type_hints(design, include_extras=True)
    own = {
        name: reduce(or_, (sections.get(each, each) for each in get_args(hint) or (hint,)))
        for name, hint in hints.items()
        if sections.keys() & {hint, *get_args(hint)}
    }
    if not own:
        return design
    parameters = [
        (each.name, own[each.name], field(**_default(each)))
        for each in fields(design)
        if each.name in own
    ]
    name, known = design.__name__, {"__doc__": design.__doc__}
    written = make_dataclass(name, parameters, bases=(design,), namespace=known, frozen=True)

    def read(content: Any, checked: Callable[[Any], Any]) -> Any:
        if isinstance(content, design):
            return content
        found = checked(content)
        return design(**{each.name: getattr(found, each.name) for each in fields(found)})

    return Annotated[written, WrapValidator(read), PlainSerializer(asdict)]


def _default(parameter: Field[Any]) -> dict[str, Any]:
    given = {name: getattr(parameter, name) for name in ("default", "default_factory")}
    return {name: value for name, value in given.items() if value is not MISSING}


def _one_of(written: dict[type[LawDesign], Any], automatic: Any) -> Any:
    """Return the annotation of one of these designs, with or without given numbers."""
    given = [
        Annotated[each, Tag(kind)]
        for design, each in written.items()
        for kind in get_args(get_type_hints(design)["kind"])
    ]
    return Annotated[reduce(or_, (*given, Annotated[automatic, Tag(_AUTO)])), Discriminator(_tag)]


if TYPE_CHECKING:
    AnyDesign = LawDesign
else:
    _designs = (*LAWS, SelfTunedDesign, *(point.load() for point in entry_points(group=GROUP)))
    _valves = (OnOffValveDesign, ClippedValveDesign, PumpWithValveDesign)
    _sections = {SeaModel: LawSea, SystemMatrices: SystemFile}
    _automatic = Annotated[_as_written(AutoDesign, _sections), BeforeValidator(_without_numbers)]
    # The design within another one is that of a pump, and never code.
    _of_a_pump = {
        each: _as_written(each, _sections)
        for each in _designs
        if each not in (PythonDesign, *_valves)
    }
    _pump = {LawDesign: _one_of(_of_a_pump, _automatic)}
    _code = {PythonDesign: Annotated[PythonDesign, BeforeValidator(_code_allowed)]}
    _of_a_valve = {each: _as_written(each, _pump) for each in _valves}
    AnyDesign = _one_of(_of_a_pump | _code | _of_a_valve, _automatic)


def sample_time(law: LawDesign) -> tuple[str, float] | None:
    """Return the key below ``law`` and the value of a law's sample time, if it is a parameter."""
    name, part = "", law
    for section in ("pump", "predictor", "system"):
        if hasattr(part, section):
            name, part = f"{name}{section}.", getattr(part, section)
    value: Any = getattr(part, "sample_time_s", None)
    return None if value is None else (f"{name}sample_time_s", value)
