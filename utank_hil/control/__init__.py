"""Controllers: steppable objects, and the design functions they come from."""

from utank_hil.control.arx import ARX
from utank_hil.control.constrained.arx_design import design_constrained_gpc
from utank_hil.control.constrained.design import ConstrainedDesign
from utank_hil.control.design_plant import DesignPlant
from utank_hil.control.feedback_linearization import FeedbackLinearization, level_brake
from utank_hil.control.fuzzy.direct import RobustFuzzy, SmallGainFuzzy
from utank_hil.control.fuzzy.indirect import IndirectFuzzy
from utank_hil.control.gain import GainLaw
from utank_hil.control.interface import BuiltLaw, Controller, LawDesign, LinearLaw
from utank_hil.control.level_observer import LevelObserver
from utank_hil.control.limiter import CommandLimiter
from utank_hil.control.limits import PumpLimits
from utank_hil.control.lqg import LQGLaw, design_lqg, design_lqr
from utank_hil.control.lqg_design import LQGDesign
from utank_hil.control.optimal_tank import (
    PassiveOptimum,
    ShipTankRatios,
    passive_optimum,
    ship_ratios,
)
from utank_hil.control.passive import PassiveController, PassiveDesign
from utank_hil.control.pd import PD_MEASURED, design_pd
from utank_hil.control.predictive.design import PredictiveDesign, Predictor, wave_arx
from utank_hil.control.predictive.gains import design_dpc, design_gpc
from utank_hil.control.predictive.law import PredictiveController, PredictiveLaw
from utank_hil.control.sea_model import SeaModel
from utank_hil.control.semi_active import ClippedValve, OnOffValve
from utank_hil.control.state_space import StateSpaceLaw
from utank_hil.control.stimulation import Stimulation
from utank_hil.control.tracking_error import ErrorDynamics
from utank_hil.control.washout import WashoutLaw
from utank_hil.dynamics.linear import pump_model

__all__ = [
    "ARX",
    "PD_MEASURED",
    "BuiltLaw",
    "ClippedValve",
    "CommandLimiter",
    "ConstrainedDesign",
    "Controller",
    "DesignPlant",
    "ErrorDynamics",
    "FeedbackLinearization",
    "GainLaw",
    "IndirectFuzzy",
    "LQGDesign",
    "LQGLaw",
    "LawDesign",
    "LevelObserver",
    "LinearLaw",
    "OnOffValve",
    "PassiveController",
    "PassiveDesign",
    "PassiveOptimum",
    "PredictiveController",
    "PredictiveDesign",
    "PredictiveLaw",
    "Predictor",
    "PumpLimits",
    "RobustFuzzy",
    "SeaModel",
    "ShipTankRatios",
    "SmallGainFuzzy",
    "StateSpaceLaw",
    "Stimulation",
    "WashoutLaw",
    "design_constrained_gpc",
    "design_dpc",
    "design_gpc",
    "design_lqg",
    "design_lqr",
    "design_pd",
    "level_brake",
    "passive_optimum",
    "pump_model",
    "ship_ratios",
    "wave_arx",
]
