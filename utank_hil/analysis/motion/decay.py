"""Roll decay test: period and damping from the peaks of a free decay.

Froude's method. Over half a period with mean amplitude a the amplitude falls by::

    fall = pi zeta a + (4/3) (b2 / I) a^2

with the linear damping ratio zeta and the quadratic damping per inertia b2 / I. A straight line
fitted to fall / a over a gives both.
"""

import math
from typing import NamedTuple

import numpy as np

from utank_hil.base.arrays import FloatArray


class RollDecay(NamedTuple):
    """Result of a decay test."""

    period_s: float  #: Mean period over the peaks.
    damping_ratio: float  #: Linear damping ratio.
    quadratic_per_rad: float  #: Quadratic damping over inertia, b2 / I, in 1 / rad.
    #: peak_s, peak_rad: shape (n,): times and amplitudes of the peaks, alternately port and
    #: starboard.
    peak_s: FloatArray
    peak_rad: FloatArray


def roll_decay(time_s: FloatArray, roll_rad: FloatArray, *, least_rad: float = 0.0) -> RollDecay:
    """Evaluate a decay test.

    Parameters
    ----------
    time_s, roll_rad : ndarray, shape (n,)
        Uniformly sampled, twenty samples per period or more.
    least_rad : float
        Peaks of smaller amplitude are left out.

    Raises
    ------
    ValueError
        If fewer than four peaks remain.
    """
    before, here, after = roll_rad[:-2], roll_rad[1:-1], roll_rad[2:]
    size = np.abs(here)
    top = np.flatnonzero((here * before > 0) & (size >= np.abs(before)) & (size > np.abs(after)))
    # parabola through three samples
    bend = before[top] - 2 * here[top] + after[top]
    shift = 0.5 * (before[top] - after[top]) / bend
    peak = np.abs(here[top] - 0.25 * (before[top] - after[top]) * shift)
    when = time_s[top + 1] + shift * (time_s[1] - time_s[0])
    keep = peak >= least_rad
    peak, when = peak[keep], when[keep]
    if len(peak) < 4:
        raise ValueError(f"a decay test needs at least four peaks, found {len(peak)}")
    mean, fall = (peak[:-1] + peak[1:]) / 2, peak[:-1] - peak[1:]
    slope, start = np.polyfit(mean, fall / mean, 1)
    return RollDecay(
        period_s=float(2 * np.mean(np.diff(when))),
        damping_ratio=float(start / math.pi),
        quadratic_per_rad=float(slope * 3 / 4),
        peak_s=when,
        peak_rad=peak,
    )
