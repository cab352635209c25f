"""The columns of one telemetry row: what the controller node shows of itself every tick."""

from enum import IntEnum
from typing import Final


class Mode(IntEnum):
    """Mode of the controller, as CTRL_STATUS carries it."""

    INIT = 0
    STANDBY = 1
    PASSIVE = 2
    ACTIVE = 3
    FAULT = 4


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
)
