"""The telemetry signals: what the controller node shows of itself every tick."""

from collections.abc import Callable
from struct import Struct
from typing import Any, Final

from utank_hil.base.arrays import FloatArray

_SOURCES: Final = {
    "time_s": "time_s",
    "roll_rad": "inbox.roll_rad",
    "roll_rate_rad_s": "inbox.roll_rate_rad_s",
    "port_level_m": "inbox.port_level_m",
    "starboard_level_m": "inbox.starboard_level_m",
    "pressure_command_pa": "command_pa",
    "pressure_actual_pa": "inbox.pressure_pa",
    "pump_power_w": "inbox.power_w",
    "valve_opening": "inbox.valve_opening",
    "mode": "supervisor.mode",
    "fault": "fault",
    "wakeup_lateness_s": "statistics.lateness.recent_s",
    "tick_duration_s": "statistics.duration.recent_s",
    "twin_roll_rad": "twin_roll_rad",
    "bus_load": "seen.bus_load",
    "overruns": "statistics.overruns",
    "retuning": "retuning_state",
    "roll_rms_rad": "roll_rms_rad",
    "twin_roll_rms_rad": "twin_roll_rms_rad",
    "sea_verdict": "estimated.of_sea",
    "significant_height_m": "estimated.hs_m",
    "peak_period_s": "estimated.tp_s",
    "wave_moment_rms_rad": "estimated.moment_rms_rad",
    "wave_moment_deviation": "estimated.moment_deviation",
    "sea_age_s": "estimated.sea_age_s",
    "ship_verdict": "estimated.of_ship",
    "roll_period_s": "estimated.roll_period_s",
    "roll_period_deviation_s": "estimated.roll_period_deviation_s",
    "gm_m": "estimated.gm_m",
    "gm_deviation_m": "estimated.gm_deviation_m",
    "ship_age_s": "estimated.ship_age_s",
}
"""Each signal in SI units, its unit in its name, and the attribute of `ControllerNode` it shows.

A new signal is one line here. Its unit gives it its plot, see `utank_hil.telemetry.units`.
"""

ROW_TICKS: Final = 5
"""Of the controller's ticks, every fifth has a row: 20 Hz, ample for a ship."""

SIGNALS: Final = tuple(_SOURCES)
"""Columns of a telemetry row."""

_SLOW: Final = SIGNALS.index("bus_load")
"""From here on the signals change little within 100 ms, and are looked at no more often."""

Put = Callable[[FloatArray, Any], None]


def _part(columns: slice) -> Put:
    """What puts the values of a node into their part of a row.

    Put by `struct`: numpy would ask each value for its type first. Written as source: to follow
    the names at each tick would take twice as long.
    """
    sources = list(_SOURCES.values())[columns]
    values = ", ".join(f"node.{source}" for source in sources)
    put = Struct(f"{len(sources)}d").pack_into
    at = 8 * (columns.start or 0)
    part: Put = eval(f"lambda row, node: put(row, {at}, {values})", {"put": put})
    return part


put_quick: Final = _part(slice(_SLOW))
put_slow: Final = _part(slice(_SLOW, None))
