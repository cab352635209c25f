"""Ship and tank: parameters, linear and nonlinear coupled models."""

from utank_hil.dynamics.linear import STATES as STATES
from utank_hil.dynamics.linear import coupled_matrices as coupled_matrices
from utank_hil.dynamics.linear import coupled_model as coupled_model
from utank_hil.dynamics.nonlinear import RollModel as RollModel
from utank_hil.dynamics.sampling import LinearModel as LinearModel
from utank_hil.dynamics.sampling import sampled_model as sampled_model
from utank_hil.dynamics.ship import RollShip as RollShip
from utank_hil.dynamics.tank import GRAVITY_M_S2 as GRAVITY_M_S2
from utank_hil.dynamics.tank import Tank as Tank
from utank_hil.dynamics.wrench import tank_wrench as tank_wrench
