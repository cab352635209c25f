"""Inclining test: metacentric height from heeling moments and angles.

A straight line through all shifts of weight to both sides, ``tan(heel) = list + moment / (W GM)``.
Its offset is the list, its scatter gives the interval. GM is that of the ship as it lay, every
slack surface on board included.
"""

import math
from typing import NamedTuple

import numpy as np
from scipy.stats import linregress
from scipy.stats import t as student

from utank_hil.base.arrays import FloatArray

_LEAST_SHIFTS = 5  #: Rows that a residual can be judged by; chosen.
LEAST_GM_M = 0.01  #: Of the smallest models; chosen.
MOST_GM_M = 100.0  #: Beyond that of the widest barges; chosen.
_MOST_HEEL_RAD = math.radians(6)  # Tests heel 1 to 4 degrees: beyond, GZ is no straight line.


class Inclining(NamedTuple):
    """Metacentric height in m, its interval of 95 %, and the list in rad."""

    gm_m: float
    interval_m: tuple[float, float]
    list_rad: float


def inclining(moment_nm: FloatArray, heel_rad: FloatArray, displacement_n: float) -> Inclining:
    """Evaluate an inclining test.

    Heeling moment of each position of the weights (weight times lever) and heel, shape (n,), are
    both positive to the same side; `displacement_n` is the weight of the ship. ValueError is raised
    if there are fewer than five shifts, all to one side, too great a heel, or no stability.
    """
    if len(moment_nm) < _LEAST_SHIFTS or moment_nm.max() * moment_nm.min() >= 0:
        raise ValueError("an inclining test needs five shifts or more, to both sides")
    if np.max(np.abs(heel_rad - np.mean(heel_rad))) > _MOST_HEEL_RAD:
        raise ValueError("an inclining test heels up to 4 degrees: lighter weights")
    line = linregress(moment_nm, np.tan(heel_rad))
    rise = float(line.slope)
    half = float(student.ppf(0.975, len(moment_nm) - 2) * line.stderr)
    if rise - half <= 0:
        raise ValueError("the heel does not follow the moment: check the signs of both")
    gm_m = 1 / (displacement_n * rise)
    if not LEAST_GM_M < gm_m < MOST_GM_M:
        raise ValueError(
            f"its GM would be {gm_m:.2g} m: moments are in N m, heel in the column's unit, and the "
            f"displacement is {displacement_n / 9.80665e3:.4g} t"
        )
    low, high = (1 / (displacement_n * (rise + sign * half)) for sign in (1, -1))
    return Inclining(gm_m, (low, high), math.atan(line.intercept))
