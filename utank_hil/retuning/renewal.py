"""Estimate of waves and ship from a record of the motion, and a constrained law for them."""

import dataclasses
import math
from dataclasses import dataclass
from typing import Final

import numpy as np

from utank_hil.analysis.loop.sea_response import at_work, moment_of
from utank_hil.analysis.loop.self_tuning import CLIPPED_PEAK, self_tuned
from utank_hil.base.arrays import FloatArray
from utank_hil.canbus import Verdict
from utank_hil.control import DesignPlant
from utank_hil.identification.motion_fit import KNOWN_SPREAD, SPREAD, MotionFit, fit_motion
from utank_hil.retuning.answer import Refusal, RenewedLaw
from utank_hil.retuning.estimate import EstimateRequest, MotionEstimate, ShipFigures
from utank_hil.retuning.estimator import SEA_PERIODS, SHIP_PERIODS
from utank_hil.sea import SlopeSpectrum

TAIL_SHARE: Final = 0.15
"""Share of the bands, at the upper end, from which the tail is computed. Chosen; no study."""
ROLL_PART: Final = 1.0  #: Largest predicted roll, relative to the passive tank's.


@dataclass(frozen=True, slots=True)
class RenewalTask:
    """Inputs of the retuner besides the estimate."""

    plant: DesignPlant  #: The configured ship and tank.
    sample_time_s: float  #: Sample time of the present and of the new law.
    mean_power_w: float = math.inf  #: Budget of the predicted power.


class TailedSpectrum:
    """A slope spectrum with the tail of wind waves above its last band.

    The elevation's density falls with the fifth power of the frequency there (Phillips), so the
    slope's with the first.
    """

    def __init__(self, waves: SlopeSpectrum) -> None:
        self._waves = waves
        count = max(1, round(TAIL_SHARE * len(waves.omega_rad_s)))
        self._top_rad_s = float(waves.omega_rad_s[-1])
        self._level = float(np.mean((waves.omega_rad_s * waves.density)[-count:]))

    def slope_density(self, omega_rad_s: FloatArray) -> FloatArray:
        """One-sided density of the effective wave slope, rad^2 per rad/s."""
        inside = self._waves.slope_density(omega_rad_s)
        return np.where(omega_rad_s > self._top_rad_s, self._level / omega_rad_s, inside)


def renew(estimate: MotionEstimate, task: RenewalTask) -> RenewedLaw | Refusal:
    """Design a law for the estimated waves and ship; a configured ship may be loaded otherwise."""
    if estimate.waves is None or estimate.ship is None:
        return Refusal(("there is no estimate of the waves to design a law for",))
    plant = dataclasses.replace(task.plant, ship=estimate.ship.ship(task.plant.ship))
    sea = TailedSpectrum(estimate.waves)
    try:
        tuned = self_tuned(
            at_work(plant, moment_of(sea, plant.ship)),
            sea,
            mean_power_w=task.mean_power_w,
            sample_time_s=task.sample_time_s,
            loads_peak=CLIPPED_PEAK if estimate.ship == ShipFigures.of(task.plant.ship) else None,
        )
    except ValueError as error:  # NoLawError and LinAlgError are ValueErrors.
        return Refusal((str(error),))
    predicted = tuned.prediction
    if not predicted.roll_rad <= ROLL_PART * tuned.passive_roll_rad:
        return Refusal(
            (
                f"the law is predicted to roll {math.degrees(predicted.roll_rad):.2f} degrees RMS, "
                f"the passive tank {math.degrees(tuned.passive_roll_rad):.2f}",
            )
        )
    return RenewedLaw(tuned.law, predicted.roll_rad, predicted.pressure_pa, tuned.passive_roll_rad)


MOST_MISSING: Final = 0.05  #: Largest share of missing samples; gaps are interpolated.
LEAST_CLEAR: Final = 0.8
"""Smallest share of the wave moment's energy in bands above the sensors' noise."""
STIFFNESS_DEVIATION: Final = 0.03
PERIOD_DEVIATION: Final = 0.05
"""Largest relative deviations of an identified ship. With less information, waves are taken for
the ship, at deviations of 0.036 and more (docs/retuning.md).
"""
FARTHEST: Final = 1.45
"""Largest ratio of the roll period found to the configured ship's, or its inverse. Loading changes
it by some 30 %; with little pump work, a peak of the waves looks like a ship further away. So does
the end of the waves' spectrum in following seas, to which stiffness and inertia may bend together:
nothing is identified with an inertia that the prior excludes (`SAME`).
"""
SEA_DEVIATION: Final = 0.2
"""Largest relative deviation of the moment's root mean square for a sea that counts as known."""
SHORT_DEVIATION: Final = 0.5
"""Least relative deviation of that from a record too short for a ship: its bands are wide, and the
moment in swell of 18 s came out 45 % too great after 15 rolls, 27 % after 22 (docs/retuning.md)."""
CONTRADICTED: Final = 20.0
"""Log-likelihood ratio from which another ship contradicts the known one."""
LONGEST_S: Final = 25.0
"""Longest period of ocean swell (WMO-No. 702). A moment of longer encounter is that of waves which
a ship under way overtakes or runs with: their height does not follow from it."""
MOST_LONGER: Final = 0.1
"""Share of longer waves in the energy of the beam waves up to which there are a height and a peak.
Chosen; no study."""
SAME: Final = 3.0
"""Standard deviations within which the ships of the last half and the whole record agree, and an
inertia with its prior."""


@dataclass(frozen=True, slots=True)
class EstimateTask:
    """Constant inputs of the estimator."""

    plant: DesignPlant  #: The configured ship and tank.
    sample_time_s: float
    effective_slope: float  #: Ratio of effective to true wave slope, for the wave height.


def estimate(request: EstimateRequest, task: EstimateTask) -> MotionEstimate:
    """Estimate waves and ship from a record.

    The ship is fitted to the whole record and to its last half. If they contradict each other, the
    loading changed meanwhile and the half counts. If the motion does not identify the ship, or the
    record is too short for that, the waves are based on the known one, and uncertain if another
    ship explains the motion far better.
    """
    period = 2 * np.pi / task.plant.ship.natural_frequency_rad_s / task.sample_time_s
    of_a_ship = round(SHIP_PERIODS * period)
    motion = _without_gaps(request.record)
    if motion is None or len(motion) < round(SEA_PERIODS * period):
        return MotionEstimate(Verdict.RECORD_SHORT, Verdict.RECORD_SHORT)
    if not np.ptp(motion, axis=0).all():
        return MotionEstimate(Verdict.MOTION_SMALL, Verdict.MOTION_SMALL)
    fit = fit_motion(motion, task.plant, task.sample_time_s)
    half = motion[len(motion) // 2 :]
    if len(half) >= of_a_ship:
        late = fit_motion(half, task.plant, task.sample_time_s)
        if _identified(late, task) and (_apart(late, fit) or not _identified(fit, task)):
            fit, motion = late, half
    short = len(motion) < of_a_ship
    of_ship = Verdict.GOOD if _identified(fit, task) else Verdict.UNCERTAIN
    of_ship = Verdict.RECORD_SHORT if short else of_ship
    contradicted = False
    if of_ship is not Verdict.GOOD:
        likeliest = fit.log_likelihood
        plant = dataclasses.replace(task.plant, ship=request.ship.ship(task.plant.ship))
        fit = fit_motion(motion, plant, task.sample_time_s, KNOWN_SPREAD)
        contradicted = likeliest - fit.log_likelihood > CONTRADICTED
    if fit.clear < LEAST_CLEAR:
        return MotionEstimate(Verdict.MOTION_SMALL, Verdict.MOTION_SMALL)
    ship, waves = fit.ship, fit.waves
    elevation = waves.elevation_density(task.effective_slope)
    longer = float(elevation[waves.omega_rad_s < 2 * np.pi / LONGEST_S].sum())
    beam = longer <= MOST_LONGER * float(elevation.sum())
    rms_deviation = max(fit.rms_deviation, SHORT_DEVIATION if short else 0.0)
    sea_known = rms_deviation <= SEA_DEVIATION and not contradicted
    return MotionEstimate(
        Verdict.GOOD if sea_known else Verdict.UNCERTAIN,
        of_ship,
        ShipFigures(
            ship.stiffness_nm_rad,
            ship.inertia_kg_m2,
            ship.damping_nms_rad,
            float(fit.deviation[0]),
            fit.period_deviation,
        ),
        waves,
        rms_deviation,
        waves.hs_m(task.effective_slope) if beam else math.nan,
        2 * np.pi / float(waves.omega_rad_s[np.argmax(elevation)]) if beam else math.nan,
        len(motion) * task.sample_time_s,
    )


def _identified(fit: MotionFit, task: EstimateTask) -> bool:
    found, given = fit.ship, task.plant.ship
    factor = found.natural_frequency_rad_s / given.natural_frequency_rad_s
    return bool(
        fit.deviation[0] <= STIFFNESS_DEVIATION
        and fit.period_deviation <= PERIOD_DEVIATION
        and abs(np.log(factor)) <= np.log(FARTHEST)
        and abs(np.log(found.inertia_kg_m2 / given.inertia_kg_m2)) <= SAME * SPREAD[1]
    )


def _apart(late: MotionFit, whole: MotionFit) -> bool:
    """Whether two fits are of different ships, by stiffness or by period."""
    ratio = late.ship.stiffness_nm_rad / whole.ship.stiffness_nm_rad
    by_stiffness = abs(np.log(ratio)) / np.hypot(late.deviation[0], whole.deviation[0])
    ratio = late.ship.natural_frequency_rad_s / whole.ship.natural_frequency_rad_s
    by_period = abs(np.log(ratio)) / np.hypot(late.period_deviation, whole.period_deviation)
    return bool(max(by_stiffness, by_period) > SAME)


def _without_gaps(motion: FloatArray) -> FloatArray | None:
    """Return the record from its first sample on, interpolated; None with too many gaps."""
    here = np.asarray(np.isfinite(motion).all(axis=1))
    if not here.any():
        return None
    motion, here = motion[np.argmax(here) :], here[np.argmax(here) :]
    if np.mean(~here) > MOST_MISSING:
        return None
    index = np.arange(len(motion))
    return np.column_stack([np.interp(index, index[here], each[here]) for each in motion.T])
