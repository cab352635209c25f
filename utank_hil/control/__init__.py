"""Controllers: steppable objects, and the design functions they come from."""

from utank_hil.control.arx import ARX
from utank_hil.control.constrained.arx_design import design_constrained_gpc
from utank_hil.control.constrained.design import ConstrainedDesign
from utank_hil.control.defaults import DPC_ROLL_LEVEL, GPC_ROLL
from utank_hil.control.feedback_linearization import FeedbackLinearization, level_brake
from utank_hil.control.fuzzy.direct import RobustFuzzy, SmallGainFuzzy
from utank_hil.control.fuzzy.indirect import IndirectFuzzy
from utank_hil.control.gain import GainLaw
from utank_hil.control.interface import Controller, LinearLaw
from utank_hil.control.level_observer import LevelObserver
from utank_hil.control.limits import CommandLimiter, PumpLimits
from utank_hil.control.lqg import LQGLaw, design_lqg, design_lqr
from utank_hil.control.lqg_design import LQG_ROLL_RATE_LEVEL, LQGDesign
from utank_hil.control.optimal_tank import (
    PassiveOptimum,
    ShipTankRatios,
    passive_optimum,
    ship_ratios,
)
from utank_hil.control.passive import PassiveController
from utank_hil.control.pd import PD_MEASURED, design_pd
from utank_hil.control.predictive.design import PredictiveDesign, Predictor, pump_model, wave_arx
from utank_hil.control.predictive.gains import design_dpc, design_gpc
from utank_hil.control.predictive.law import PredictiveController, PredictiveLaw
from utank_hil.control.sea_model import SeaModel
from utank_hil.control.semi_active import ClippedValve, OnOffValve, ValveRange
from utank_hil.control.stimulation import Stimulation
from utank_hil.control.tracking_error import ErrorDynamics
from utank_hil.control.washout import WashoutLaw

__all__ = [
    "ARX",
    "DPC_ROLL_LEVEL",
    "GPC_ROLL",
    "LQG_ROLL_RATE_LEVEL",
    "PD_MEASURED",
    "ClippedValve",
    "CommandLimiter",
    "ConstrainedDesign",
    "Controller",
    "ErrorDynamics",
    "FeedbackLinearization",
    "GainLaw",
    "IndirectFuzzy",
    "LQGDesign",
    "LQGLaw",
    "LevelObserver",
    "LinearLaw",
    "OnOffValve",
    "PassiveController",
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
    "Stimulation",
    "ValveRange",
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
