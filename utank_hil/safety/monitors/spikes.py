"""Spikes: a sample that nothing on board can have moved to since the last one is discarded."""

from typing import Final

from utank_hil.base.tick import TICK_S
from utank_hil.safety.monitors.repetition import Repetition
from utank_hil.safety.monitors.standstill import Standstill
from utank_hil.safety.monitors.thresholds import MonitorThresholds

STEP_SAMPLES: Final = 5
"""So many in a row are no spike but a step, which is taken."""
REPEATS_WITHIN_PERIODS: Final = 1 / 3
"""Of the roll's. No motion of a ship worth mentioning comes again so soon, even without noise."""


class SpikeGate:
    """Passes the samples of a signal that are near enough to the last one that passed.

    Parameters
    ----------
    spike : float
        Distance from the last sample, noise included, that is always near enough.
    most_per_s : float
        So much more for each second since then.
    """

    def __init__(self, spike: float, most_per_s: float) -> None:
        self._spike = spike
        self._most_per_ns = most_per_s * 1e-9
        self._value = 0.0
        self._value_ns = -(1 << 62)
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


class MotionGate:
    """The gates of one motion sensor, where each of its samples is seen.

    Attributes
    ----------
    repetition : Repetition
    discarded : int
        Samples so far that did not pass, by their roll or by their rate.
    """

    def __init__(self, thresholds: MonitorThresholds) -> None:
        remembered_s = REPEATS_WITHIN_PERIODS * thresholds.roll_period_s
        self.repetition = Repetition(round(remembered_s / TICK_S))
        self._roll = SpikeGate(thresholds.roll_spike_rad, thresholds.roll_most_rad_s)
        self._rate = SpikeGate(thresholds.rate_spike_rad_s, thresholds.rate_most_rad_s2)
        self.discarded = 0

    def passes(self, roll_rad: float, rate_rad_s: float, now_ns: int) -> bool:
        """Whether a sample may be used."""
        self.repetition.take(roll_rad, rate_rad_s)
        # both see every sample
        passes = self._roll.passes(roll_rad, now_ns) & self._rate.passes(rate_rad_s, now_ns)
        self.discarded += not passes
        return passes


class SpikeGates:
    """The gates of the motion sensors and of the level gauges.

    Attributes
    ----------
    motions : tuple of MotionGate
        Of the first sensor, and of the second where there is one.
    port, starboard : Standstill
        Of the gauges.
    levels_discarded : int
        Samples of the gauges so far that did not pass, by either level.
    """

    def __init__(self, thresholds: MonitorThresholds) -> None:
        self.motions = MotionGate(thresholds), MotionGate(thresholds)
        self._port = SpikeGate(thresholds.level_spike_m, thresholds.level_most_m_s)
        self._starboard = SpikeGate(thresholds.level_spike_m, thresholds.level_most_m_s)
        self.port, self.starboard = Standstill(), Standstill()
        self.levels_discarded = 0

    def levels_pass(self, port_m: float, starboard_m: float, now_ns: int) -> bool:
        """Whether a sample of the level gauges may be used."""
        self.port.take(port_m)
        self.starboard.take(starboard_m)
        passes = self._port.passes(port_m, now_ns) & self._starboard.passes(starboard_m, now_ns)
        self.levels_discarded += not passes
        return passes

    @property
    def discarded(self) -> int:
        """Samples of all of them so far that did not pass."""
        return self.levels_discarded + sum(gate.discarded for gate in self.motions)


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
