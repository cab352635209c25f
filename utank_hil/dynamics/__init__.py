"""Ship and tank: parameters, linear and nonlinear coupled models, six-degree forces."""

from utank_hil.dynamics.harmonic import HarmonicResponse as HarmonicResponse
from utank_hil.dynamics.harmonic import harmonic_response as harmonic_response
from utank_hil.dynamics.linear import coupled_model as coupled_model
from utank_hil.dynamics.nonlinear import Impact as Impact
from utank_hil.dynamics.nonlinear import RollModel as RollModel
from utank_hil.dynamics.reference import RollRun as RollRun
from utank_hil.dynamics.reference import simulate_reference as simulate_reference
from utank_hil.dynamics.sampling import sampled_model as sampled_model
from utank_hil.dynamics.ship import RollShip as RollShip
from utank_hil.dynamics.simulate import BatchResult as BatchResult
from utank_hil.dynamics.simulate import WaveMoment as WaveMoment
from utank_hil.dynamics.simulate import simulate as simulate
from utank_hil.dynamics.simulate import simulate_batch as simulate_batch
from utank_hil.dynamics.six_degree import SixDegreeModel as SixDegreeModel
from utank_hil.dynamics.six_degree import SixDegreeShip as SixDegreeShip
from utank_hil.dynamics.six_degree import simulate_six_degree as simulate_six_degree
from utank_hil.dynamics.tank import GRAVITY_M_S2 as GRAVITY_M_S2
from utank_hil.dynamics.tank import Tank as Tank
from utank_hil.dynamics.wrench import tank_wrench as tank_wrench
