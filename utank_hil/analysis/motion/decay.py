"""Roll decay test: period and damping of a free decay, by a fit of the equation of roll.

The record y is met in least squares, at its own samples, by::

    phi'' + 2 zeta w0 phi' + b2 |phi'| phi' + w0^2 (phi + k3 phi^3) = 0,    y = phi + heel + drift t

The fit of the whole motion weighs all samples alike, follows a period that changes with amplitude,
and finds the heel, which peaks counted from zero take for damping: 1 degree of heel multiplies it
by 4.6 in a model test that starts at 9 degrees. The ratio that takes the same energy in a swing of
amplitude a is ``zeta + 4 / (3 pi) b2 a``.

Residuals are correlated over a swing, so intervals come from sums over blocks of two swings.
"""

import math
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Final

import numpy as np
from scipy.optimize import least_squares
from scipy.stats import t as student

from utank_hil.base.arrays import FloatArray

Interval = tuple[float, float]
_LEAST_SWINGS: Final = 2.0
_BLOCK: Final = 4  #: Half swings in a block.
_LEAST_SAMPLES: Final = 20.0
"""Samples a swing with which a model test gives the same damping as with fifty."""
_MOST_RESIDUAL: Final = 0.1
"""Residual RMS per greatest amplitude: 0.002 to 0.008 in good records, 0.04 with swell, 0.25 in
waves."""
_UNUSUAL_RESIDUAL: Final = 0.02
_UNUSUAL_HEEL: Final = 0.25
"""Heel per greatest amplitude from which the restoring of the two sides differs."""
SHORTEST_S: Final = 0.2  #: Natural period of the smallest models; chosen.
LONGEST_S: Final = 60.0  #: Natural period beyond any ship's; chosen.
_NO_DECAY: Final = "the roll of this record does not decay: is it a free decay alone?"
_EQUAL_WORK: Final = 4 / (3 * math.pi)  #: Of quadratic damping in the linear one of equal work.


@dataclass(frozen=True, slots=True, eq=False)
class RollDecay:
    """Result of a decay test; intervals are those of 95 %."""

    period_s: float  #: Natural period of small roll, 2 pi / w0.
    damping_ratio: float  #: zeta.
    quadratic_per_rad: float  #: b2: quadratic damping per roll inertia.
    heel_rad: float  #: Of the line about which the ship rolls.
    #: Scatter of this record alone, as of the next two: not the error of the law of two terms.
    period_interval_s: Interval
    ratio_interval: Interval
    quadratic_interval_per_rad: Interval
    #: shape (3,): Least, middle and greatest amplitude; outside of these the answer does not hold.
    amplitude_rad: FloatArray
    equivalent_ratio: FloatArray  #: shape (3,): Damping ratio of equal work at these amplitudes.
    equivalent_interval: FloatArray  #: shape (3, 2): Interval of these.
    #: Equivalent ratio at the middle amplitude by each half of the record alone.
    halves_ratio: Interval | None
    residual_share: float  #: RMS of what the fit leaves, per greatest amplitude.
    time_s: FloatArray  #: shape (n,): Samples used, and the fit.
    roll_rad: FloatArray  #: shape (n,): Samples used.
    fit_rad: FloatArray  #: shape (n,)

    @property
    def warnings(self) -> tuple[str, ...]:
        """What is unusual in the record."""
        found = []
        if abs(self.heel_rad) > _UNUSUAL_HEEL * self.amplitude_rad[2]:
            heel = f"{math.degrees(self.heel_rad):.2g} degrees"
            found.append(f"the ship rolls about a heel of {heel}: bring it upright")
        if self.residual_share > _UNUSUAL_RESIDUAL:
            share = f"{self.residual_share:.1%} of the greatest amplitude"
            found.append(f"the fit leaves {share}, good tests 0.2 to 0.8 %: swell, or a tank?")
        if self.damping_ratio < 0:
            found.append("the linear part is negative: the law of two terms does not hold here")
        if (self.time_s[-1] - self.time_s[0]) / self.period_s < 2 * _LEAST_SWINGS:
            found.append("fewer than eight half swings: use more of the record")
        return tuple(found)


def roll_decay(time_s: FloatArray, roll_rad: FloatArray) -> RollDecay:
    """Evaluate a decay test.

    The record, shape (n,), is that of the free decay alone, without pull, release and end of the
    run. Times rise, even or not; samples that are not finite are left out. ValueError is raised if
    the record is too short or too sparse, heeled beyond its roll, driven or growing.
    """
    known = np.isfinite(time_s) & np.isfinite(roll_rad)
    time, roll = time_s[known], roll_rad[known]
    if len(roll) and np.ptp(roll) > math.pi:
        raise ValueError(f"the roll swings by {np.ptp(roll):.3g} rad: name degrees roll_deg")
    if len(time) < 3 * _LEAST_SAMPLES or np.any(np.diff(time) <= 0):
        raise ValueError("a decay test needs some swings of at least 20 samples, and rising times")
    start = _start(time, roll)
    found = _fit(time, roll, start)
    if not SHORTEST_S < found.period_s < LONGEST_S:
        raise ValueError(
            f"the ship rolls in {found.period_s:.3g} s: the times must be in seconds, and a swing "
            "needs 20 samples"
        )
    swings = (time[-1] - time[0]) / found.period_s
    if swings >= 4 * _LEAST_SWINGS:
        middle = time[0] + found.period_s * round(swings / 2)
        begins = (time <= middle, time >= middle)
        try:
            halves = [
                _fit(time[part], roll[part], _start(time[part], roll[part])) for part in begins
            ]
        except ValueError:
            return found
        work = _EQUAL_WORK * found.amplitude_rad[1]
        one, two = (each.damping_ratio + work * each.quadratic_per_rad for each in halves)
        return replace(found, halves_ratio=(float(one), float(two)))
    return found


def _start(time: FloatArray, roll: FloatArray) -> FloatArray:
    """Return w0, zeta, b2, k3, heel, drift and first roll and rate, by zero crossings and peaks."""
    heel = float(np.mean(roll))
    for _ in range(3):
        side = np.sign(roll - heel)
        side[side == 0] = 1
        cross = np.flatnonzero(np.diff(side))
        swings = [slice(a + 1, b + 1) for a, b in pairwise(cross)]
        # noise makes more crossings: a half swing is not much shorter than the others
        usual = np.median([time[each.stop - 1] - time[each.start] for each in swings] or [0.0])
        swings = [each for each in swings if time[each.stop - 1] - time[each.start] > 0.5 * usual]
        if len(swings) < 2 * _LEAST_SWINGS - 1:
            raise ValueError(
                f"a decay test needs two swings or more about one line, has {len(swings)} whole "
                "half swings: too short, or heeled beyond its roll"
            )
        peak = np.array([roll[each][np.argmax(np.abs(roll[each] - heel))] for each in swings])
        heel = float(np.mean((peak[:-1] + peak[1:]) / 2))
    middle = np.array([(time[each.start - 1] + time[each.stop - 1]) / 2 for each in swings])
    frequency = math.pi / float(np.median(np.diff(middle)))
    samples = 2 * math.pi / frequency / float(np.median(np.diff(time)))
    if samples < _LEAST_SAMPLES:
        raise ValueError(f"a decay test needs 20 samples a swing, has {samples:.0f}: sample faster")
    size = np.maximum(np.abs(peak - heel), 1e-9)
    fall = -np.polyfit(middle, np.log(size), 1)[0]
    few = slice(0, max(4, int(samples / 8)))
    rate = float(np.polyfit(time[few], roll[few], 1)[0])
    return np.array([frequency, fall / frequency, 0.0, 0.0, heel, 0.0, roll[0] - heel, rate])


def _motion(time: FloatArray, p: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the roll at the samples and its derivatives by the parameters, shape (n, 8)."""
    from utank_hil.analysis.motion.decay_kernel import decay_motion  # This imports the compiler.

    run = decay_motion(time, p[[0, 1, 2, 3, 6, 7]])
    if not np.all(np.isfinite(run)):
        raise ValueError(_NO_DECAY)
    since = time - time[0]
    by = np.column_stack([run[:, 2:6], np.ones_like(time), since, run[:, 6:8]])
    return run[:, 0] + p[4] + p[5] * since, by


def _parameters(time: FloatArray, roll: FloatArray, start: FloatArray) -> FloatArray:
    """Return the parameters that meet all samples best, in the order of `_start`."""
    size = float(np.max(np.abs(roll - start[4])))
    scale = np.array([start[0], 0.01, 0.1, 1.0, size, size / (time[-1] - time[0]), size, size])
    bounds = (
        [0.5 * start[0], -0.5, -20, -20, -np.inf, -np.inf, -np.inf, -np.inf],
        [2 * start[0], 2, 20, 20, np.inf, np.inf, np.inf, np.inf],
    )
    found = least_squares(
        lambda p: _motion(time, p)[0] - roll,
        start,
        lambda p: _motion(time, p)[1],
        bounds,
        x_scale=scale,
        max_nfev=50,  # good records take about ten
    )
    return np.asarray(found.x)


def _half_swings(time: FloatArray, period: float) -> FloatArray:
    """Return the number of the half swing of each sample; ValueError if they are too few."""
    since = time - time[0]
    parts = int(since[-1] / (0.5 * period))
    if parts <= _BLOCK:
        raise ValueError(
            f"a decay test needs {(_BLOCK + 1) / 2} swings, whose scatter gives the intervals, has "
            f"{since[-1] / period:.1f}: use more of the record"
        )
    return np.asarray(np.minimum(np.floor(since / (0.5 * period)), parts - 1))


def _fit(time: FloatArray, roll: FloatArray, start: FloatArray) -> RollDecay:
    """Fit all parameters to all samples."""
    p = _parameters(time, roll, start)
    fit, by = _motion(time, p)
    rest = roll - fit
    swing = np.abs(fit - p[4] - p[5] * (time - time[0]))
    period = 2 * math.pi / p[0]
    half_swing = _half_swings(time, period)
    peaks = np.array([np.max(swing[half_swing == n]) for n in np.unique(half_swing)])
    share = float(np.sqrt(np.mean(rest**2)) / np.max(peaks))
    if share > _MOST_RESIDUAL:
        raise ValueError(
            f"the fit of a free decay leaves {share:.0%} of the greatest amplitude: waves, a pull "
            "or rest are in the record: leave them out"
        )
    amplitude = np.array([np.min(peaks), 0.0, np.max(peaks)])
    amplitude[1] = (amplitude[0] + amplitude[2]) / 2
    equivalent = p[1] + _EQUAL_WORK * p[2] * amplitude
    deviation = _deviation(by, rest, half_swing // _BLOCK)

    def interval(value: float, gradient: FloatArray) -> Interval:
        half = float(np.linalg.norm(deviation @ gradient))
        return float(value) - half, float(value) + half

    unit = np.eye(8)
    intervals = np.array(
        [
            interval(ratio, unit[1] + _EQUAL_WORK * a * unit[2])
            for ratio, a in zip(equivalent, amplitude, strict=True)
        ]
    )
    if intervals[1, 0] <= 0:
        raise ValueError(_NO_DECAY)
    if abs(p[4]) > amplitude[2]:
        raise ValueError(
            f"the ship rolls about a heel of {math.degrees(p[4]):.2g} degrees, by up to "
            f"{math.degrees(amplitude[2]):.2g}: bring it upright, or take the sensor's offset off"
        )
    slow = interval(p[0], unit[0])
    return RollDecay(
        period_s=period,
        damping_ratio=float(p[1]),
        quadratic_per_rad=float(p[2]),
        heel_rad=float(p[4]),
        period_interval_s=(2 * math.pi / slow[1], 2 * math.pi / slow[0]),
        ratio_interval=interval(p[1], unit[1]),
        quadratic_interval_per_rad=interval(p[2], unit[2]),
        amplitude_rad=amplitude,
        equivalent_ratio=equivalent,
        equivalent_interval=intervals,
        halves_ratio=None,
        residual_share=share,
        time_s=time,
        roll_rad=roll,
        fit_rad=fit,
    )


def _deviation(by: FloatArray, rest: FloatArray, block: FloatArray) -> FloatArray:
    """Return 95 % deviations of the parameters, a row a block, by their scores' sums."""
    size = np.linalg.norm(by, axis=0)
    unit = by / size
    inverse = np.linalg.pinv(unit.T @ unit)
    names = np.unique(block)
    scores = np.array([unit[block == n].T @ rest[block == n] for n in names])
    count = len(names)
    factor = float(student.ppf(0.975, max(1, count - 1))) * math.sqrt(count / max(1, count - 1))
    return np.asarray(factor * (scores @ inverse) / size)
