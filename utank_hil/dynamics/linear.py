"""The linear coupled model of roll and tank, thesis (2.19) with corrected signs.

With the level h instead of the tank angle, q = (phi, h), pump pressure P and wave moment K::

    M q'' + B q' + K q = (K_wave, At P)

    M = [ m_phi              -rho At L (H + Lz)        ]
        [ -rho At L (H + Lz)  rho At (2H + L At/Ap)    ]
    K = [ k_phi              -rho g At L               ]
        [ -rho g At L         2 rho g At               ]

where m_phi and k_phi include the ship and the water at rest in the tank.
"""

from typing import TYPE_CHECKING

import numpy as np

from utank_hil.base.arrays import FloatArray
from utank_hil.base.ordered_sums import product
from utank_hil.dynamics.sampling import LinearModel
from utank_hil.dynamics.ship import RollShip
from utank_hil.dynamics.tank import GRAVITY_M_S2, Tank

if TYPE_CHECKING:
    from control import StateSpace

STATES = ("roll_rad", "roll_rate_rad_s", "level_m", "level_rate_m_s")
INPUTS = ("pressure_pa", "wave_moment_nm")


def coupled_matrices(ship: RollShip, tank: Tank) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Mass, damping, stiffness for q = (roll_rad, level_m); SI units, symmetric, (2, 2)."""
    g, at = GRAVITY_M_S2, tank.reservoir_area_m2
    coupling_inertia = tank.swirl_kgm
    coupling_stiffness = -g * tank.across_kg
    mass = np.array(
        [
            [ship.inertia_kg_m2 + sum(tank.water_squares_kg_m2), coupling_inertia],
            [coupling_inertia, tank.density_kg_m3 * at * tank.effective_length_m],
        ]
    )
    damping = np.diag([ship.damping_nms_rad, at * tank.loss_pa_per_m_s])
    stiffness = np.array(
        [
            [ship.stiffness_nm_rad + g * tank.water_lever_kgm, coupling_stiffness],
            [coupling_stiffness, 2 * tank.density_kg_m3 * g * at],
        ]
    )
    return mass, damping, stiffness


def state_matrices(ship: RollShip, tank: Tank) -> tuple[FloatArray, FloatArray]:
    """State matrix (4, 4) for `STATES`, input matrix (4, 2) for `INPUTS`; no python-control."""
    mass, damping, stiffness = coupled_matrices(ship, tank)
    (m11, m12), (_, m22) = mass
    inverse = np.array([[m22, -m12], [-m12, m11]]) / (m11 * m22 - m12 * m12)
    effort = np.array([[0.0, 1.0], [tank.reservoir_area_m2, 0.0]])
    # The model is of first order in q and q', then sorted into (phi, phi', h, h').
    rows = -product(inverse, stiffness), -product(inverse, damping)
    a = np.block([[np.zeros((2, 2)), np.eye(2)], [*rows]])
    b = np.vstack([np.zeros((2, 2)), product(inverse, effort)])
    order = [0, 2, 1, 3]
    return a[np.ix_(order, order)], b[order]


def coupled_model(ship: RollShip, tank: Tank) -> "StateSpace":
    """Continuous linear model of ship and tank: states and outputs `STATES`, inputs `INPUTS`."""
    from control import ss  # This import would bring plotting into the process.

    a, b = state_matrices(ship, tank)
    return ss(
        a,
        b,
        np.eye(4),
        np.zeros((4, 2)),
        states=list(STATES),
        inputs=list(INPUTS),
        outputs=list(STATES),
        name="ship_and_tank",
    )


def pump_model(ship: RollShip, tank: Tank, measured: tuple[str, ...]) -> LinearModel:
    """Continuous model from pump pressure to the `measured` outputs, without python-control."""
    a, b = state_matrices(ship, tank)
    c = np.eye(len(STATES))[[STATES.index(name) for name in measured]]
    return LinearModel(a, b[:, :1], c, np.zeros((len(measured), 1)), 0.0)
