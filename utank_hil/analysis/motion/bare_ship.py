"""Closed-form roll of the ship without its tank, the reference for every tank."""

import math

import numpy as np

from utank_hil.arrays import FloatArray
from utank_hil.dynamics.ship import RollShip
from utank_hil.sea import Harmonics


def roll_without_tank(
    ship: RollShip,
    wave_moment: Harmonics,
    step_s: float,
    count: int,
    *,
    later_ship: RollShip | None = None,
    later_from_s: float = 0.0,
) -> FloatArray:
    """Linear roll from rest at time 0 under a sum of harmonics, on a uniform grid.

    The sum of the steady response to each component, the steady heel, and the free decay that
    matches the initial angle and rate. Exact for any step.

    Parameters
    ----------
    ship : RollShip
        Inertia, linear damping, stiffness and steady heeling moments are used; damping ratio below
        one.
    wave_moment : Harmonics
        Wave moment in N m.
    later_ship : RollShip, optional
        The ship after a change of loading; angle and rate are continuous.
    later_from_s : float
        Time of the change, zero or more.

    Returns
    -------
    ndarray, shape (count,)
        Roll in radians at 0, step_s, 2 step_s, ...

    Raises
    ------
    ValueError
        If the damping ratio is one or more.
    """
    motion = _Motion(ship, wave_moment, 0.0, 0.0, 0.0)
    if later_ship is None:
        return motion.series(step_s, 0, count)
    first = min(count, math.ceil(later_from_s / step_s))
    later = _Motion(later_ship, wave_moment, later_from_s, *motion.at(later_from_s))
    return np.concatenate(
        [motion.series(step_s, 0, first), later.series(step_s, first, count - first)]
    )


class _Motion:
    """Roll of one ship from a given angle and rate at `start_s`."""

    def __init__(
        self, ship: RollShip, moment: Harmonics, start_s: float, angle: float, rate: float
    ) -> None:
        omega = moment.frequency_rad_s
        compliance = 1.0 / (
            ship.stiffness_nm_rad
            - ship.inertia_kg_m2 * omega**2
            + 1j * ship.damping_nms_rad * omega
        )
        response = moment.amplitude * np.exp(1j * moment.phase_rad) * compliance
        self._decay = ship.damping_nms_rad / (2.0 * ship.inertia_kg_m2)
        if self._decay >= ship.natural_frequency_rad_s:
            raise ValueError(
                "the ship's roll is overdamped; this closed form needs damping below one"
            )
        self._damped = math.sqrt(ship.natural_frequency_rad_s**2 - self._decay**2)
        self._steady = Harmonics(np.abs(response), omega, np.angle(response))
        self._steady_rate = Harmonics(
            np.abs(response) * omega, omega, np.angle(response) + math.pi / 2
        )
        self._start_s = start_s
        self._heel = ship.heeling_moment_nm / ship.stiffness_nm_rad
        self._angle = angle - self._heel - float(self._steady.at(start_s))
        self._rate = rate - float(self._steady_rate.at(start_s))

    def series(self, step_s: float, first: int, count: int) -> FloatArray:
        """Roll at ``step_s * (first + arange(count))``."""
        since_s = step_s * np.arange(first, first + count, dtype=float) - self._start_s
        free, _ = self._free(since_s)
        return np.asarray(self._heel + self._steady.series(step_s, count, first * step_s) + free)

    def at(self, time_s: float) -> tuple[float, float]:
        """Angle and rate at one time."""
        free, free_rate = self._free(np.array(time_s - self._start_s))
        return (
            float(self._heel + self._steady.at(time_s) + free),
            float(self._steady_rate.at(time_s) + free_rate),
        )

    def _free(self, since_s: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Angle and rate of the free decay at times since the start."""
        decay, damped, angle = self._decay, self._damped, self._angle
        sine_part = (self._rate + decay * angle) / damped
        envelope = np.exp(-decay * since_s)
        sine, cosine = np.sin(damped * since_s), np.cos(damped * since_s)
        free = envelope * (angle * cosine + sine_part * sine)
        return free, envelope * damped * (sine_part * cosine - angle * sine) - decay * free
