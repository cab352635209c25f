"""Effects of roll on people: apparent gravity, interruptions, work limits, motion sickness.

For pure roll about the centre of gravity, the apparent gravity at a height Z above and a distance y
to starboard of it is, in body axes::

    lateral  = g sin(phi) - Z phi'' + y phi'^2       to starboard
    vertical = g cos(phi) - y phi'' - Z phi'^2       towards the deck

The lateral part is the lateral force estimator of Baitis, Woolaver and Beck (1983) for pure roll.
Sway, heave, yaw and pitch of a real ship add to both parts and are not included.
"""

import math
from dataclasses import dataclass
from statistics import NormalDist
from typing import Final, NamedTuple

import numpy as np

from utank_hil.base.arrays import ComplexArray, FloatArray
from utank_hil.dynamics.tank import GRAVITY_M_S2

STANDING: Final = 0.25
"""Tipping coefficient of a person standing and facing forward or aft, Graham (1990)."""
EXPOSURE_S: Final = 7200.0  #: Two hours, as in the experiments for the motion sickness incidence.


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


class WorkLimit(NamedTuple):
    """Largest RMS values for a kind of work on board."""

    work: str
    roll_rad: float
    lateral_m_s2: float
    vertical_m_s2: float


def _limit(work: str, roll_deg: float, lateral_g: float, vertical_g: float) -> WorkLimit:
    return WorkLimit(
        work, math.radians(roll_deg), lateral_g * GRAVITY_M_S2, vertical_g * GRAVITY_M_S2
    )


NORDFORSK_1987: Final = (
    _limit("light manual work", 6.0, 0.10, 0.20),
    _limit("heavy manual work", 4.0, 0.07, 0.15),
    _limit("intellectual work", 3.0, 0.05, 0.10),
    _limit("transit passengers", 2.5, 0.04, 0.05),
    _limit("cruise liner", 2.0, 0.03, 0.02),
)
"""NORDFORSK (1987), "Assessment of ship performance in a seaway": criteria for accelerations and
roll."""


@dataclass(frozen=True, slots=True)
class Comfort:
    """Comfort at a place on board, for a roll record."""

    lateral_rms_m_s2: float  #: RMS of the lateral force estimator, which contains gravity.
    vertical_rms_m_s2: float  #: RMS of the vertical acceleration without its mean.
    #: RMS of the effective gravity angle, between apparent gravity and the deck's normal.
    gravity_angle_rms_rad: float
    interruptions_per_min: float  #: `motion_induced_interruptions` of a standing person.
    sickness_percent: float  #: `motion_sickness_incidence` for an exposure of `EXPOSURE_S`.
    sickness_dose_m_s15: float  #: `motion_sickness_dose` for the same exposure.
    allowed_work: tuple[str, ...]  #: Work within the limits of `NORDFORSK_1987`.


def comfort(
    roll_rad: FloatArray,
    roll_rate_rad_s: FloatArray,
    step_s: float,
    height_m: float,
    starboard_m: float = 0.0,
) -> Comfort:
    """Comfort at a place on board, for a roll record.

    Roll and rate, shape (n,), are uniformly sampled at 10 Hz or more; `height_m` and `starboard_m`
    are above, and to starboard of, the ship's centre of gravity.
    """
    lateral, vertical = apparent_gravity(roll_rad, roll_rate_rad_s, step_s, height_m, starboard_m)
    vertical_motion = vertical - vertical.mean()
    roll_rms, lateral_rms, vertical_rms = _rms(roll_rad), _rms(lateral), _rms(vertical_motion)
    ups = _up_crossings(vertical_motion)
    duration_s = step_s * len(vertical_motion)
    sickness = motion_sickness_incidence(vertical_rms, ups / duration_s, EXPOSURE_S) if ups else 0.0
    return Comfort(
        lateral_rms_m_s2=lateral_rms,
        vertical_rms_m_s2=vertical_rms,
        gravity_angle_rms_rad=_rms(np.arctan2(lateral, vertical)),
        interruptions_per_min=motion_induced_interruptions(lateral, vertical, step_s),
        sickness_percent=sickness,
        sickness_dose_m_s15=motion_sickness_dose(vertical_motion, step_s)
        * math.sqrt(EXPOSURE_S / duration_s),
        allowed_work=allowed_work(roll_rms, lateral_rms, vertical_rms),
    )


def apparent_gravity(
    roll_rad: FloatArray,
    roll_rate_rad_s: FloatArray,
    step_s: float,
    height_m: float,
    starboard_m: float = 0.0,
) -> tuple[FloatArray, FloatArray]:
    """Lateral and vertical apparent gravity of the module's equation, m/s^2, as of `comfort`."""
    acceleration = np.gradient(roll_rate_rad_s, step_s)
    square = np.square(roll_rate_rad_s)
    lateral = GRAVITY_M_S2 * np.sin(roll_rad) - height_m * acceleration + starboard_m * square
    vertical = GRAVITY_M_S2 * np.cos(roll_rad) - starboard_m * acceleration - height_m * square
    return lateral, vertical


def motion_induced_interruptions(
    lateral_m_s2: FloatArray,
    vertical_m_s2: FloatArray,
    step_s: float,
    tipping_coefficient: float = STANDING,
) -> float:
    """Motion-induced interruptions per minute of a standing person, to keep balance.

    Counts tips: lateral apparent gravity above `tipping_coefficient` times the vertical, to either
    side. Graham (1990), "Motion-induced interruptions as ship operability criteria", Naval
    Engineers Journal 102(2), calls 0.1 a minute possible, 0.5 probable, 1.5 serious, 3 severe and 5
    extreme. Both accelerations, shape (n,), are from `apparent_gravity`; `tipping_coefficient` is
    half the stance width over the height of the person's centre of gravity.
    """
    limit = tipping_coefficient * vertical_m_s2
    tips = _up_crossings(lateral_m_s2 - limit) + _up_crossings(-lateral_m_s2 - limit)
    return float(60 * tips / (step_s * len(lateral_m_s2)))


def allowed_work(
    roll_rms_rad: float, lateral_rms_m_s2: float, vertical_rms_m_s2: float
) -> tuple[str, ...]:
    """Kinds of work within all three limits of `NORDFORSK_1987`."""
    return tuple(
        limit.work
        for limit in NORDFORSK_1987
        if roll_rms_rad <= limit.roll_rad
        and lateral_rms_m_s2 <= limit.lateral_m_s2
        and vertical_rms_m_s2 <= limit.vertical_m_s2
    )


def _rms(signal: FloatArray) -> float:
    return float(np.sqrt(np.mean(np.square(signal))))


def _up_crossings(signal: FloatArray) -> int:
    return int(np.count_nonzero((signal[:-1] < 0) & (signal[1:] >= 0)))
