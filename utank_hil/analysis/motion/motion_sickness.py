"""Motion sickness from vertical acceleration: McCauley et al. (1976) and ISO 2631-1:1997.

Both use vertical acceleration only. Roll causes some away from the centre line
(`utank_hil.analysis.motion.comfort`); heave and pitch, which are not modelled here, usually cause
more.
"""

import math
from statistics import NormalDist

import numpy as np

from utank_hil.base.arrays import ComplexArray, FloatArray
from utank_hil.dynamics.tank import GRAVITY_M_S2


def motion_sickness_incidence(
    acceleration_rms_m_s2: float, frequency_hz: float, exposure_s: float
) -> float:
    """Motion sickness incidence: percentage of people who vomit within an exposure.

    ::

        MSI = 100 Phi(z_a) Phi(z_t)
        z_a = 2.128 log10(a) - 9.277 log10(f) - 5.809 log10(f)^2 - 1.851
        z_t = 1.134 z_a + 1.989 log10(t) - 2.904

    a RMS in g, f in Hz, t in minutes, Phi the normal distribution. McCauley, Royal, Wylie, O'Hanlon
    and Mackie (1976), "Motion sickness incidence: exploratory studies of habituation, pitch and
    roll, and the refinement of a mathematical model", Human Factors Research, AD-A024 709;
    unadapted young men, single frequencies. For irregular motion f is its mean frequency. Returns 0
    to 100. Raises `ValueError` if an argument is negative, or frequency or exposure is zero.
    """
    if not (acceleration_rms_m_s2 >= 0 and frequency_hz > 0 and exposure_s > 0):
        raise ValueError(
            "motion sickness needs an acceleration of zero or more and a positive frequency and "
            f"exposure, got {acceleration_rms_m_s2}, {frequency_hz} and {exposure_s}"
        )
    if acceleration_rms_m_s2 == 0:
        return 0.0
    f = math.log10(frequency_hz)
    z_a = 2.128 * math.log10(acceleration_rms_m_s2 / GRAVITY_M_S2) - 9.277 * f - 5.809 * f**2
    z_a -= 1.851
    z_t = 1.134 * z_a + 1.989 * math.log10(exposure_s / 60) - 2.904
    normal = NormalDist()
    return 100 * normal.cdf(z_a) * normal.cdf(z_t)


def motion_sickness_dose(acceleration_m_s2: FloatArray, step_s: float) -> float:
    """Motion sickness dose value MSDV_z, ISO 2631-1:1997 D.1, in m/s^1.5.

    The square root of the time integral of the squared vertical acceleration with the frequency
    weighting W_f, which is applied to the discrete Fourier transform of the record.
    `acceleration_m_s2`, shape (n,), is uniformly sampled at several Hz; its mean is subtracted.
    """
    spectrum = np.fft.rfft(acceleration_m_s2 - np.mean(acceleration_m_s2))
    frequency_hz = np.arange(len(spectrum)) / (step_s * len(acceleration_m_s2))
    weight = vertical_weighting(frequency_hz)
    weighted = np.fft.irfft(np.abs(weight) * spectrum, len(acceleration_m_s2))
    return float(np.sqrt(np.sum(np.square(weighted)) * step_s))


def vertical_weighting(frequency_hz: FloatArray) -> ComplexArray:
    """Frequency weighting W_f of ISO 2631-1:1997 annex A, complex, shape of `frequency_hz`.

    Band limits 0.08 and 0.63 Hz (Butterworth), transition at 0.25 Hz (Q 0.86), upward step from
    0.0625 Hz (Q 0.80) to 0.1 Hz (Q 0.80).
    """
    # in Hz throughout, since only ratios matter
    s = np.asarray(1j * frequency_hz, dtype=np.complex128)
    high_pass = s**2 / _second_order(s, 0.08, math.sqrt(0.5)) / 0.08**2
    low_pass = 1 / _second_order(s, 0.63, math.sqrt(0.5))
    transition = 1 / _second_order(s, 0.25, 0.86)
    step = _second_order(s, 0.0625, 0.80) / _second_order(s, 0.1, 0.80) * (0.0625 / 0.1) ** 2
    weighting: ComplexArray = high_pass * low_pass * transition * step
    return weighting


def _second_order(s: ComplexArray, corner: float, quality: float) -> ComplexArray:
    polynomial: ComplexArray = 1 + s / (quality * corner) + (s / corner) ** 2
    return polynomial
