"""Ship and tank: parameters, linear and nonlinear coupled models, six-degree forces."""

from utank_hil.dynamics.harmonic import HarmonicResponse, harmonic_response
from utank_hil.dynamics.linear import coupled_model
from utank_hil.dynamics.nonlinear import Impact, RollModel
from utank_hil.dynamics.reference import RollRun, simulate_reference
from utank_hil.dynamics.ship import RollShip
from utank_hil.dynamics.simulate import BatchResult, WaveMoment, simulate, simulate_batch
from utank_hil.dynamics.six_degree import SixDegreeModel, SixDegreeShip, simulate_six_degree
from utank_hil.dynamics.tank import GRAVITY_M_S2, Tank
from utank_hil.dynamics.wrench import tank_wrench

__all__ = [
    "GRAVITY_M_S2",
    "BatchResult",
    "HarmonicResponse",
    "Impact",
    "RollModel",
    "RollRun",
    "RollShip",
    "SixDegreeModel",
    "SixDegreeShip",
    "Tank",
    "WaveMoment",
    "coupled_model",
    "harmonic_response",
    "simulate",
    "simulate_batch",
    "simulate_reference",
    "simulate_six_degree",
    "tank_wrench",
]
