"""Controllers: steppable objects, and the design functions they come from."""

from utank_hil.control.arx import ARX
from utank_hil.control.defaults import DPC_ROLL_LEVEL, GPC_ROLL
from utank_hil.control.interface import Controller, LinearLaw
from utank_hil.control.law import PredictiveController, PredictiveLaw
from utank_hil.control.level_observer import LevelObserver
from utank_hil.control.limits import CommandLimiter, PumpLimits
from utank_hil.control.optimal_tank import (
    PassiveOptimum,
    ShipTankRatios,
    passive_optimum,
    ship_ratios,
)
from utank_hil.control.passive import PassiveController
from utank_hil.control.pd import PD_MEASURED, design_pd
from utank_hil.control.predictive import design_dpc, design_gpc
from utank_hil.control.ship_design import PredictiveDesign, Predictor, pump_model, wave_arx
from utank_hil.control.washout import WashoutController, WashoutLaw

__all__ = [
    "ARX",
    "DPC_ROLL_LEVEL",
    "GPC_ROLL",
    "PD_MEASURED",
    "CommandLimiter",
    "Controller",
    "LevelObserver",
    "LinearLaw",
    "PassiveController",
    "PassiveOptimum",
    "PredictiveController",
    "PredictiveDesign",
    "PredictiveLaw",
    "Predictor",
    "PumpLimits",
    "ShipTankRatios",
    "WashoutController",
    "WashoutLaw",
    "design_dpc",
    "design_gpc",
    "design_pd",
    "passive_optimum",
    "pump_model",
    "ship_ratios",
    "wave_arx",
]
