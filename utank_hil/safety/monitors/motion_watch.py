"""All that is judged of one motion sensor by itself."""

import math
from typing import Final

from utank_hil.base.tick import TICK_S
from utank_hil.safety.monitors.finding import Finding
from utank_hil.safety.monitors.motion import RollAgainstRate
from utank_hil.safety.monitors.noise import Noise, SecondDifference
from utank_hil.safety.monitors.spikes import MotionGate, SpikeCount
from utank_hil.safety.monitors.thresholds import MonitorThresholds

_REPEATS: Final = int(Finding.MOTION_REPEATS)
_NOISE: Final = int(Finding.NOISE)
_SPIKES: Final = int(Finding.SPIKES)


class MotionWatch:
    """The monitors of one motion sensor.

    Parameters
    ----------
    thresholds : MonitorThresholds
    gate : MotionGate
        Through which its samples pass.

    Attributes
    ----------
    motion : RollAgainstRate
    rate_noise : Noise
    heard_ns, waited_s, turned_rad : int, float, float
        When the newest sample came, the time since then, and the integral of the rate since the
        last update, each rate for the time from the sample before it: kept by the caller.
    found : int
        Bits of `Finding`.
    repetition : Repetition
        Of its samples.
    """

    def __init__(self, thresholds: MonitorThresholds, gate: MotionGate) -> None:
        self.motion = RollAgainstRate(thresholds)
        self.rate_noise = Noise(math.sqrt(6) * thresholds.rate_noise_rad_s)
        self._rate_bend = SecondDifference()
        self._gate = gate
        self.repetition = gate.repetition
        self._spikes = SpikeCount()
        self._last_rate_rad_s = 0.0
        self.heard_ns = 0
        self.waited_s = self.turned_rad = 0.0
        self.found = 0

    def update(self, roll_rad: float, rate_rad_s: float, elapsed_s: float, *, stale: bool) -> None:
        """Take a sample, and set `found`; one that is `stale` begins anew."""
        # half a tick of the ends makes a trapezoid of the sum, where no sample was lost
        turned_rad = self.turned_rad - 0.5 * TICK_S * (rate_rad_s - self._last_rate_rad_s)
        self.turned_rad = 0.0
        self._last_rate_rad_s = rate_rad_s
        if stale:
            self.motion.restart()
            self._rate_bend.restart()
            self.found = 0
            return
        found = self.motion.update(roll_rad, rate_rad_s, turned_rad, elapsed_s)
        if self.rate_noise.update(self._rate_bend.update(rate_rad_s), elapsed_s):
            found |= _NOISE
        gate = self._gate
        # the largest samples of noise are discarded, too
        if self._spikes.update(gate.discarded, elapsed_s) and not found & _NOISE:
            found |= _SPIKES
        if self.repetition.found:
            found |= _REPEATS
        self.found = found
