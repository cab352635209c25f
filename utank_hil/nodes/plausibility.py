"""Plausibility: a sample that nothing on board can have moved to since the last is discarded."""

import math
from typing import Any, Final

from utank_hil.base.tick import LONG_AGO_NS
from utank_hil.canbus import Quality, Receiver, SensorMotion
from utank_hil.canbus.measurements import MotionSample
from utank_hil.canbus.profiles.device import ProfiledDevice
from utank_hil.safety.monitors.thresholds import MonitorThresholds

NEVER_HEARD_NS: Final = LONG_AGO_NS
"""Time of receipt of what was never heard."""
MILLISECOND_NS: Final = 1_000_000
USABLE: Final = (Quality.GOOD, Quality.DEGRADED)
STEP_SAMPLES: Final = 5
"""So many in a row are no spike but a step, which is taken."""


class SpikeGate:
    """Passes the samples of a signal that are near enough to the last one that passed.

    `spike` is the distance, noise included, that is always near enough; `most_per_s` is added for
    each second since then. Times are those of the samples, see `SampleClock`.
    """

    def __init__(self, spike: float, most_per_s: float) -> None:
        self._spike = spike
        self._most_per_ns = most_per_s * 1e-9
        self._value = 0.0
        self._value_ns = NEVER_HEARD_NS
        self._in_a_row = 0

    def passes(self, value: float, now_ns: int) -> bool:
        """Take a sample; return whether it may be used."""
        moved = value - self._value
        near = self._spike + self._most_per_ns * (now_ns - self._value_ns)
        if -near <= moved <= near or self._in_a_row == STEP_SAMPLES - 1:
            self._value = value
            self._value_ns = now_ns
            self._in_a_row = 0
            return True
        self._in_a_row += 1
        return False


class SampleClock:
    """Time of a source's samples: of their receipt, but for bursts of what the bus held up.

    Where a counter or a stamp shows that a sample is new, it is a cycle after the one before it at
    least, and later by those that were lost. Only differences of these times mean anything.
    """

    def __init__(self, source: Receiver[Any] | ProfiledDevice[Any]) -> None:
        self._source = source
        self._cycle_ns = source.cycle_ns if source.counts else 0
        self._came_ns = self._time_ns = NEVER_HEARD_NS
        self._lost = 0

    def time_ns(self, now_ns: int) -> int:
        """Time of the sample that came now; once for each that is accepted."""
        lost = self._source.lost
        counted_ns = (1 + lost - self._lost) * self._cycle_ns
        passed_ns = now_ns - self._came_ns
        # pragma: no mutate start: both alike are either
        self._time_ns += passed_ns if passed_ns > counted_ns else counted_ns
        # pragma: no mutate end
        self._came_ns, self._lost = now_ns, lost
        return self._time_ns


class MotionSensor:
    """What is heard of one motion sensor.

    Without `thresholds`, of what no ship can do, every finite sample is taken. `roll_rad` and
    `roll_rate_rad_s` are those of the last plausible sample, received at `heard_ns`.
    """

    def __init__(
        self,
        receiver: Receiver[SensorMotion] | ProfiledDevice[SensorMotion],
        thresholds: MonitorThresholds | None,
    ) -> None:
        self.receiver = receiver
        self.roll_rad = self.roll_rate_rad_s = 0.0
        self.heard_ns = NEVER_HEARD_NS
        self.discarded = 0  #: Samples so far that did not pass, by their roll or by their rate.
        self._gated = thresholds is not None
        self._clock = SampleClock(receiver)
        if thresholds is not None:
            self._roll = SpikeGate(thresholds.roll_spike_rad, thresholds.roll_most_rad_s)
            self._rate = SpikeGate(thresholds.rate_spike_rad_s, thresholds.rate_most_rad_s2)

    def take(self, motion: SensorMotion, now_ns: int) -> None:
        """Take an accepted message; keep its sample if it is one."""
        roll_rad, rate_rad_s = motion.roll_rad, motion.roll_rate_rad_s
        time_ns = self._clock.time_ns(now_ns)
        # one test for both: the sum is NaN if either is not available
        if motion.quality not in USABLE or not math.isfinite(roll_rad + rate_rad_s):
            return
        if self._gated:
            # both see every sample
            passes = self._roll.passes(roll_rad, time_ns) & self._rate.passes(rate_rad_s, time_ns)
            if not passes:
                self.discarded += 1
                return
        self.roll_rad, self.roll_rate_rad_s, self.heard_ns = roll_rad, rate_rad_s, now_ns

    def sample(self, now_ns: int) -> MotionSample:
        """The last plausible sample, with its age."""
        heard_ns = self.heard_ns
        return MotionSample(
            self.roll_rad,
            self.roll_rate_rad_s,
            heard_ns,
            (now_ns - heard_ns) / MILLISECOND_NS,
            self.receiver.valid,
            self.discarded,
        )


class LevelGates:
    """The gates of both level gauges."""

    def __init__(self, thresholds: MonitorThresholds) -> None:
        self._port = SpikeGate(thresholds.level_spike_m, thresholds.level_most_m_s)
        self._starboard = SpikeGate(thresholds.level_spike_m, thresholds.level_most_m_s)
        self.discarded = 0  #: Samples so far that did not pass, by either level.

    def passes(self, port_m: float, starboard_m: float, now_ns: int) -> bool:
        """Whether a sample of the level gauges may be used."""
        passes = self._port.passes(port_m, now_ns) & self._starboard.passes(starboard_m, now_ns)
        self.discarded += not passes
        return passes
