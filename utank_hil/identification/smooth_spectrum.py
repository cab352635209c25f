"""A spectrum as a Gaussian process of its logarithm, from estimates with scatter.

An estimate I of the spectrum S scatters like chi-square with 2 K degrees of freedom about S plus a
known noise n, so its likelihood is (S + n)^-K exp(-K I / (S + n)), after Whittle. The prior makes
log S smooth over the logarithm of frequency and leaves its level free. Its mode is found by Fisher
scoring, the likelihood of the whole by Laplace's approximation there (Rasmussen and Williams,
Gaussian Processes for Machine Learning, 3.4).
"""

from typing import NamedTuple

import numpy as np
from scipy.linalg import cho_solve, solve_triangular

from utank_hil.base.arrays import ComplexArray, FloatArray

_PADDING = 8  # finer grid of the transform: a coefficient is that of its frequency


_SPREAD = 2.0  # Standard deviation of the logarithm about its level: a factor of 7.
_LENGTH = 0.3  # Matern length over the logarithm of frequency: a third of an octave.
_LEVEL_SPREAD = 5.0  # Standard deviation of the logarithm's level: practically free.
_START = 0.1  # Level about which the logarithm is spread, relative to the mean density.
_STEPS = 60  # Largest number of Newton steps.
_CONVERGED = 1e-4  # Largest last change of the logarithm.
_TINY = 1e-9  # This keeps the prior and the weights positive definite.


def bandwidth_rad_s(samples: int, sample_time_s: float, tapers: int) -> float:
    """Full bandwidth of a coefficient."""
    return (tapers + 1) * np.pi / (samples * sample_time_s)


def coefficients(
    signals: FloatArray, sample_time_s: float, omega_rad_s: FloatArray, tapers: int
) -> ComplexArray:
    """Spectral coefficients, (m, tapers, F); their squares are one-sided density per rad/s.

    The squared magnitudes of the coefficients of one frequency, averaged over the tapers, estimate
    the one-sided density there with two degrees of freedom per taper (Riedel and Sidorenko, 1995).
    Frequencies `bandwidth_rad_s` apart are nearly independent.

    The signals, shape (N, m), have no gaps; a straight line is subtracted from each. The
    frequencies, shape (F,), are below the Nyquist frequency.
    """
    count = len(signals)
    time = np.linspace(-1.0, 1.0, count)
    line = np.column_stack([np.ones(count), time])
    signals = signals - line @ np.linalg.lstsq(line, signals, rcond=None)[0]
    padded = _PADDING * count
    index = np.rint(omega_rad_s * padded * sample_time_s / (2 * np.pi)).astype(np.intp)
    order = np.arange(1, tapers + 1)[:, None]
    taper = np.sin(np.pi * order * np.arange(1, count + 1) / (count + 1))
    scale = np.sqrt(2 / (count + 1) * sample_time_s / np.pi)
    found = [
        [np.fft.rfft(scale * each * signal, padded)[index] for each in taper]
        for signal in signals.T
    ]
    return np.array(found)


class LogSpectrum(NamedTuple):
    """The logarithm of a spectrum."""

    #: Log-likelihood of the estimates over all spectra, without its constants.
    log_likelihood: float
    mean: FloatArray  #: shape (F,): logarithm of the density at the mode.


class SmoothSpectrum:
    """Finds the spectrum behind estimates at given frequencies.

    The frequencies, shape (F,), are positive, and the estimates there are taken as independent;
    each is the average of K `tapers`.
    """

    def __init__(self, omega_rad_s: FloatArray, tapers: int) -> None:
        place = np.log(omega_rad_s)
        distance = np.sqrt(3) * np.abs(place[:, None] - place) / _LENGTH
        self._prior = _SPREAD**2 * (1 + distance) * np.exp(-distance) + _LEVEL_SPREAD**2
        self._prior += _TINY * np.eye(len(place))
        self._tapers = tapers
        self._warm: FloatArray | None = None
        self._last: tuple[FloatArray, FloatArray]

    def restart(self) -> None:
        """Start the next search from the estimates, not from the last spectrum."""
        self._warm = None

    def find(self, estimate: FloatArray, noise: FloatArray) -> LogSpectrum:
        """Return the spectrum without noise from positive densities, shape (F,)."""
        prior, tapers = self._prior, self._tapers
        level = np.log(_START * estimate.mean())
        if self._warm is None:
            log_density = np.log(np.maximum(estimate - noise, _START * estimate)) - level
        else:
            log_density = self._warm - level
        for _ in range(_STEPS):
            density = np.exp(log_density + level)
            share = density / (density + noise)
            slope = tapers * share * (estimate / (density + noise) - 1)
            weight = np.maximum(tapers * share**2, _TINY)
            root = np.sqrt(weight)
            factor = np.linalg.cholesky(np.eye(len(root)) + root[:, None] * prior * root)
            target = weight * log_density + slope
            push = target - root * cho_solve((factor, True), root * (prior @ target))
            step = prior @ push - log_density
            longest = float(np.abs(step).max())
            log_density = log_density + step / max(1.0, longest)
            if longest < _CONVERGED:
                break
        self._warm, self._last = log_density + level, (factor, root)
        total = np.exp(self._warm) + noise
        return LogSpectrum(
            float(
                -tapers * np.sum(np.log(total) + estimate / total)
                - 0.5 * push @ log_density
                - np.log(factor.diagonal()).sum()
            ),
            self._warm,
        )

    def covariance(self) -> FloatArray:
        """Covariance of the logarithm that was found last, shape (F, F)."""
        factor, root = self._last
        explained = solve_triangular(factor, root[:, None] * self._prior, lower=True)
        covariance: FloatArray = self._prior - explained.T @ explained
        return covariance
