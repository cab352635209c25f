"""All that is judged of one motion sensor by itself, and whether two of them agree."""

import math
from typing import Final

from utank_hil.base.tick import TICK_S
from utank_hil.canbus.measurements import MotionSample
from utank_hil.safety.monitors.finding import Finding
from utank_hil.safety.monitors.motion import RollAgainstRate
from utank_hil.safety.monitors.noise import Noise, SecondDifference
from utank_hil.safety.monitors.thresholds import NOISE_LIMIT, MonitorThresholds

MOUNTED_RAD: Final = math.radians(0.5)
"""So far two sensors may be mounted apart."""
NOISES: Final = 3.0
SMOOTH_S: Final = 0.25
APART_S: Final = 0.3
"""A spike is gone by then; a wrong sign passes through zero for a shorter time with each roll."""

_DISAGREE: Final = int(Finding.SENSORS_DISAGREE)


class MotionPair:
    """Whether two motion sensors agree, by the low-passed differences of roll and rate.

    Two can't tell which of them is wrong, and a ship that rolls by a wrong sensor is worse off than
    a passive one: where they disagree the pressure falls to zero. While one is silent the other is
    used, and nothing is compared. `period_s` is the time between two updates.
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


class SpikeCount:
    """Leaky count of discarded samples: it falls by one each second; five in one are too many."""

    MOST: Final = 4.0

    def __init__(self) -> None:
        self._level = 0.0
        self._seen = 0
        self.found = False

    def update(self, discarded: int, elapsed_s: float) -> bool:
        """Take the number discarded so far; return whether there were too many."""
        new = discarded - self._seen
        self._seen = discarded
        # forgotten two seconds after the last
        self._level = min(max(self._level - elapsed_s, 0.0) + new, self.MOST + 2.0)
        self.found = self._level > self.MOST
        return self.found


SLOW_CYCLE_S: Final = 0.02
"""Of a slower sensor not every look finds a new sample, nor two looks the same number of them."""
_NOISE: Final = int(Finding.NOISE)
_SPIKES: Final = int(Finding.SPIKES)


class MotionWatch:
    """The monitors of one motion sensor, of which a sample comes every `cycle_s`."""

    def __init__(self, thresholds: MonitorThresholds, cycle_s: float = TICK_S) -> None:
        self._half_s = 0.5 * cycle_s
        self._slow = cycle_s > SLOW_CYCLE_S
        self._bent_ns = 0
        self.motion = RollAgainstRate(thresholds)
        self.rate_noise = Noise(math.sqrt(6) * thresholds.rate_noise_rad_s)
        self._rate_bend = SecondDifference()
        self._spikes = SpikeCount()
        self._last_rate_rad_s = 0.0
        self._heard_ns = 0
        self._waited_s = self._turned_rad = 0.0
        self.found = 0  #: Bits of `Finding`.

    def turn(self, sample: MotionSample, elapsed_s: float) -> None:
        """Integrate the rate up to the newest sample, once a tick.

        Each rate counts for the time from the sample before it: where some were lost, the roll is
        as old.
        """
        self._waited_s += elapsed_s
        if sample.heard_ns != self._heard_ns:
            self._heard_ns = sample.heard_ns
            self._turned_rad += sample.roll_rate_rad_s * self._waited_s
            self._waited_s = 0.0

    def update(self, sample: MotionSample, elapsed_s: float, *, stale: bool) -> None:
        """Take a sample, and set `found`; one that is `stale` begins anew."""
        rate_rad_s = sample.roll_rate_rad_s
        # half a cycle of the ends makes a trapezoid of the sum, where no sample was lost
        turned_rad = self._turned_rad - self._half_s * (rate_rad_s - self._last_rate_rad_s)
        self._turned_rad = 0.0
        self._last_rate_rad_s = rate_rad_s
        if stale:
            self.motion.restart()
            self._rate_bend.restart()
            self.found = 0
            return
        found = self._look(sample, turned_rad, elapsed_s)
        # the largest samples of noise are discarded, too
        if self._spikes.update(sample.discarded, elapsed_s) and not found & _NOISE:
            found |= _SPIKES
        self.found = found

    def _look(self, sample: MotionSample, turned_rad: float, elapsed_s: float) -> int:
        """Roll against rate, and the noise of both; of a slow sensor each sample counts once."""
        if not self._slow:
            found = self.motion.update(sample.roll_rad, turned_rad, elapsed_s)
            bend = self._rate_bend.update(sample.roll_rate_rad_s)
        else:
            since_s = (sample.heard_ns - self._bent_ns) * 1e-9
            if since_s <= 0:
                return self.found & ~_SPIKES
            self._bent_ns = sample.heard_ns
            elapsed_s = since_s
            found = self.motion.update(sample.roll_rad, turned_rad, since_s, even=False)
            bend = self._rate_bend.update_after(sample.roll_rate_rad_s, since_s)
        return found | _NOISE if self.rate_noise.update(bend, elapsed_s) else found
