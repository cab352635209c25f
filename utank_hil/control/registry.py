"""The laws that a configuration can name, one line each.

A design is a frozen dataclass in the law's own file: its kind, its parameters with their ranges,
and `build`, which designs the law for a plant (`LawDesign`).
"""

from typing import Final

from utank_hil.control.constrained.design import ConstrainedDesign
from utank_hil.control.feedback_linearization import FeedbackLinearizationDesign
from utank_hil.control.fuzzy.direct import RobustFuzzy, SmallGainFuzzy
from utank_hil.control.fuzzy.indirect import IndirectFuzzy
from utank_hil.control.interface import LawDesign
from utank_hil.control.lqg_design import LQGDesign
from utank_hil.control.passive import PassiveDesign
from utank_hil.control.pd import PDDesign
from utank_hil.control.predictive.design import PredictiveDesign
from utank_hil.control.pump_with_valve import PumpWithValveDesign
from utank_hil.control.python_law import PythonDesign
from utank_hil.control.semi_active import ClippedValveDesign, OnOffValveDesign
from utank_hil.control.state_space import StateSpaceDesign
from utank_hil.control.stimulation import StimulationDesign

LAWS: Final[tuple[type[LawDesign], ...]] = (
    PassiveDesign,
    PDDesign,
    LQGDesign,
    PredictiveDesign,
    ConstrainedDesign,
    FeedbackLinearizationDesign,
    SmallGainFuzzy,
    RobustFuzzy,
    IndirectFuzzy,
    StimulationDesign,
    StateSpaceDesign,
    PythonDesign,
    OnOffValveDesign,
    ClippedValveDesign,
    PumpWithValveDesign,
)
