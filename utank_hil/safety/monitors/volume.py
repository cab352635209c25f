"""Volume of the water: port and starboard levels mirror one another, so their sum stays zero."""

import math
from typing import Final

from utank_hil.safety.monitors.finding import Finding
from utank_hil.safety.monitors.noise import Noise
from utank_hil.safety.monitors.thresholds import MonitorThresholds

SMOOTH_S: Final = 2.0
LASTS_S: Final = 30.0
LARGE: Final = 3.0
"""So many times the threshold: no longer a drift to live with."""

_VOLUME: Final = int(Finding.VOLUME)
_VOLUME_LASTS: Final = int(Finding.VOLUME_LASTS)
_NOISE: Final = int(Finding.NOISE)


class Volume:
    """Sum of both levels, smoothed over two seconds, and the gauges' noise in it.

    Attributes
    ----------
    sum_m : float
        Smoothed sum.
    """

    def __init__(self, thresholds: MonitorThresholds) -> None:
        self._limit_m = thresholds.volume_m
        self._noise = Noise(thresholds.level_noise_m)
        self._over_s = 0.0
        self.sum_m = math.nan

    def update(self, port_m: float, starboard_m: float, elapsed_s: float) -> int:
        """Take both levels; return what was found."""
        if self.sum_m != self.sum_m:  # the first sample
            self.sum_m = port_m + starboard_m
        beside_m = port_m + starboard_m - self.sum_m
        self.sum_m += beside_m * (elapsed_s / SMOOTH_S)
        found = _NOISE if self._noise.update(beside_m, elapsed_s) else 0
        over = abs(self.sum_m)
        if over <= self._limit_m:
            self._over_s = 0.0
            return found
        self._over_s += elapsed_s
        if self._over_s > LASTS_S or over > LARGE * self._limit_m:
            found |= _VOLUME_LASTS
        return found | _VOLUME
