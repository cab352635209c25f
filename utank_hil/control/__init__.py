"""Controllers: steppable objects, and the design functions they come from."""

from utank_hil.control.arx import ARX as ARX
from utank_hil.control.constrained.arx_design import (
    design_constrained_gpc as design_constrained_gpc,
)
from utank_hil.control.constrained.design import ConstrainedDesign as ConstrainedDesign
from utank_hil.control.design_plant import DesignPlant as DesignPlant
from utank_hil.control.feedback_linearization import FeedbackLinearization as FeedbackLinearization
from utank_hil.control.feedback_linearization import level_brake as level_brake
from utank_hil.control.fuzzy.direct import RobustFuzzy as RobustFuzzy
from utank_hil.control.fuzzy.direct import SmallGainFuzzy as SmallGainFuzzy
from utank_hil.control.fuzzy.indirect import IndirectFuzzy as IndirectFuzzy
from utank_hil.control.gain import GainLaw as GainLaw
from utank_hil.control.interface import BuiltLaw as BuiltLaw
from utank_hil.control.interface import Controller as Controller
from utank_hil.control.interface import LawDesign as LawDesign
from utank_hil.control.interface import LinearLaw as LinearLaw
from utank_hil.control.level_observer import LevelObserver as LevelObserver
from utank_hil.control.limiter import CommandLimiter as CommandLimiter
from utank_hil.control.limits import PumpLimits as PumpLimits
from utank_hil.control.lqg import LQGLaw as LQGLaw
from utank_hil.control.lqg import design_lqg as design_lqg
from utank_hil.control.lqg import design_lqr as design_lqr
from utank_hil.control.lqg_design import LQGDesign as LQGDesign
from utank_hil.control.optimal_tank import PassiveOptimum as PassiveOptimum
from utank_hil.control.optimal_tank import ShipTankRatios as ShipTankRatios
from utank_hil.control.optimal_tank import passive_optimum as passive_optimum
from utank_hil.control.optimal_tank import ship_ratios as ship_ratios
from utank_hil.control.passive import PassiveController as PassiveController
from utank_hil.control.passive import PassiveDesign as PassiveDesign
from utank_hil.control.pd import PD_MEASURED as PD_MEASURED
from utank_hil.control.pd import design_pd as design_pd
from utank_hil.control.predictive.design import PredictiveDesign as PredictiveDesign
from utank_hil.control.predictive.design import Predictor as Predictor
from utank_hil.control.predictive.design import wave_arx as wave_arx
from utank_hil.control.predictive.gains import design_dpc as design_dpc
from utank_hil.control.predictive.gains import design_gpc as design_gpc
from utank_hil.control.predictive.law import PredictiveController as PredictiveController
from utank_hil.control.predictive.law import PredictiveLaw as PredictiveLaw
from utank_hil.control.sea_model import SeaModel as SeaModel
from utank_hil.control.semi_active import ClippedValve as ClippedValve
from utank_hil.control.semi_active import OnOffValve as OnOffValve
from utank_hil.control.state_space import StateSpaceLaw as StateSpaceLaw
from utank_hil.control.stimulation import Stimulation as Stimulation
from utank_hil.control.tracking_error import ErrorDynamics as ErrorDynamics
from utank_hil.control.washout import WashoutLaw as WashoutLaw
from utank_hil.dynamics.linear import pump_model as pump_model
