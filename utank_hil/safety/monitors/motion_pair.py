"""Whether two motion sensors agree, by the low-passed differences of roll and rate.

Two can't tell which of them is wrong, and a ship that rolls by a wrong sensor is worse off than a
passive one: where they disagree the pressure falls to zero. While one is silent the other is used,
and nothing is compared.
"""

import math
from typing import Final

from utank_hil.safety.monitors.finding import Finding
from utank_hil.safety.monitors.thresholds import NOISE_LIMIT, MonitorThresholds

MOUNTED_RAD: Final = math.radians(0.5)
"""So far two sensors may be mounted apart."""
NOISES: Final = 3.0
SMOOTH_S: Final = 0.25
APART_S: Final = 0.3
"""A spike is gone by then; a wrong sign passes through zero for a shorter time with each roll."""

_DISAGREE: Final = int(Finding.SENSORS_DISAGREE)


class MotionPair:
    """The comparison of two motion sensors.

    Parameters
    ----------
    thresholds : MonitorThresholds
    period_s : float
        Time between two updates.
    """

    def __init__(self, thresholds: MonitorThresholds, period_s: float) -> None:
        fastest_rad_s = 2 * 2 * math.pi / thresholds.tank_period_s
        noises = NOISES / NOISE_LIMIT
        self._roll_limit_rad = MOUNTED_RAD + noises * thresholds.roll_noise_rad
        self._rate_limit_rad_s = fastest_rad_s * MOUNTED_RAD + noises * thresholds.rate_noise_rad_s
        self._period_s = period_s
        self._share = period_s / SMOOTH_S
        self._roll_rad = self._rate_rad_s = self._over_s = 0.0

    def update(self, apart_rad: float, rate_apart_rad_s: float) -> int:
        """Take roll and rate of one less those of the other, NaN where one is silent."""
        if apart_rad != apart_rad:
            self._over_s = 0.0
            return 0
        self._roll_rad += self._share * (apart_rad - self._roll_rad)
        self._rate_rad_s += self._share * (rate_apart_rad_s - self._rate_rad_s)
        over = (
            abs(self._roll_rad) > self._roll_limit_rad
            or abs(self._rate_rad_s) > self._rate_limit_rad_s
        )
        self._over_s = self._over_s + self._period_s if over else 0.0
        return _DISAGREE if self._over_s >= APART_S else 0
