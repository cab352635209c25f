"""The levels of the tank as the controller hears them."""

from typing import Final

from utank_hil.canbus import Receiver, SensorTank, Switch
from utank_hil.canbus.profiles.device import ProfiledDevice
from utank_hil.nodes.plausibility import NEVER_HEARD_NS, USABLE, LevelGates, SampleClock
from utank_hil.safety.monitors.thresholds import MonitorThresholds

_OPEN: Final = Switch.OFF  # read once: in Python 3.11 a member costs more from its class

LEVEL_MARGIN: Final = 1.1
"""Factor on full and empty beyond which a level is no measurement, for gauges and sloshing."""
SUM_SHARE: Final = 0.5
"""Share of a full reservoir beyond which the sum of both levels is none: the water stays."""


class LevelsHeard:
    """Latest levels and high-level switches of a source, and the cycles that it has counted.

    `level_limit_m` is the level at which a reservoir is full or empty. Without `thresholds` no
    level is a spike.
    """

    def __init__(
        self,
        source: Receiver[SensorTank] | ProfiledDevice[SensorTank],
        level_limit_m: float,
        thresholds: MonitorThresholds | None,
    ) -> None:
        self.source = source
        self.port_m = self.starboard_m = 0.0
        self.high = False
        self.heard_ns = NEVER_HEARD_NS
        self.cycles = 0  #: The count of cycles at the newest measurement.
        self._most_level_m = LEVEL_MARGIN * level_limit_m
        self._most_sum_m = SUM_SHARE * level_limit_m
        self._gates = None if thresholds is None else LevelGates(thresholds)
        self._clock = SampleClock(source)
        self._counted = self._lost = 0
        self._due_ns = NEVER_HEARD_NS  # when the last frame was due by its counter
        self._patience_ns = source.cycle_ns * 3 // 2

    @property
    def discarded(self) -> int:
        """Samples so far that were discarded as spikes."""
        return 0 if self._gates is None else self._gates.discarded

    def take(self, tank: SensorTank, now_ns: int) -> None:
        """Take a message that was accepted."""
        self._count_cycles(now_ns)
        time_ns = self._clock.time_ns(now_ns)
        # the switches count whatever the gauges say, and a broken switch counts as closed
        self.high = not (tank.port_high is _OPEN and tank.starboard_high is _OPEN)
        if tank.quality not in USABLE:
            return
        port_m, starboard_m = tank.port_level_m, tank.starboard_level_m
        # written so that NaN, not available, fails too; a reservoir fills as the other one empties
        if (
            # pragma: no mutate start: it is never just that
            abs(port_m - starboard_m) <= 2 * self._most_level_m
            and abs(port_m + starboard_m) <= self._most_sum_m
            # pragma: no mutate end
            and (self._gates is None or self._gates.passes(port_m, starboard_m, time_ns))
        ):
            self.port_m, self.starboard_m = port_m, starboard_m
            self.heard_ns, self.cycles = now_ns, self._counted

    def _count_cycles(self, now_ns: int) -> None:
        """Count the cycles since the last frame; by its counter, since time of receipt jitters.

        A counter that falls behind the time is that of a long gap, or of a node that is too slow.
        """
        lost, cycle_ns = self.source.lost, self.source.cycle_ns
        cycles = 1 + lost - self._lost
        self._lost = lost
        due_ns = self._due_ns + cycles * cycle_ns
        behind_ns = now_ns - due_ns
        if behind_ns > self._patience_ns:  # pragma: no mutate: just that counts either way
            missed = round(behind_ns / cycle_ns)
            cycles += missed
            due_ns += missed * cycle_ns
        self._counted += cycles
        self._due_ns = min(due_ns, now_ns)
