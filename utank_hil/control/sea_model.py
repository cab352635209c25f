"""The sea model of a predictor: the wave moment of the Kalman filter, from a spectrum.

A Gaussian sea is white noise through the minimum-phase filter whose response has the spectrum's
shape, and its best forecast is that of this filter. The impulse response h follows from the
logarithm of the spectrum (Kolmogorov's factorization, by fast Fourier transforms)::

    |H(exp(j w Ts))|^2 = pi S(w) / Ts,    S one-sided over angular frequency

and is reduced to a few states by balanced truncation, which keeps it stable. One lightly damped
oscillator, or a series of them, has skirts of finite slope instead of the steep front of swell, and
so predicts wave energy at the ship's resonance where the sea has none.

References
----------
A. Papoulis, Signal Analysis, 1977, section 7-3 (factorization by the logarithm).
S. Kung, A new identification and model reduction algorithm via singular value decomposition,
Asilomar 1978.
"""

from dataclasses import dataclass
from functools import lru_cache
from itertools import pairwise
from typing import Annotated

import numpy as np

from utank_hil.base.arrays import FloatArray
from utank_hil.base.parameters import NotNegative, Positive, Problem, Range, range_problems, refuse
from utank_hil.dynamics import GRAVITY_M_S2, LinearModel
from utank_hil.sea import Spectrum

# Seconds, not samples, because the sea's bandwidth does not depend on the sample time.
_RECORD_S = 1638.4  # the factorization's frequencies are 0.004 rad/s apart
_MEMORY_S = 160.0  # length of the impulse response that is used


@dataclass(frozen=True, slots=True)
class SeaModel:
    """The sea of a predictor, on the beam of a ship without speed."""

    #: Centres of the spectrum's bands, two or more (`utank_hil.sea.Spectrum`).
    frequency_hz: tuple[Positive, ...]
    density_m2_hz: tuple[NotNegative, ...]  #: Density of the surface elevation in each band.
    #: Ratio of effective to true wave slope.
    effective_slope: Annotated[float, Range(above=0, most=2)] = 0.5
    #: States of the model, 32 at most, and fewer than the samples in 160 s.
    order: Annotated[int, Range(least=1, most=32)] = 8
    #: Added to the slope's density, as a share of its maximum. A smaller one makes the forecast
    #: longer and more sensitive to errors of spectrum and ship. At most 100, a white sea.
    floor: Annotated[float, Range(above=0, most=100)] = 1.3e-3
    #: Standard deviation of the Gaussian that the slope's density is smoothed with; 1 at most,
    #: wider than any sea's peak.
    smoothing_rad_s: Annotated[float, Range(above=0, most=1)] = 0.007

    def __post_init__(self) -> None:
        problems = [*range_problems(self), *self._band_problems()]
        if not problems and not self.spectrum.moment(0) > 0:
            problems.append(("density_m2_hz", "must hold some energy"))
        refuse("sea", problems)

    def _band_problems(self) -> list[Problem]:
        bands, densities = len(self.frequency_hz), len(self.density_m2_hz)
        problems = []
        if bands < 2:
            problems.append(("frequency_hz", f"must name two bands or more, got {bands}"))
        falls = [pair for pair in pairwise(self.frequency_hz) if not pair[0] < pair[1]]
        if falls:
            low, high = falls[0]
            problems.append(("frequency_hz", f"must rise, got {high} after {low}"))
        if densities != bands:
            reason = f"must have one value per frequency, {bands} of them, got {densities}"
            problems.append(("density_m2_hz", reason))
        return problems

    @classmethod
    def of_slope(
        cls, omega_rad_s: FloatArray, slope_density: FloatArray, **settings: float
    ) -> "SeaModel":
        """Return the model of a sea that is given by the density of its effective slope.

        The frequencies, shape (F,), F > 1, are positive and increasing; the density is one-sided,
        in rad^2 per rad/s; `settings` are other parameters of the model.
        """
        density = 2 * np.pi * slope_density / (omega_rad_s**2 / GRAVITY_M_S2) ** 2
        return cls(
            tuple((omega_rad_s / (2 * np.pi)).tolist()),
            tuple(density.tolist()),
            effective_slope=1.0,
            **settings,  # type: ignore[arg-type]
        )

    @property
    def spectrum(self) -> Spectrum:
        """Spectrum of the surface elevation."""
        return Spectrum(np.array(self.frequency_hz), np.array(self.density_m2_hz))

    def slope_density(self, omega_rad_s: FloatArray) -> FloatArray:
        """One-sided density of the effective wave slope, rad^2 per rad/s."""
        spectrum = self.spectrum
        edges = 2 * np.pi * spectrum.band_edges_hz
        band = np.searchsorted(edges[:, 0], omega_rad_s, side="right") - 1
        inside = (band >= 0) & (omega_rad_s < edges[np.maximum(band, 0), 1])
        height = np.where(inside, spectrum.density[np.maximum(band, 0)], 0.0) / (2 * np.pi)
        slope: FloatArray = height * (self.effective_slope * omega_rad_s**2 / GRAVITY_M_S2) ** 2
        return slope

    def shaping_filter(self, sample_time_s: float) -> LinearModel:
        """Discrete filter from white noise of unit variance e(k) to the effective slope s(k).

        x(k) = A x(k-1) + B e(k), s(k) = C x(k): the newest noise is part of the state.

        ValueError is raised if 160 s hold too few samples for the order.
        """
        samples = round(_MEMORY_S / sample_time_s)
        if not self.order < samples:
            reason = (
                f"{self.order} must be below {samples}, the samples in {_MEMORY_S:g} s at "
                f"sample_time_s {sample_time_s:g}: lower one of the two"
            )
            refuse("", [("sea.order", reason)])
        return _shaping_filter(self, sample_time_s, samples)

    def _impulse_response(self, sample_time_s: float) -> FloatArray:
        """Minimum-phase impulse response over the record, an even number of samples."""
        half = round(_RECORD_S / sample_time_s / 2)
        omega = 2 * np.pi * np.abs(np.fft.fftfreq(2 * half, sample_time_s))
        density = _smoothed(self.slope_density(omega), self.smoothing_rad_s / float(omega[1]))
        density = density + self.floor * density.max()
        cepstrum = np.fft.ifft(np.log(np.pi * density / sample_time_s)).real
        causal = np.zeros(2 * half)
        causal[0] = cepstrum[0] / 2
        causal[1:half] = cepstrum[1:half]
        causal[half] = cepstrum[half] / 2
        return np.asarray(np.fft.ifft(np.exp(np.fft.fft(causal))).real)


def _smoothed(values: FloatArray, deviation: float) -> FloatArray:
    """Smooth periodic values by a Gaussian truncated at four deviations, in samples."""
    reach = int(4 * deviation + 0.5)
    weights = np.exp(-0.5 / deviation**2 * np.arange(-reach, reach + 1) ** 2)
    weights = (weights / weights.sum())[: reach + 1]
    found: FloatArray = values * weights[reach]
    for back in range(reach, 0, -1):
        found += (np.roll(values, back) + np.roll(values, -back)) * weights[reach - back]
    return found


@lru_cache(maxsize=4)
def _shaping_filter(sea: SeaModel, sample_time_s: float, samples: int) -> LinearModel:
    """Compute `SeaModel.shaping_filter`, cached and read-only; the designs of a search share it."""
    found = _balanced(sea._impulse_response(sample_time_s)[:samples], sea.order, sample_time_s)
    for matrix in found[:4]:
        matrix.flags.writeable = False
    return found


def _balanced(impulse: FloatArray, order: int, sample_time_s: float) -> LinearModel:
    """Balanced truncation of a finite impulse response h[0], h[1], ... = C B, C A B, ..."""
    from scipy.sparse.linalg import LinearOperator, eigsh

    # The Hankel matrix would take 2 GB at 10 ms; its product with v is a convolution.
    count = len(impulse)
    spectrum = np.fft.rfft(impulse, 2 * count)

    def hankel_times(v: FloatArray) -> FloatArray:
        turned = np.fft.rfft(v.ravel()[::-1], 2 * count)
        product: FloatArray = np.fft.irfft(spectrum * turned, 2 * count)[count - 1 : 2 * count - 1]
        return product

    hankel = LinearOperator((count, count), matvec=hankel_times, dtype=np.float64)
    values, vectors = eigsh(hankel, k=order, which="LM", v0=np.ones(count))
    vectors *= np.where(vectors[0] < 0, -1.0, 1.0)  # the solver's choice differs with scipy
    root = np.sqrt(np.abs(values))
    observability = vectors * root
    shifted = np.vstack([observability[1:], np.zeros((1, order))])
    return LinearModel(
        (vectors / root).T @ shifted,
        (observability[:1] * np.sign(values)).T,
        observability[:1],
        np.zeros((1, 1)),
        sample_time_s,
    )
