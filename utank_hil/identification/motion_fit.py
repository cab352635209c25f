"""Ship and wave moment from the motion alone, with the tank at work and no excitation.

The roll equation of the linear model holds with any pump and any law, because the water's level is
measured. With the coefficients of roll and level at a frequency it gives the wave moment::

    K_w = D_phi(w, theta) phi + D_h(w) h + n,    theta = log (stiffness, inertia, damping) factors

n is the configured ship's quadratic damping and nonlinear restoring moment in the measured motion.
The tank's D_h is known and absolute: it is the reference for the ship.

A wrong ship gives a wrong spectrum of K_w. The right one follows from the likelihood of the
motion under a spectrum that is smooth (`smooth_spectrum`). From moment to roll the change of
variables has the factor 1 / D_c, of ship and passive tank together::

    log L(theta) = log L(I_w(theta)) + K sum over w of log |D_c(w, theta)|^2

A law changes this factor by its sensitivity function, whose logarithm has the integral zero (Bode),
so that the law need not be known. This is the direct method of identification in closed loop
(Ljung, System Identification, 13.4): the waves are the noise, modelled as richly as they come.

What it yields depends on the pump. While it works at its limits, or against anything but the
waves, stiffness and inertia are found to a few per cent. With a passive tank motion and waves can
hardly be distinguished: the stated deviations are then large. They are the curvature of the
likelihood, with priors as in `ship_fit`.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

import numpy as np
from scipy.optimize import minimize

from utank_hil.base.arrays import ComplexArray, FloatArray
from utank_hil.control import DesignPlant
from utank_hil.dynamics import RollShip, coupled_matrices
from utank_hil.dynamics.ship import restoring
from utank_hil.identification.smooth_spectrum import (
    LogSpectrum,
    SmoothSpectrum,
    bandwidth_rad_s,
    coefficients,
)
from utank_hil.sea import SlopeSpectrum

SPREAD: Final = (0.7, 0.1, 0.5)
"""Prior deviations of the logarithms of stiffness, inertia and damping, for any loading."""
KNOWN_SPREAD: Final = (0.02, 0.02, 0.3)
"""Prior deviations of a known ship: consumption and trim of a voyage."""
BAND: Final = (0.25, 3.2)
"""Frequency band for the ship, relative to the given ship's natural frequency."""
TOP_RAD_S: Final = 2.4
"""Upper end of the spectrum, or that of `BAND` if larger; waves are negligible beyond it."""
RESOLUTION: Final = 0.03
"""Width of a spectral band relative to the given ship's natural frequency."""
LEAST_TAPERS: Final = 3
"""Smallest number of averages of a spectral estimate; fewer skew the distribution of its logarithm.
"""
_STARTS = np.log([0.45, 0.6, 0.8, 1.0, 1.25, 1.6, 2.2])  # stiffness: roll periods x 0.67 to 1.5
_NOISE_BAND = (0.4, 0.9)  # of the Nyquist frequency: no motion there, only noise
_NOISE_LINES = 200  # Their median is known to a few per cent.
_NOISE_TAPERS = 4
_MEDIAN = 0.918  # median over mean of chi-square with twice `_NOISE_TAPERS` degrees of freedom
_STEP = np.array([0.02, 0.03, 0.1])  # These are steps for the curvature.
_MOST_TRIES = 250  # This is the largest number of ships tried.


@dataclass(frozen=True, slots=True, eq=False)
class MotionFit:
    """Ship and wave moment fitted to a record."""

    ship: RollShip  #: The given ship with fitted stiffness, inertia and linear damping.
    #: shape (3,): relative standard deviations of stiffness, inertia and linear damping.
    deviation: FloatArray
    period_deviation: float  #: Relative standard deviation of the roll period.
    waves: SlopeSpectrum  #: Wave moment per stiffness of `ship`.
    rms_deviation: float  #: Relative standard deviation of the root mean square of `waves`.
    clear: float  #: Part of the moment's energy in bands where it exceeds the sensors' noise.
    #: Log-likelihood of the motion without constants, to compare fits to one record.
    log_likelihood: float


def fit_motion(
    motion: FloatArray,
    plant: DesignPlant,
    sample_time_s: float,
    spread: tuple[float, float, float] = SPREAD,
) -> MotionFit:
    """Fit ship and wave moment to a record.

    `motion`, shape (N, 3), is roll in rad, roll rate in rad/s and level in m, without gaps. The
    plant has the ship of the prior, and the tank; `spread` are the standard deviations of the
    prior.
    """
    natural = plant.ship.natural_frequency_rad_s
    record = _Record(motion, plant, sample_time_s, BAND[1] * natural)
    prior = np.array(spread)

    def cost(theta: FloatArray) -> float:
        found = record.likelihood(theta)
        return 0.5 * float(np.sum((theta / prior) ** 2)) - found.log_likelihood

    starts = []
    for start in np.clip(_STARTS, -2 * prior[0], 2 * prior[0]):
        record.spectrum.restart()
        starts.append((cost(np.array([start, 0.0, 0.0])), start))
    first = np.array([min(starts)[1], 0.0, 0.0])
    simplex = first + np.vstack([np.zeros(3), np.diag(0.5 * np.minimum(prior, 0.2))])
    options = {"initial_simplex": simplex, "xatol": 2e-3, "fatol": 1e-2, "maxfev": _MOST_TRIES}
    theta = minimize(cost, first, method="Nelder-Mead", options=options).x
    covariance = _inverse_curvature(cost, theta, prior)
    whole = _Record(motion, plant, sample_time_s, max(BAND[1] * natural, TOP_RAD_S))
    return whole.fit(theta, covariance, record.likelihood(theta).log_likelihood)


class _Record:
    """Spectral coefficients of a record, and the likelihood of ships."""

    def __init__(
        self, motion: FloatArray, plant: DesignPlant, sample_time_s: float, top_rad_s: float
    ) -> None:
        self._ship = ship = plant.ship
        mass, damping, stiffness = coupled_matrices(ship, plant.tank)
        natural = ship.natural_frequency_rad_s
        nyquist = math.pi / sample_time_s
        duration_s = len(motion) * sample_time_s
        tapers = max(LEAST_TAPERS, int(RESOLUTION * natural * duration_s / math.pi) - 1)
        self._tapers = tapers
        step = bandwidth_rad_s(len(motion), sample_time_s, tapers)
        top = min(top_rad_s, _NOISE_BAND[0] * nyquist)
        self.omega = omega = np.arange(BAND[0] * natural, top, step)
        roll, rate = motion[:, :2].T
        bent = (
            restoring(ship).moment_nm(roll)
            - ship.stiffness_nm_rad * roll
            + ship.quadratic_damping_nms2_rad2 * np.abs(rate) * rate
        )
        signals = np.column_stack([motion, bent])
        quiet = np.linspace(_NOISE_BAND[0] * nyquist, _NOISE_BAND[1] * nyquist, _NOISE_LINES)
        noise = np.mean(
            np.abs(coefficients(motion, sample_time_s, quiet, _NOISE_TAPERS)) ** 2, axis=1
        )
        noise_roll, noise_rate, self._noise_level = np.median(noise, axis=1) / _MEDIAN
        roll_w, rate_w, self._level, bent_w = coefficients(signals, sample_time_s, omega, tapers)
        # The roll is from both sensors, each weighted by its noise.
        by_roll, by_rate = 1 / max(noise_roll, 1e-30), omega**2 / max(noise_rate, 1e-30)
        self._roll = (by_roll * roll_w + by_rate * rate_w / (1j * omega)) / (by_roll + by_rate)
        self._noise_roll = 1 / (by_roll + by_rate)
        self._bent = bent_w / ship.stiffness_nm_rad
        s = 1j * omega
        parts = (mass * s[:, None, None] ** 2 + damping * s[:, None, None] + stiffness) / (
            ship.stiffness_nm_rad
        )
        # These are of water and hull; the ship's own part scales with theta.
        self._hull = np.array(
            [
                np.ones_like(s),
                ship.inertia_kg_m2 / ship.stiffness_nm_rad * s**2,
                ship.damping_nms_rad / ship.stiffness_nm_rad * s,
            ]
        )
        self._water = parts[:, 0, 0] - self._hull.sum(axis=0)
        self._coupling = parts[:, 0, 1]
        self._swing = self._coupling**2 / parts[:, 1, 1]
        self.spectrum = SmoothSpectrum(omega, tapers)

    def _roll_factor(self, theta: FloatArray) -> ComplexArray:
        factor: ComplexArray = np.exp(theta) @ self._hull + self._water
        return factor

    def _moment(self, theta: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return the density of the moment per stiffness of the given ship, and its noise's."""
        factor = self._roll_factor(theta)
        moment = factor * self._roll + self._coupling * self._level + self._bent
        noise = np.abs(factor) ** 2 * self._noise_roll
        noise = noise + np.abs(self._coupling) ** 2 * self._noise_level
        return np.mean(np.abs(moment) ** 2, axis=0), noise

    def likelihood(self, theta: FloatArray) -> LogSpectrum:
        """Return the spectrum of the wave moment for a ship, and the likelihood of the motion."""
        found = self.spectrum.find(*self._moment(theta))
        passive = np.abs(self._roll_factor(theta) - self._swing)
        change = 2 * self._tapers * float(np.log(passive).sum())
        return found._replace(log_likelihood=found.log_likelihood + change)

    def fit(self, theta: FloatArray, covariance: FloatArray, log_likelihood: float) -> MotionFit:
        """Return the fit of the most likely ship."""
        stiffness, inertia, damping = np.exp(theta).tolist()
        ship = self._ship
        fitted = ship.with_figures(
            ship.inertia_kg_m2 * inertia,
            ship.stiffness_nm_rad * stiffness,
            ship.damping_nms_rad * damping,
        )
        found, of_waves = self.likelihood(theta), self.spectrum.covariance()
        # A ship in error changes the spectrum, and the stiffness that it is relative to.
        by_ship = np.array(
            [
                (self.likelihood(theta + step).mean - self.likelihood(theta - step).mean) / 2
                for step in np.diag(_STEP)
            ]
        )
        by_ship = (by_ship / _STEP[:, None]).T
        by_ship[:, 0] -= 2
        log_covariance = of_waves + by_ship @ covariance @ by_ship.T
        density = np.exp(found.mean) / stiffness**2
        energy = density.sum()
        noise = self._moment(theta)[1] / stiffness**2
        gradient = np.array([-0.5, 0.5, 0.0])
        return MotionFit(
            fitted,
            np.sqrt(covariance.diagonal()),
            math.sqrt(gradient @ covariance @ gradient),
            SlopeSpectrum(self.omega, density),
            0.5 * math.sqrt(density @ log_covariance @ density) / energy,
            float(density[density > noise].sum() / energy),
            log_likelihood,
        )


def _inverse_curvature(
    cost: Callable[[FloatArray], float], theta: FloatArray, prior: FloatArray
) -> FloatArray:
    """Return the covariance of theta: the inverse curvature of the cost, at most the prior's."""
    curvature = np.zeros((3, 3))
    steps = np.diag(_STEP)
    for row, one in enumerate(steps):
        for column, other in enumerate(steps[: row + 1]):
            corners = [
                cost(theta + sign * one + turn * other) * sign * turn
                for sign in (1, -1)
                for turn in (1, -1)
            ]
            value = sum(corners) / (4 * _STEP[row] * _STEP[column])
            curvature[row, column] = curvature[column, row] = value
    # In units of the prior the smallest curvature is 1, the prior's own.
    values, vectors = np.linalg.eigh(prior[:, None] * curvature * prior)
    scaled = (vectors / np.maximum(values, 1.0)) @ vectors.T
    covariance: FloatArray = prior[:, None] * scaled * prior
    return covariance
