"""The messages of the catalogue: one typed tuple each, declared here and in the DBC only.

Field names are the DBC's signal names; what a field means is the signal's comment there, and stands
in docs/can-catalogue.md. `utank_hil.canbus` exports every message of this file. Types of fields:

* `float`: a value in the unit of the name. NaN is "not available"; a raw value out of range decodes
  to NaN; encoding saturates at the range.
* `E | None` (E an IntEnum) and `int | None`: None is "not available"; a raw value outside the table
  or range decodes to None; encoding an integer saturates.
* `bool`: one bit, without "not available".
"""

import math
from collections.abc import Callable
from typing import Any, Final, NamedTuple, TypeVar

from utank_hil.canbus import enumerations

_T = TypeVar("_T", bound=type[tuple[Any, ...]])
DBC_NAMES: Final[dict[type[tuple[Any, ...]], str]] = {}
"""Name in the DBC by type; of messages that several nodes send, without the node's name."""


def _dbc_message(name: str) -> Callable[[_T], _T]:

    def declare(kind: _T) -> _T:
        DBC_NAMES[kind] = name
        return kind

    return declare


@_dbc_message("PUMP_CMD")
class PumpCommand(NamedTuple):
    """PUMP_CMD, controller to drive, 20 ms; without a control word nothing may be enabled."""

    pressure_pa: float
    control_word: enumerations.ControlWord | None
    timeout_s: float


@_dbc_message("DRIVE_STATUS_1")
class DriveStatus1(NamedTuple):
    """DRIVE_STATUS_1, drive to controller, 20 ms."""

    pressure_pa: float
    speed_rad_s: float
    state: enumerations.DriveState | None
    command_echo: int | None
    pressure_limited: bool
    speed_limited: bool
    rate_limited: bool
    power_limited: bool


@_dbc_message("DRIVE_STATUS_2")
class DriveStatus2(NamedTuple):
    """DRIVE_STATUS_2, drive to controller, 100 ms; power is `bus_voltage_v * current_a`."""

    fault: enumerations.DriveFault | None
    bus_voltage_v: float
    current_a: float
    motor_temperature_c: float
    drive_temperature_c: float
    temperature_warning: bool
    voltage_warning: bool
    command_warning: bool
    sensor_warning: bool


@_dbc_message("VALVE_CMD")
class ValveCommand(NamedTuple):
    """VALVE_CMD, controller to valve, 20 ms; without `control` it is to keep its fail position."""

    opening: float
    control: enumerations.ValveControl | None
    timeout_s: float


@_dbc_message("VALVE_STATUS")
class ValveStatus(NamedTuple):
    """VALVE_STATUS, valve to controller, 20 ms."""

    opening: float
    state: enumerations.ValveState | None
    fault: enumerations.ValveFault | None
    command_echo: int | None
    fail_position: enumerations.FailPosition | None
    moving: bool
    open_limit: bool
    shut_limit: bool


@_dbc_message("SENSOR_MOTION")
class SensorMotion(NamedTuple):
    """SENSOR_MOTION, sensors to controller, 10 ms; roll positive starboard down.

    SENSOR_MOTION_2 is that of a second motion sensor.
    """

    roll_rad: float
    roll_rate_rad_s: float
    quality: enumerations.Quality | None


@_dbc_message("SENSOR_TANK")
class SensorTank(NamedTuple):
    """SENSOR_TANK, sensors to controller, 20 ms."""

    port_level_m: float
    starboard_level_m: float
    port_high: enumerations.Switch | None
    starboard_high: enumerations.Switch | None
    quality: enumerations.Quality | None


@_dbc_message("SENSOR_PUMP")
class SensorPump(NamedTuple):
    """SENSOR_PUMP, sensors to controller, 20 ms."""

    pressure_pa: float
    flow_m3_s: float
    quality: enumerations.Quality | None


@_dbc_message("HARDWIRED_INPUTS")
class HardwiredInputs(NamedTuple):
    """HARDWIRED_INPUTS, a node apart from sensors and drive to controller, 50 ms."""

    port_high: enumerations.Switch | None
    starboard_high: enumerations.Switch | None
    stop_loop: enumerations.Switch | None
    quality: enumerations.Quality | None


@_dbc_message("WAVE_FORECAST")
class ForecastPoints(NamedTuple):
    """WAVE_FORECAST, preview station to controller, 20 ms: two points of a forecast a frame."""

    lead_s: float
    moment_rad: float
    next_moment_rad: float
    deviation_rad: float
    quality: enumerations.Quality | None


@_dbc_message("CTRL_STATUS")
class ControllerStatus(NamedTuple):
    """CTRL_STATUS, controller to all, 100 ms."""

    mode: enumerations.Mode | None
    fault: enumerations.Fault | None
    armed: bool
    alarm: bool
    degraded: bool
    saturated: bool
    not_realtime: bool
    bus_load: float
    catalogue_version: int | None
    configuration_version: int | None
    retuning: enumerations.RetuningState | None = None
    station: enumerations.Station | None = None


@_dbc_message("SEA_ESTIMATE")
class SeaEstimate(NamedTuple):
    """SEA_ESTIMATE, controller to panels, 1 s."""

    verdict: enumerations.Verdict | None
    significant_height_m: float
    peak_period_s: float
    moment_rms_rad: float
    relative_deviation: float
    age_s: float


@_dbc_message("SHIP_ESTIMATE")
class ShipEstimate(NamedTuple):
    """SHIP_ESTIMATE, controller to panels, 1 s."""

    verdict: enumerations.Verdict | None
    roll_period_s: float
    roll_period_deviation_s: float
    gm_m: float
    gm_deviation_m: float
    age_s: float


@_dbc_message("PASSIVE_TWIN")
class PassiveTwin(NamedTuple):
    """PASSIVE_TWIN, controller to panels, 100 ms: the same ship with a passive tank."""

    quality: enumerations.Quality | None
    twin_roll_rad: float
    twin_rms_rad: float
    roll_rms_rad: float


@_dbc_message("ALARM")
class Alarm(NamedTuple):
    """ALARM, controller to panels, 100 ms: one alarm of the list a frame, one after the other.

    An empty list is one frame of 0 `alarms`, code NONE and state NORMAL.
    """

    state: enumerations.AlarmState | None
    code: enumerations.Fault | None
    place: int | None
    alarms: int | None
    times_raised: int | None
    age_s: float


@_dbc_message("OPERATOR_CMD")
class OperatorCommand(NamedTuple):
    """OPERATOR_CMD, operator panel to controller, 200 ms and on change.

    OPERATOR_CMD_2 is that of a second station.
    """

    mode_request: enumerations.Mode | None
    arm: bool
    stop: bool
    reset: bool
    acknowledge: bool
    retune: bool = False
    undo: bool = False
    forbid_retuning: bool = False
    take_command: bool = False
    acknowledge_code: int | None = None
    power_budget_w: float = math.nan


@_dbc_message("HEARTBEAT")
class Heartbeat(NamedTuple):
    """HEARTBEAT_<NODE>, every node to all, 100 ms."""

    state: enumerations.NodeState | None
    reset_cause: enumerations.ResetCause | None
    uptime_s: float
    catalogue_version: int | None
    configuration_version: int | None
    transmit_error_count: float
    receive_error_count: float


@_dbc_message("ADDRESS_CLAIM")
class AddressClaim(NamedTuple):
    """ADDRESS_CLAIM_<NODE>, every node at boot, unprotected: all 64 bits are SAE J1939-81's NAME.

    A node that receives a claim of its own address from another node must not arm.
    """

    name: int | None
