"""The telemetry: what the controller node shows of itself, and to whom it is handed."""

from collections.abc import Callable
from operator import attrgetter
from struct import Struct
from typing import Final

import numpy as np

from utank_hil.base.arrays import FloatArray
from utank_hil.canbus.events import AlarmEvent, RetuningEvent
from utank_hil.runners.statistics import LoopStatistics

_QUICK: Final = {
    "time_s": "time_s",
    "roll_rad": "motion.roll_rad",
    "roll_rate_rad_s": "motion.roll_rate_rad_s",
    "port_level_m": "measured.port_level_m",
    "starboard_level_m": "measured.starboard_level_m",
    "pressure_command_pa": "command_pa",
    "pressure_actual_pa": "measured.pressure_pa",
    "pump_power_w": "measured.power_w",
    "valve_opening": "measured.valve_opening",
    "mode": "mode",
    "fault": "fault",
    "wakeup_lateness_s": "telemetry.statistics.lateness.recent_s",
    "tick_duration_s": "telemetry.statistics.duration.recent_s",
    "twin_roll_rad": "safety.passive_roll_rad",
}
"""Each signal in SI units, its unit in its name, and the attribute of `ControllerNode` it shows.

A new signal is one line here or in `_SLOW`. Its unit gives it its plot, see
`utank_hil.telemetry.units`.
"""
_SLOW: Final = {
    "bus_load": "safety.situation.bus_load",
    "overruns": "telemetry.statistics.overruns",
    "retuning": "retuning_state",
    "forecast_ahead_s": "law.foreseen_s",
    "roll_rms_rad": "safety.roll_rms_rad",
    "twin_roll_rms_rad": "safety.passive_roll_rms_rad",
    "sea_verdict": "estimated.sea.verdict",
    "significant_height_m": "estimated.sea.significant_height_m",
    "peak_period_s": "estimated.sea.peak_period_s",
    "wave_moment_rms_rad": "estimated.sea.moment_rms_rad",
    "wave_moment_deviation": "estimated.sea.relative_deviation",
    "sea_age_s": "estimated.sea.age_s",
    "ship_verdict": "estimated.ship.verdict",
    "roll_period_s": "estimated.ship.roll_period_s",
    "roll_period_deviation_s": "estimated.ship.roll_period_deviation_s",
    "gm_m": "estimated.ship.gm_m",
    "gm_deviation_m": "estimated.ship.gm_deviation_m",
    "ship_age_s": "estimated.ship.age_s",
}
"""Signals that change little within 100 ms, and are looked at no more often."""

ROW_TICKS: Final = 5
"""Ticks of the controller from one row to the next: 20 Hz, ample for a ship."""

SIGNALS: Final = (*_QUICK, *_SLOW)
"""Columns of a telemetry row."""

_quick: Final = attrgetter(*_QUICK.values())
_slow: Final = attrgetter(*_SLOW.values())
# packed at once: numpy would ask each value for its type first
_put_quick: Final = Struct(f"{len(_QUICK)}d").pack_into
_put_slow: Final = Struct(f"{len(_SLOW)}d").pack_into
_SLOW_AT: Final = 8 * len(_QUICK)


def shown_by(node: object) -> tuple[float, ...]:
    """Values of `SIGNALS` of a `ControllerNode`."""
    return _quick(node) + _slow(node)


RowSink = Callable[[FloatArray], None]
EventSink = Callable[[RetuningEvent | AlarmEvent, int], None]


class Telemetry:
    """Takes what the controller shows: rows of numbers, and events.

    `statistics` are those of the loop that drives the node; without any, in lockstep, all are zero.
    `sink` takes a row (columns `SIGNALS`) every `sink_every` ticks from the first on; it must copy
    it and not wait. `event_sink` takes each event of retuning and alarms, with the time of the
    first tick, as it happens, and must not wait either.
    """

    def __init__(
        self,
        statistics: LoopStatistics | None = None,
        sink: RowSink | None = None,
        sink_every: int = 1,
        event_sink: EventSink | None = None,
    ) -> None:
        self.statistics = statistics or LoopStatistics(real_time=True)
        self._sink, self._sink_every = sink, sink_every
        self._event_sink = event_sink
        self._ticks_to_row = 0
        self._slow_due = True
        self._row = np.zeros(len(SIGNALS))
        self._bytes = self._row.data.cast("B")

    def tell(self, event: RetuningEvent | AlarmEvent, start_ns: int) -> None:
        """Hand an event on."""
        if self._event_sink is not None:
            self._event_sink(event, start_ns)

    def renew_slow(self) -> None:
        """Look at the slow signals, too, for the next row."""
        self._slow_due = True

    def show(self, node: object) -> None:
        """Hand a row of a `ControllerNode` to the sink when one is due, once a tick."""
        if self._sink is None:
            return
        if self._ticks_to_row == 0:
            self._ticks_to_row = self._sink_every
            _put_quick(self._bytes, 0, *_quick(node))
            if self._slow_due:
                self._slow_due = False
                _put_slow(self._bytes, _SLOW_AT, *_slow(node))
            self._sink(self._row)
            self.statistics.begin_row()
        self._ticks_to_row -= 1
