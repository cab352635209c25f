"""All that is judged of one motion sensor by itself."""

import math
from typing import Final

from utank_hil.base.tick import TICK_S
from utank_hil.canbus.measurements import MotionSample
from utank_hil.safety.monitors.finding import Finding
from utank_hil.safety.monitors.motion import RollAgainstRate
from utank_hil.safety.monitors.noise import Noise, SecondDifference
from utank_hil.safety.monitors.spikes import SpikeCount
from utank_hil.safety.monitors.thresholds import MonitorThresholds

SLOW_CYCLE_S: Final = 0.02
"""Of a slower sensor not every look finds a new sample, nor two looks the same number of them."""
_NOISE: Final = int(Finding.NOISE)
_SPIKES: Final = int(Finding.SPIKES)


class MotionWatch:
    """The monitors of one motion sensor.

    Parameters
    ----------
    thresholds : MonitorThresholds
    cycle_s : float
        Time between two samples.

    Attributes
    ----------
    motion : RollAgainstRate
    rate_noise : Noise
    found : int
        Bits of `Finding`.
    """

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
        self.found = 0

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
