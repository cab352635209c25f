"""Basis functions of a disturbance, thesis (3.12), after Goodzeit and Phan (2000).

Added to the regression they remove the wave from the data: only its shape in time must be known;
amplitude and phase are fitted with the model.
"""

import math
from collections.abc import Sequence

import numpy as np
from scipy.linalg import cho_factor, cho_solve
from scipy.optimize import minimize_scalar

from utank_hil.base.arrays import FloatArray
from utank_hil.identification.lag_regression import LagRegression
from utank_hil.identification.record import channel_scale, stacked_record

_ORDER = 12  # Three times the states of ship and tank: their memory, but not a wave's.
_RIDGE = 1e-4  # Squared relative noise of 1 %.
_STEPS_A_CYCLE = 4  # Trial frequencies per DFT bin (one cycle over the record).
_EVIDENCE = 30.0  # Smallest F statistic of a line; noise reaches 6, an irregular sea 20.


def disturbance_basis(
    samples: int,
    sample_time_s: float,
    frequencies_rad_s: Sequence[float] = (),
    polynomial_degree: int | None = None,
    decay_rates_1_s: Sequence[float] = (),
) -> FloatArray:
    """Functions of time at t = 0, dt, ...; shape (d, samples), no value above 1 in magnitude.

    They are a sine and a cosine of each frequency, and with a degree Legendre polynomials over the
    record: up to 0 for an offset (a steady heel, the bias of a sensor), up to 1 for a drift as
    well; and exp(-rate t) of each rate, where a negative one grows. ValueError is raised if
    frequencies or rates are not finite and distinct, a frequency is not positive, a rate is zero,
    or the degree is negative.
    """
    values, rates = list(frequencies_rad_s), list(decay_rates_1_s)
    for name, given in (("frequencies_rad_s", values), ("decay_rates_1_s", rates)):
        if not all(math.isfinite(v) for v in given) or len(set(given)) != len(given):
            raise ValueError(f"disturbance {name} must be finite and distinct, got {given}")
    if 0 in rates:
        raise ValueError("disturbance decay rates must not be zero; use polynomial_degree=0")
    if not all(w > 0 for w in values):
        raise ValueError(
            f"disturbance frequencies must be positive, got {values}; an offset is "
            "polynomial_degree=0"
        )
    if polynomial_degree is not None and polynomial_degree < 0:
        raise ValueError(
            f"disturbance polynomial_degree must be 0 or more, got {polynomial_degree}"
        )
    time_s = np.arange(samples) * sample_time_s
    rows = [shape(w * time_s) for w in values for shape in (np.sin, np.cos)]
    if polynomial_degree is not None:
        span = np.linspace(-1.0, 1.0, samples)
        rows += list(np.polynomial.legendre.legvander(span, polynomial_degree).T)
    for rate in rates:
        # The value is 1 at the end where the function is largest, so that none overflows.
        rows.append(np.exp(-abs(rate) * (time_s if rate > 0 else time_s[::-1])))
    return np.array(rows).reshape(len(rows), samples)


def find_disturbance_frequencies(
    u: FloatArray,
    y: FloatArray,
    sample_time_s: float,
    most: int = 3,
    band_rad_s: tuple[float, float] = (0.2, 2.0),
) -> tuple[float, ...]:
    """Frequencies of sinusoidal disturbances, an argument of `okid`.

    For each trial frequency the regression is solved with and without a sine and cosine. The
    reduction of the squared prediction error is the evidence for a spectral line (variable
    projection, without computing the coefficients)::

        reduction(w) = e^T Psi (Psi^T P Psi)^-1 Psi^T e,   e = P y
        P = I - Phi (Phi^T Phi + mu I)^-1 Phi^T

    The order is low, because a high-order ARX model predicts any sine wave from its own past. The
    small ridge parameter mu represents measurement noise in data without noise.

    ValueError is raised if the band does not lie between zero and the Nyquist frequency.
    IdentificationError is raised if the record is too short or a channel does not move.

    Parameters
    ----------
    y : array_like, shape (N, m) or (N,)
        NaN rows are gaps, as in `okid`.
    most : int
        Largest number of lines; the search ends where no further one is significant.
    band_rad_s : tuple of float
        Search band.

    Returns
    -------
    tuple of float
        rad/s, the strongest first; empty if no line is significant.
    """
    low, high = band_rad_s
    if not 0 < low < high < np.pi / sample_time_s:
        raise ValueError(
            f"band_rad_s must rise and lie between 0 and {np.pi / sample_time_s:.3g}, "
            f"got {band_rad_s}"
        )
    z, m = stacked_record(u, y)
    z = z / channel_scale(z, m)
    step = 2 * np.pi / (len(z) * sample_time_s) / _STEPS_A_CYCLE
    grid = np.arange(low, high + step, step)
    lines: list[float] = []
    while len(lines) < most:
        search = _Search(z, m, lines, sample_time_s)
        # No second line is allowed within one DFT bin of another.
        candidates = [w for w in grid if all(abs(w - old) > _STEPS_A_CYCLE * step for old in lines)]
        if not candidates:
            break
        line = search.refined(max(candidates, key=search.reduction), step)
        if search.reduction(line) < _EVIDENCE * 2 * m:
            break
        lines.append(line)
        if len(lines) > 1:  # Lines interact, so each one is refined with the others in place.
            for i, old in enumerate(lines):
                others = lines[:i] + lines[i + 1 :]
                lines[i] = _Search(z, m, others, sample_time_s).refined(old, step)
    return tuple(lines)


class _Search:
    """Evidence for one more line in addition to known ones."""

    def __init__(self, z: FloatArray, m: int, lines: list[float], sample_time_s: float) -> None:
        known = disturbance_basis(len(z), sample_time_s, lines)
        regression = LagRegression(z, m, _ORDER, known)
        self._matrix = regression.matrix
        ridge = _RIDGE * regression.rows * np.eye(regression.columns)
        self._factor = cho_factor(self._matrix.T @ self._matrix + ridge)
        self._errors = regression.residuals(
            cho_solve(self._factor, self._matrix.T @ regression.targets)
        )
        self._variance = np.mean(self._errors**2, axis=0) + _RIDGE
        self._time_s = regression.at * sample_time_s

    def reduction(self, frequency_rad_s: float) -> float:
        """Return the reduction of the squared error over its variance, summed over outputs."""
        turn = frequency_rad_s * self._time_s
        waves = np.column_stack([np.sin(turn), np.cos(turn)])
        shared = self._matrix.T @ waves
        inner = waves.T @ waves - shared.T @ cho_solve(self._factor, shared)
        seen = waves.T @ self._errors
        gain = np.sum(seen * np.linalg.solve(inner, seen), axis=0)
        return float(np.sum(gain / self._variance))

    def refined(self, frequency_rad_s: float, step: float) -> float:
        """Return the frequency of the largest reduction within a step of a trial frequency."""
        found = minimize_scalar(
            lambda w: -self.reduction(w),
            bounds=(max(frequency_rad_s - step, step / 2), frequency_rad_s + step),
            method="bounded",
            options={"xatol": 1e-3 * step},
        )
        return float(found.x)
