"""Roll of the ship without its tank, in closed form: what every tank is measured against."""

import numpy as np

from utank_hil.arrays import FloatArray
from utank_hil.dynamics.ship import RollShip
from utank_hil.sea import Harmonics


def roll_without_tank(
    ship: RollShip, wave_moment: Harmonics, step_s: float, count: int
) -> FloatArray:
    """Linear roll from rest at time 0 under a sum of harmonics, on a uniform grid.

    Each component's steady answer, plus the free decay that makes angle and rate zero at the start:
    exact, whatever the step.

    Parameters
    ----------
    ship : RollShip
        Inertia, linear damping and stiffness count; lightly damped (damping ratio below one).
    wave_moment : Harmonics
        In N m.
    step_s : float
    count : int

    Returns
    -------
    ndarray, shape (count,)
        Roll in radians at 0, step_s, 2 step_s, ...

    Raises
    ------
    ValueError
        If the roll is not lightly damped.
    """
    omega = wave_moment.frequency_rad_s
    compliance = 1.0 / (
        ship.stiffness_nm_rad - ship.inertia_kg_m2 * omega**2 + 1j * ship.damping_nms_rad * omega
    )
    answer = wave_moment.amplitude * np.exp(1j * wave_moment.phase_rad) * compliance
    steady = Harmonics(np.abs(answer), omega, np.angle(answer)).series(step_s, count)
    decay = ship.damping_nms_rad / (2.0 * ship.inertia_kg_m2)
    if decay >= ship.natural_frequency_rad_s:
        raise ValueError("the ship's roll is overdamped; this closed form needs damping below one")
    damped = np.sqrt(ship.natural_frequency_rad_s**2 - decay**2)
    angle = -float(answer.real.sum())
    rate = -float((1j * omega * answer).real.sum())
    time = step_s * np.arange(count)
    free = np.exp(-decay * time) * (
        angle * np.cos(damped * time) + (rate + decay * angle) / damped * np.sin(damped * time)
    )
    return np.asarray(steady + free)
