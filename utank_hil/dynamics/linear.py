"""The linear coupled model of roll and tank, thesis (2.19) with its signs put right.

With the level h instead of the tank angle, q = (phi, h), pump pressure P and wave moment K::

    M q'' + B q' + K q = (K_wave, At P)

    M = [ m_phi              -rho At L (H + Lz)        ]
        [ -rho At L (H + Lz)  rho At (2H + L At/Ap)    ]
    K = [ k_phi              -rho g At L               ]
        [ -rho g At L         2 rho g At               ]

where m_phi and k_phi hold the ship and the water at rest in the tank.
"""

from typing import TYPE_CHECKING

import numpy as np

from utank_hil.arrays import FloatArray
from utank_hil.dynamics.ship import RollShip
from utank_hil.dynamics.tank import GRAVITY_M_S2, Tank

if TYPE_CHECKING:
    from control import StateSpace

STATES = ("roll_rad", "roll_rate_rad_s", "level_m", "level_rate_m_s")
INPUTS = ("pressure_pa", "wave_moment_nm")


def coupled_matrices(ship: RollShip, tank: Tank) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Mass, damping and stiffness matrices for q = (roll_rad, level_m).

    Returns
    -------
    mass, damping, stiffness : ndarray, shape (2, 2)
        SI units; all three symmetric.
    """
    rho, g = tank.density_kg_m3, GRAVITY_M_S2
    at, ap = tank.reservoir_area_m2, tank.duct_area_m2
    length, height, lz = tank.width_m, tank.height_m, tank.lz_m
    roll_inertia = ship.inertia_kg_m2 + rho * (
        at * (2 * height**3 - 6 * lz * height**2 + 6 * lz**2 * height) / 3
        + at * length**2 * height / 2
        + ap * lz**2 * length
        + ap * length**3 / 12
    )
    roll_stiffness = ship.stiffness_nm_rad + rho * g * (
        at * (2 * lz * height - height**2) + ap * lz * length
    )
    coupling_inertia = -rho * at * length * (height + lz)
    coupling_stiffness = -rho * g * at * length
    mass = np.array(
        [
            [roll_inertia, coupling_inertia],
            [coupling_inertia, rho * at * tank.effective_length_m],
        ]
    )
    damping = np.diag([ship.damping_nms_rad, at * tank.loss_pa_per_m_s])
    stiffness = np.array(
        [[roll_stiffness, coupling_stiffness], [coupling_stiffness, 2 * rho * g * at]]
    )
    return mass, damping, stiffness


def coupled_model(ship: RollShip, tank: Tank) -> "StateSpace":
    """Continuous linear model of ship and tank.

    Parameters
    ----------
    ship : RollShip
    tank : Tank

    Returns
    -------
    control.StateSpace
        States and outputs `STATES`, inputs `INPUTS`.
    """
    from control import ss  # here, because importing it brings plotting into the process

    mass, damping, stiffness = coupled_matrices(ship, tank)
    inverse = np.linalg.inv(mass)
    effort = np.array([[0.0, 1.0], [tank.reservoir_area_m2, 0.0]])
    # first order in q and q', then sorted into (phi, phi', h, h')
    a = np.block([[np.zeros((2, 2)), np.eye(2)], [-inverse @ stiffness, -inverse @ damping]])
    b = np.vstack([np.zeros((2, 2)), inverse @ effort])
    order = [0, 2, 1, 3]
    return ss(
        a[np.ix_(order, order)],
        b[order],
        np.eye(4),
        np.zeros((4, 2)),
        states=list(STATES),
        inputs=list(INPUTS),
        outputs=list(STATES),
        name="ship_and_tank",
    )
