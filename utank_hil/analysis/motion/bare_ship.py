"""Closed-form roll of the ship without its tank, the reference for every tank."""

import math

import numpy as np

from utank_hil.base.arrays import FloatArray
from utank_hil.dynamics.ship import RollShip
from utank_hil.sea import Harmonics


def roll_without_tank(
    ship: RollShip, wave_moment: Harmonics, step_s: float, count: int
) -> FloatArray:
    """Linear roll from rest at time 0 under a sum of harmonics in N m, exact for any step.

    It is the sum of the steady response to each component, the steady heel, and the free decay that
    matches rest at the start. The ship's damping ratio must be below one. Returns the roll in
    radians at 0, step_s, 2 step_s, ..., shape (count,). Raises `ValueError` if the damping ratio is
    one or more.
    """
    omega = wave_moment.frequency_rad_s
    compliance = 1.0 / (
        ship.stiffness_nm_rad - ship.inertia_kg_m2 * omega**2 + 1j * ship.damping_nms_rad * omega
    )
    response = wave_moment.amplitude * np.exp(1j * wave_moment.phase_rad) * compliance
    decay = ship.damping_nms_rad / (2.0 * ship.inertia_kg_m2)
    if decay >= ship.natural_frequency_rad_s:
        raise ValueError("the ship's roll is overdamped; this closed form needs damping below one")
    damped = math.sqrt(ship.natural_frequency_rad_s**2 - decay**2)
    steady = Harmonics(np.abs(response), omega, np.angle(response))
    steady_rate = Harmonics(np.abs(response) * omega, omega, np.angle(response) + math.pi / 2)
    heel = ship.heeling_moment_nm / ship.stiffness_nm_rad
    angle = -heel - float(steady.at(0.0))  # start of the free decay
    sine_part = (-float(steady_rate.at(0.0)) + decay * angle) / damped
    time_s = step_s * np.arange(count, dtype=float)
    free = angle * np.cos(damped * time_s) + sine_part * np.sin(damped * time_s)
    return np.asarray(heel + steady.series(step_s, count) + np.exp(-decay * time_s) * free)
