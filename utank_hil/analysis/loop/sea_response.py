"""Linear roll, level and pressure in irregular waves, in closed form: no simulation, no limits.

The mean square of a linear response to a sum of harmonics is sum |H(w)|^2 a^2 / 2. Limits of pump,
rate and level are neglected.
"""

import math
from dataclasses import dataclass, replace
from typing import Final, Protocol

import numpy as np

from utank_hil.analysis.loop.margins import closed_loop_response
from utank_hil.base.arrays import ComplexArray, FloatArray
from utank_hil.control import DesignPlant, LinearLaw
from utank_hil.dynamics import STATES, RollShip
from utank_hil.dynamics.tank import IRREGULAR
from utank_hil.sea import Harmonics

_ROUNDS: Final = 50  # Limit on the iterations: each halves the difference at least.
_BANDS: Final = 400  # Widths of a hundredth of a roll frequency, far below a resonance's.
_AGREE: Final = 1e-3  # Relative difference of rates at which the iteration ends.


_OMEGA: Final = np.geomspace(0.1, 10.0, 600)  # Wave frequencies over the roll frequency.


class SlopeDensity(Protocol):
    """A sea as a law's design needs it."""

    def slope_density(self, omega_rad_s: FloatArray) -> FloatArray:
        """One-sided density of the effective wave slope over encounter frequency."""


class CalmSeaError(ValueError):
    """The sea does not roll the ship, so there is no roll to reduce."""


@dataclass(frozen=True, slots=True)
class MotionInSea:
    """Root mean squares of the motion in a sea; the pressure's is that after delay and lag."""

    roll_rms_rad: float
    level_rms_m: float
    pressure_rms_pa: float


def motion_in_sea(
    law: LinearLaw | None, plant: DesignPlant, measured: tuple[str, ...], wave_moment: Harmonics
) -> MotionInSea:
    """Linear motion with a law that stabilizes its loop.

    Without a law the tank is passive; for an unstable loop the result is meaningless. `wave_moment`
    is in N m; above the Nyquist frequency pi / Ts the tank is taken as passive.
    """
    motions, pressure = _answers(law, plant, measured, wave_moment.frequency_rad_s)
    roll, level = (motions[:, STATES.index(name)] for name in ("roll_rad", "level_m"))
    return MotionInSea(*(rms(answer, wave_moment) for answer in (roll, level, pressure)))


def at_its_motion(
    law: LinearLaw | None, plant: DesignPlant, measured: tuple[str, ...], wave_moment: Harmonics
) -> DesignPlant:
    """Return the plant whose linear losses take what its quadratic ones take of its own motion.

    That is of equal power in a Gaussian motion: B1 + sqrt(8 / pi) sigma B2, sigma the RMS of the
    rate. Losses and motion are iterated to agreement.
    """
    found, rates = plant, [0.0, 0.0]
    if not (plant.ship.quadratic_damping_nms2_rad2 or plant.tank.quadratic_loss):
        return plant
    waves, names = _bands(wave_moment), ("roll_rate_rad_s", "level_rate_m_s")
    for _ in range(_ROUNDS):
        motions, _ = _answers(law, found, measured, waves.frequency_rad_s)
        before = rates
        rates = [rms(motions[:, STATES.index(name)], waves) for name in names]
        ship, tank = plant.ship.linearized(rates[0]), plant.tank.linearized(rates[1], IRREGULAR)
        found = replace(plant, ship=ship, tank=tank)
        if np.allclose(rates, before, rtol=_AGREE, atol=0):
            break
    return found


def moment_of(sea: SlopeDensity, ship: RollShip) -> Harmonics:
    """Roll moment in N m of a sea, as far as it can roll a ship."""
    w = ship.natural_frequency_rad_s * _OMEGA
    slope = np.sqrt(2 * sea.slope_density(w) * np.gradient(w))
    return Harmonics(ship.stiffness_nm_rad * slope, w, np.zeros(len(w)))


def at_work(plant: DesignPlant, wave_moment: Harmonics) -> DesignPlant:
    """Return the plant that laws are designed for: the tank's loss is that of its passive motion.

    As it is in small motions, the tank is kept as `calm`.
    """
    if not plant.tank.quadratic_loss:
        return plant
    moving = at_its_motion(None, plant, (), wave_moment)
    return replace(plant, tank=moving.tank, calm=plant.tank)


def _bands(waves: Harmonics) -> Harmonics:
    """Waves of the same energy in bands, for a motion that is computed many times."""
    w, energy = waves.frequency_rad_s, np.square(waves.amplitude)
    if len(w) <= _BANDS:
        return waves
    sums, edges = np.histogram(w, _BANDS, weights=energy)
    there = sums > 0
    middle = np.histogram(w, edges, weights=energy * w)[0][there] / sums[there]
    return Harmonics(np.sqrt(sums[there]), middle, np.zeros(len(middle)))


def _answers(
    law: LinearLaw | None, plant: DesignPlant, measured: tuple[str, ...], w: FloatArray
) -> tuple[ComplexArray, ComplexArray]:
    """Motions and pressure per wave moment, as `closed_loop_response`, at any frequencies."""
    motions, pressure = closed_loop_response(None, plant, measured, w)
    if law is not None:
        seen = (w > 0) & (w < np.pi / law.sample_time_s)
        motions[seen], pressure[seen] = closed_loop_response(law, plant, measured, w[seen])
    return motions, pressure


def rms(response: ComplexArray, waves: Harmonics) -> float:
    """Root mean square of a linear response with one value per component, shape (N,)."""
    return float(np.sqrt(np.sum(np.square(np.abs(response) * waves.amplitude)) / 2))


def roll_response_without_tank(ship: RollShip, frequency_rad_s: FloatArray) -> ComplexArray:
    """Roll of the ship alone per wave moment, rad/(N m), shape (N,)."""
    w = np.asarray(frequency_rad_s)
    impedance: ComplexArray = (
        ship.stiffness_nm_rad - ship.inertia_kg_m2 * w**2 + 1j * ship.damping_nms_rad * w
    )
    return 1 / impedance


def roll_without_tank(
    ship: RollShip, wave_moment: Harmonics, step_s: float, count: int
) -> FloatArray:
    """Linear roll from rest at time 0 under a sum of harmonics in N m, exact for any step.

    It is the sum of the steady response to each component, the steady heel, and the free decay that
    matches rest at the start. Returns the roll in
    radians at 0, step_s, 2 step_s, ..., shape (count,). Raises `ValueError` if it is overdamped.
    """
    omega = wave_moment.frequency_rad_s
    compliance = roll_response_without_tank(ship, omega)
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
