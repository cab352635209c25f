"""The columns of one telemetry row: what the controller node shows of itself every tick."""

from typing import Final

SIGNALS: Final = (
    "time_s",
    "roll_rad",
    "roll_rate_rad_s",
    "port_level_m",
    "starboard_level_m",
    "pressure_command_pa",
    "pressure_actual_pa",
    "pump_power_w",
    "mode",
    "fault",
    "bus_load",
    "wakeup_lateness_s",
    "tick_duration_s",
    "overruns",
    "retuning",
)
