"""Statistics of a run: roll and pump."""

import math
from collections.abc import Hashable, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from utank_hil.base.arrays import FloatArray


@dataclass(frozen=True, slots=True)
class RollStatistics:
    """Statistics of a roll record."""

    rms_rad: float  #: Root mean square of the roll angle.
    significant_rad: float | None  #: Significant single amplitude, see `significant_amplitude`.
    maximum_rad: float  #: Largest roll to either side.


def significant_amplitude(signal: FloatArray) -> float | None:
    """Mean of the highest third of the single amplitudes between zero up-crossings.

    For a narrow-banded Gaussian signal this is close to twice the standard deviation. `signal`,
    shape (n,), is uniformly sampled; its mean is subtracted. None if it has no complete cycle.
    """
    centred = signal - signal.mean()
    starts = np.flatnonzero((centred[:-1] < 0) & (centred[1:] >= 0)) + 1
    if len(starts) < 2:
        return None
    whole = centred[: starts[-1]]
    heights = np.maximum.reduceat(whole, starts[:-1]) - np.minimum.reduceat(whole, starts[:-1])
    highest = np.sort(heights)[-max(1, len(heights) // 3) :]
    return float(highest.mean() / 2)


def roll_statistics(roll_rad: FloatArray) -> RollStatistics:
    """Statistics of a roll record, shape (n,); `ValueError` if it is empty."""
    if roll_rad.size == 0:
        raise ValueError("roll record is empty: run longer than the time left out at its start")
    return RollStatistics(
        rms_rad=float(np.sqrt(np.mean(np.square(roll_rad)))),
        significant_rad=significant_amplitude(roll_rad),
        maximum_rad=float(np.max(np.abs(roll_rad))),
    )


@dataclass(frozen=True, slots=True)
class PumpStatistics:
    """Statistics of the pump."""

    #: pressure_rms_pa, pressure_peak_pa: RMS and peak of the differential pressure across the pump.
    pressure_rms_pa: float
    pressure_peak_pa: float
    #: power_mean_w, power_peak_w: mean and peak of the shaft power drawn; regenerated power counts
    #: as zero.
    power_mean_w: float
    power_peak_w: float
    level_peak_m: float  #: Largest deviation of a reservoir's level from still water.


def pump_statistics(
    pressure_pa: FloatArray, power_w: FloatArray, level_m: FloatArray
) -> PumpStatistics:
    """Statistics of the pump's records, each of shape (n,)."""
    drawn = np.maximum(power_w, 0.0)
    return PumpStatistics(
        pressure_rms_pa=float(np.sqrt(np.mean(np.square(pressure_pa)))),
        pressure_peak_pa=float(np.max(np.abs(pressure_pa))),
        power_mean_w=float(drawn.mean()),
        power_peak_w=float(drawn.max()),
        level_peak_m=float(np.max(np.abs(level_m))),
    )


def exceedance(signal: FloatArray, levels: FloatArray) -> FloatArray:
    """Share of single amplitudes of a record above each level, shape (k,).

    A single amplitude is the largest deviation from the mean between two crossings of it, to either
    side. The parts before the first crossing and after the last are left out. Raises `ValueError`
    if the record crosses its mean less than twice.
    """
    centred = signal - signal.mean()
    crossings = np.flatnonzero(np.diff(np.signbit(centred))) + 1
    if len(crossings) < 2:
        raise ValueError("the record holds no whole half-cycle: exceedance needs a longer one")
    size = np.abs(centred[: crossings[-1]])
    amplitudes = np.maximum.reduceat(size, crossings[:-1])
    share: FloatArray = np.mean(amplitudes[:, None] > np.asarray(levels), axis=0)
    return share


class Interval(NamedTuple):
    """Confidence interval of a mean: mean - half_width ... mean + half_width."""

    mean: float
    half_width: float


def mean_interval(values: npt.ArrayLike) -> Interval:
    """Mean of independent normal values, (n,), with its 95 % interval (t); two or more."""
    return clustered_interval(values, range(np.size(values)))


def clustered_interval(values: npt.ArrayLike, units: Sequence[Hashable]) -> Interval:
    """Mean of values that depend on one another within a unit, with its interval of 95 %.

    `values` and `units` have shape (n,); values of different units are independent. The variance of
    the mean is that of the sums over units, G / (G - 1) sum(sum(x - mean)^2) / n^2 for G units, the
    quantile Student's of G - 1 degrees of freedom (Cameron & Miller, A practitioner's guide to
    cluster-robust inference, J. Human Resources 50 (2015)). Each value as a unit of its own gives
    `mean_interval`. Raises `ValueError` for fewer than two units.
    """
    from scipy.stats import t as student

    numbers = np.asarray(values, dtype=np.float64)
    place = {unit: number for number, unit in enumerate(dict.fromkeys(units))}
    count = len(place)
    if count < 2:
        raise ValueError(f"a confidence interval needs two or more values, got {count}")
    mean = float(numbers.mean())
    sums = np.bincount([place[unit] for unit in units], numbers - mean)
    error = math.sqrt(count / (count - 1) * float(sums @ sums)) / len(numbers)
    return Interval(mean, float(student.ppf(0.975, count - 1)) * error)


def batch_means(values: FloatArray, batches: int) -> FloatArray:
    """Means of equal parts of a record, shape (batches,); a remainder at its end is left out.

    The samples of a record are correlated. Means over batches that are long against the correlation
    time are hardly correlated, so their Student's t gives the interval of the record's mean (A. M.
    Law, Simulation Modeling and Analysis, 5th ed., section 9.5.3).

    Raises `ValueError` if the record has fewer values than batches.
    """
    length = len(values) // batches
    if length < 1:
        raise ValueError(f"{len(values)} values make no {batches} batches")
    means: FloatArray = values[: batches * length].reshape(batches, length).mean(axis=1)
    return means


def rms_batches(values: FloatArray, batches: int) -> FloatArray:
    """Express the RMS of a record as the mean of one value for each batch, shape (batches,).

    The values are linear about the mean square (the delta method), so the differences of such
    values of two records in the same waves have the interval of the difference of their RMS.
    """
    squares = batch_means(np.square(values), batches)
    rms = math.sqrt(float(squares.mean()))
    return rms + (squares - rms**2) / (2.0 * rms) if rms > 0 else np.zeros(batches)
