"""A one-dimensional wave spectrum: energy in frequency bands.

The spectral density S(f) in m^2/Hz is one-sided and constant within a band, as a buoy reports it.
All moments are sums over the bands, so the significant wave height 4 sqrt(m0) equals the published
one.

Model spectra: JONSWAP, Pierson-Moskowitz, ITTC.

The `*_density` functions return the spectral density S(omega) in m^2 s/rad. Each is normalised so
that its integral over all frequencies is exactly Hs^2 / 16. The functions without the suffix sample
a density into a `Spectrum` up to ten peak frequencies; the omitted tail has 1.3e-4 of the variance
(6e-5 of Hs).

All three share the form S = A omega^-5 exp(-5/4 (omega_p / omega)^4), so m0 = A / (5 omega_p^4).
"""

import functools
import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from utank_hil.base.arrays import FloatArray
from utank_hil.base.elementary import each, exp, log
from utank_hil.base.ordered_sums import product
from utank_hil.dynamics.tank import GRAVITY_M_S2


def band_edges(frequency_hz: FloatArray) -> FloatArray:
    """Lower and upper edges, shape (F, 2) in Hz, of frequency bands with given increasing centres.

    Edges are midpoints where the spacing is uniform. Where it changes, between two uniformly spaced
    parts, the gap is divided in proportion to the spacing on either side, and bands never overlap.
    For NDBC's grids (0.0325, 0.0375, ... 0.0925, 0.1000, 0.1100, ...) this gives the bandwidths in
    NDBC's "Description of NDBC wave spectra"; with midpoints the band at 0.1 Hz is an eighth too
    narrow.
    """
    gap = np.diff(frequency_hz)
    # The spacing is extrapolated linearly beyond the grid.
    before = max(2 * gap[0] - gap[min(1, gap.size - 1)], gap[0])
    after = max(2 * gap[-1] - gap[max(-2, -gap.size)], gap[-1])
    left = np.concatenate([[before], gap[:-1]])
    right = np.concatenate([gap[1:], [after]])
    margin = 1.02  # This is the tolerance for frequencies rounded in the file.
    changes = (gap > margin * np.minimum(left, right)) & (margin * gap < np.maximum(left, right))
    between = frequency_hz[:-1] + gap * np.where(changes, left / (left + right), 0.5)
    # The outermost bands are symmetric, at most twice as wide as their neighbours.
    widths = np.diff(between) if between.size > 1 else gap
    first_half = min(between[0] - frequency_hz[0], widths[0])
    last_half = min(frequency_hz[-1] - between[-1], widths[-1])
    lower = np.concatenate([[max(frequency_hz[0] - first_half, 0.0)], between])
    upper = np.concatenate([between, [frequency_hz[-1] + last_half]])
    upper[0] = frequency_hz[0] + first_half
    lower[-1] = frequency_hz[-1] - last_half
    return np.column_stack([lower, upper])


@dataclass(frozen=True, slots=True, eq=False)
class Spread:
    """Energy of frequency bands in the directions that their waves come from."""

    #: shape (D,): centres of the sectors, degrees clockwise from true north, increasing.
    direction_from_deg: FloatArray
    energy: FloatArray  #: shape (..., F, D): energy per sector, in any unit.

    def offset_rad(
        self, mean_from_deg: FloatArray, band: npt.NDArray[np.intp], probability: FloatArray
    ) -> FloatArray:
        """Quantiles of the directions of bands, relative to their mean direction.

        Means have shape (F,), band and probability of each quantile shape (N,); `energy` has the
        shape (F, D) and is constant within a sector. The probability goes from 0, 180 degrees left
        of the mean, to 1.
        """
        offset = np.zeros(len(band))
        for one in np.unique(band):
            relative = (self.direction_from_deg - mean_from_deg[one] + 180) % 360 - 180
            order = np.argsort(relative)
            relative, energy = relative[order], self.energy[one][order]
            edges = (relative + np.r_[relative[-1] - 360, relative[:-1]]) / 2
            edges = np.r_[edges, edges[0] + 360]
            below = np.r_[0.0, np.cumsum(energy)]
            if below[-1] > 0:
                here = band == one
                offset[here] = np.interp(probability[here], below / below[-1], edges)
        return np.radians(offset)


@dataclass(frozen=True, slots=True, eq=False)
class Spectrum:
    """Wave spectrum at a fixed point; ValueError unless finite, alike and rising in frequency."""

    #: shape (F,): centre frequencies of the bands, positive and increasing, F > 1.
    frequency_hz: FloatArray
    density: FloatArray  #: shape (F,): one-sided spectral density in m^2/Hz, zero or more.
    #: shape (F,): mean direction the waves of each band come from, degrees clockwise from true
    #: north (NDBC's alpha1).
    direction_from_deg: FloatArray | None = None
    spread: Spread | None = None  #: Spread of each band about its mean direction.

    def __post_init__(self) -> None:
        frequency, density = self.frequency_hz, self.density
        if frequency.ndim != 1 or frequency.size < 2 or density.shape != frequency.shape:
            raise ValueError(
                "spectrum needs two or more frequencies and as many densities, got shapes "
                f"{frequency.shape} and {density.shape}"
            )
        before = np.concatenate([[0.0], frequency[:-1]])
        wrong = ~(np.isfinite(frequency) & (frequency > before))
        if wrong.any():
            got = f"got {frequency[wrong][0]:g} after {before[wrong][0]:g}: sort, each once"
            must = "spectrum frequency_hz must be finite, positive and increasing"
            raise ValueError(f"{must}, {got}")
        wrong = ~(np.isfinite(density) & (density >= 0))
        if wrong.any():
            got = f"got {density[wrong][0]:g} at {frequency[wrong][0]:g} Hz"
            raise ValueError(f"spectrum density must be finite and zero or more, {got}")
        if self.direction_from_deg is not None and self.direction_from_deg.shape != frequency.shape:
            raise ValueError("spectrum direction_from_deg must have one value per frequency")
        if self.spread is not None and self.direction_from_deg is None:
            raise ValueError("a spectrum with a spread must have mean directions")

    @property
    def band_edges_hz(self) -> FloatArray:
        """Lower and upper edges of the bands, shape (F, 2)."""
        return band_edges(self.frequency_hz)

    def moment(self, order: int) -> float:
        """Integral of f^n S(f) df over the bands in m^2 Hz^n, for n of zero or more."""
        lower, upper = self.band_edges_hz.T
        power = order + 1
        return float(self.density @ (upper**power - lower**power) / power)

    @property
    def hs_m(self) -> float:
        """Significant wave height 4 sqrt(m0)."""
        return 4 * math.sqrt(self.moment(0))

    @property
    def tp_s(self) -> float:
        """Peak period of the band with the greatest density; nan without energy."""
        peak = int(np.argmax(self.density))
        return float(1 / self.frequency_hz[peak]) if self.density[peak] > 0 else math.nan

    @property
    def tz_s(self) -> float:
        """Mean zero-up-crossing period sqrt(m0 / m2); nan without energy."""
        second = self.moment(2)
        return math.sqrt(self.moment(0) / second) if second > 0 else math.nan

    def heading_rad(self, course_deg: float) -> FloatArray:
        """Direction of travel relative to a ship on a course, per band, shape (F,).

        It lies in (-pi, pi]: 0 following, pi head, +pi/2 travelling from port to starboard.
        `course_deg` is clockwise from true north. ValueError is raised if the spectrum has no
        directions, or one is missing where there is energy.
        """
        if self.direction_from_deg is None:
            raise ValueError("spectrum has no directions: load it with the mean direction file")
        missing = ~np.isfinite(self.direction_from_deg) & (self.density > 0)
        if missing.any():
            raise ValueError(
                f"spectrum has no direction at {self.frequency_hz[missing][0]:g} Hz, "
                "where it has energy: choose another hour or give a heading"
            )
        towards = np.radians(np.nan_to_num(self.direction_from_deg) + 180 - course_deg)
        return np.pi - np.mod(np.pi - towards, 2 * np.pi)


@dataclass(frozen=True, slots=True, eq=False)
class SlopeSpectrum:
    """Density of the effective wave slope in bands of equal width.

    The moment is given per roll stiffness of the ship, as an angle: the effective wave slope
    (`Sea`). This is sufficient for a law. The wave height follows from an assumed ratio of
    effective to true slope and an assumed direction.

    ValueError is raised if the shapes differ, the frequencies are not equally spaced, or a value is
    negative or not finite.
    """

    #: shape (F,): centres of the bands: encounter frequencies, positive and equally spaced, F > 1.
    omega_rad_s: FloatArray
    density: FloatArray  #: shape (F,): one-sided density in rad^2 per rad/s, zero or more.

    def __post_init__(self) -> None:
        omega, density = self.omega_rad_s, self.density
        if omega.ndim != 1 or omega.size < 2 or density.shape != omega.shape:
            raise ValueError(
                "a slope spectrum needs two or more frequencies and as many densities, got shapes "
                f"{omega.shape} and {density.shape}"
            )
        steps = np.diff(omega)
        if not (omega[0] > 0 and steps[0] > 0 and np.allclose(steps, steps[0], rtol=1e-6)):
            raise ValueError("slope spectrum omega_rad_s must be positive and equally spaced")
        if not (np.isfinite(density).all() and np.all(density >= 0)):
            raise ValueError("slope spectrum density must be finite and zero or more")

    @property
    def band_rad_s(self) -> float:
        """Width of a band."""
        return float(self.omega_rad_s[1] - self.omega_rad_s[0])

    @property
    def rms_rad(self) -> float:
        """Root mean square of the effective slope."""
        return math.sqrt(float(self.density.sum()) * self.band_rad_s)

    def slope_density(self, omega_rad_s: FloatArray) -> FloatArray:
        """Density of the slope, rad^2 per rad/s: linear between centres, zero beyond the bands."""
        return np.interp(omega_rad_s, self.omega_rad_s, self.density, left=0.0, right=0.0)

    def elevation_density(self, effective_slope: float) -> FloatArray:
        """One-sided density of the surface elevation in each band, m^2 per rad/s.

        It holds for beam waves in deep water and a ship without speed; `effective_slope` is the
        ratio of effective to true wave slope.
        """
        per_height = effective_slope * np.square(self.omega_rad_s) / GRAVITY_M_S2
        density: FloatArray = self.density / np.square(per_height)
        return density

    def hs_m(self, effective_slope: float) -> float:
        """Significant wave height of `elevation_density`."""
        return 4 * math.sqrt(float(self.elevation_density(effective_slope).sum()) * self.band_rad_s)


PHILLIPS = 8.1e-3  # Equilibrium-range constant of Pierson and Moskowitz (1964).


def ittc_density(omega_rad_s: FloatArray, hs_m: float, tp_s: float) -> FloatArray:
    """ITTC two-parameter spectrum (Bretschneider), ITTC 1978, in m^2 s/rad, of any shape."""
    _require_positive(hs_m=hs_m, tp_s=tp_s)
    peak = 2 * math.pi / tp_s
    ratio = np.asarray(omega_rad_s, dtype=float) / peak
    # Below 0.2 the exponential is less than 1e-300; this also avoids division by zero.
    u = np.maximum(ratio, 0.2)
    shape = np.where(ratio > 0.2, _shape(u), 0.0)
    density: FloatArray = 5 / 16 * hs_m * hs_m / peak * shape
    return density


def jonswap_density(
    omega_rad_s: FloatArray, hs_m: float, tp_s: float, gamma: float = 3.3
) -> FloatArray:
    """JONSWAP spectrum (Hasselmann et al. 1973), normalised to Hs exactly.

    S = C(gamma) S_ITTC gamma^r, r = exp(-(omega / omega_p - 1)^2 / (2 sigma^2)), sigma = 0.07 up to
    the peak and 0.09 above. C is integrated numerically; the common fit 1 - 0.287 ln(gamma) has
    errors of up to 2 % in energy. gamma = 1 is the ITTC spectrum. Other parameters, result and
    errors as `ittc_density`; also ValueError if gamma is less than 1.
    """
    if not (math.isfinite(gamma) and gamma >= 1):
        raise ValueError(f"JONSWAP peak enhancement gamma must be 1 or more, got {gamma}")
    ratio = np.asarray(omega_rad_s, dtype=float) * tp_s / (2 * math.pi)
    enhanced = ittc_density(omega_rad_s, hs_m, tp_s) * _enhancement(ratio, gamma)
    density: FloatArray = enhanced / _energy_ratio(gamma)
    return density


def ittc(hs_m: float, tp_s: float) -> Spectrum:
    """ITTC two-parameter `Spectrum` of given significant wave height and peak period."""
    return _sample(lambda omega: ittc_density(omega, hs_m, tp_s), tp_s)


def pierson_moskowitz(hs_m: float) -> Spectrum:
    """Pierson-Moskowitz `Spectrum` of a fully developed sea: the height determines the period.

    S = alpha g^2 omega^-5 exp(-beta omega^-4), alpha = 8.1e-3, beta = 4 alpha (g / Hs)^2.
    """
    return ittc(hs_m, developed_peak_period_s(hs_m))


def jonswap(hs_m: float, tp_s: float, gamma: float = 3.3) -> Spectrum:
    """JONSWAP `Spectrum` of given significant wave height, peak period and peak enhancement."""
    return _sample(lambda omega: jonswap_density(omega, hs_m, tp_s, gamma), tp_s)


def developed_peak_period_s(hs_m: float) -> float:
    """Peak period of a fully developed sea, from omega_p^4 = 16 alpha g^2 / (5 Hs^2)."""
    _require_positive(hs_m=hs_m)
    peak = math.sqrt(GRAVITY_M_S2 / hs_m * math.sqrt(16 / 5 * PHILLIPS))
    return float(2 * math.pi / peak)


def _enhancement(ratio: FloatArray, gamma: float) -> FloatArray:
    sigma = np.where(ratio <= 1, 0.07, 0.09)
    off = (ratio - 1) / sigma
    return each(exp, log(gamma) * each(exp, -off * off / 2))


def _shape(u: FloatArray) -> FloatArray:
    """u^-5 exp(-5/4 u^-4)."""
    fourth = 1 / (u * u * u * u)
    shape: FloatArray = fourth / u * each(exp, -1.25 * fourth)
    return shape


@functools.lru_cache(maxsize=64)
def _energy_ratio(gamma: float) -> float:
    """Energy of the enhanced spectrum relative to the ITTC spectrum's, to 1e-12.

    Quadrature of the excess by Gauss's five points in each of 50 panels, separately on each side
    of the peak, where sigma jumps.
    """
    near, far = (math.sqrt(5 + side * 2 * math.sqrt(10 / 7)) / 3 for side in (-1, 1))
    points = np.array([-far, -near, 0.0, near, far])
    nodes = ((2 * np.arange(50)[:, None] + 1 + points) / 50 - 1).ravel()
    middle, outer = ((322 + side * 13 * math.sqrt(70)) / 900 for side in (1, -1))
    weights = np.tile([outer, middle, 128 / 225, middle, outer], 50) / 50
    excess = 0.0
    for low, high in ((0.4, 1.0), (1.0, 1.9)):  # At 8.6 and 10 sigma the excess is below 1e-16.
        u = low + (high - low) * (nodes + 1) / 2
        bump = 5 * _shape(u) * (_enhancement(u, gamma) - 1)
        excess += float((high - low) / 2 * product(weights, bump))
    return 1 + excess


def _sample(density: Callable[[FloatArray], FloatArray], tp_s: float) -> Spectrum:
    ratio = np.arange(40, 1001) / 100  # Bands are a hundredth of the peak frequency.
    omega = 2 * np.pi / tp_s * ratio
    return Spectrum(frequency_hz=ratio / tp_s, density=2 * np.pi * density(omega))


def _require_positive(**values: float) -> None:
    for name, value in values.items():
        if not (math.isfinite(value) and value > 0):
            raise ValueError(f"spectrum {name} must be positive and finite, got {value}")
