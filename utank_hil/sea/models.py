"""Model spectra: JONSWAP, Pierson-Moskowitz, ITTC.

The `*_density` functions return the spectral density S(omega) in m^2 s/rad. Each is normalised so
that its integral over all frequencies is exactly Hs^2 / 16. The functions without the suffix sample
a density into a `Spectrum` up to ten peak frequencies; the omitted tail has 1.3e-4 of the variance
(6e-5 of Hs).

All three share the form S = A omega^-5 exp(-5/4 (omega_p / omega)^4), so m0 = A / (5 omega_p^4).
"""

import functools
import math
from collections.abc import Callable

import numpy as np

from utank_hil.base.arrays import FloatArray
from utank_hil.base.elementary import each, exp, log
from utank_hil.base.ordered_sums import product
from utank_hil.dynamics.tank import GRAVITY_M_S2
from utank_hil.sea.spectrum import Spectrum

PHILLIPS = 8.1e-3  # Equilibrium-range constant of Pierson and Moskowitz (1964).


def ittc_density(omega_rad_s: FloatArray, hs_m: float, tp_s: float) -> FloatArray:
    """ITTC two-parameter spectrum (Bretschneider; modified Pierson-Moskowitz), ITTC 1978.

    Returns S(omega) in m^2 s/rad at the angular frequencies, zero or more, of any shape.
    """
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
