"""The messages of the catalogue: one typed tuple each, declared here and in the DBC only.

Field names are the DBC's signal names. `utank_hil.canbus` exports every message of this file.
Types of fields:

* `float`: a value in the unit of the name. NaN is "not available"; a raw value out of range decodes
  to NaN; encoding saturates at the range.
* `E | None` (E an IntEnum) and `int | None`: None is "not available"; a raw value outside the table
  or range decodes to None; encoding an integer saturates.
* `bool`: one bit, without "not available".
"""

import math
from collections.abc import Callable
from typing import Any, Final, NamedTuple, TypeVar

from utank_hil.canbus.enumerations import (
    AlarmState,
    ControlWord,
    DriveFault,
    DriveState,
    FailPosition,
    Fault,
    Mode,
    NodeState,
    Quality,
    ResetCause,
    RetuningState,
    Station,
    Switch,
    ValveControl,
    ValveFault,
    ValveState,
    Verdict,
)

_T = TypeVar("_T", bound=type[tuple[Any, ...]])

DBC_NAMES: Final[dict[type[tuple[Any, ...]], str]] = {}
"""Message name in the DBC by type; for messages that several nodes send, without the node's name
or number.
"""


def _dbc_message(name: str) -> Callable[[_T], _T]:
    """Declare that a type is the message of this name."""

    def declare(kind: _T) -> _T:
        DBC_NAMES[kind] = name
        return kind

    return declare


@_dbc_message("PUMP_CMD")
class PumpCommand(NamedTuple):
    """PUMP_CMD, controller to drive, 20 ms.

    Attributes
    ----------
    pressure_pa
        Set-point of the pump's differential pressure; positive raises the starboard level.
    control_word
        CiA 402 command. None must not enable anything.
    timeout_s
        The drive goes to zero pressure by itself after this time without a valid command.
    """

    pressure_pa: float
    control_word: ControlWord | None
    timeout_s: float


@_dbc_message("DRIVE_STATUS_1")
class DriveStatus1(NamedTuple):
    """DRIVE_STATUS_1, drive to controller, 20 ms.

    Attributes
    ----------
    pressure_pa
        Differential pressure as the drive measures it, signed as the command.
    speed_rad_s
        Shaft speed of the pump, positive for positive pressure.
    state
        CiA 402 state.
    command_echo
        Counter of the last PUMP_CMD accepted; None before the first.
    pressure_limited, speed_limited, rate_limited, power_limited
        The limit is active.
    """

    pressure_pa: float
    speed_rad_s: float
    state: DriveState | None
    command_echo: int | None
    pressure_limited: bool
    speed_limited: bool
    rate_limited: bool
    power_limited: bool


@_dbc_message("DRIVE_STATUS_2")
class DriveStatus2(NamedTuple):
    """DRIVE_STATUS_2, drive to controller, 100 ms; power is `bus_voltage_v * current_a`.

    Attributes
    ----------
    fault
        Why the drive is in its fault state.
    bus_voltage_v, current_a
        Direct-current bus of the drive; current into the drive is positive.
    motor_temperature_c, drive_temperature_c
        Temperatures in degrees Celsius.
    temperature_warning, voltage_warning
        Near the limit that would trip the drive.
    command_warning
        Commands were rejected or lost recently.
    sensor_warning
        The drive's pressure feedback is implausible.
    """

    fault: DriveFault | None
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
    """VALVE_CMD, controller to valve, 20 ms.

    Attributes
    ----------
    opening
        Open share asked for: 0 as shut as the valve gets, 1 open.
    control
        Whether to follow it. None must not move anything away from the fail position.
    timeout_s
        The valve goes to its fail position by itself after this time without a valid command.
    """

    opening: float
    control: ValveControl | None
    timeout_s: float


@_dbc_message("VALVE_STATUS")
class ValveStatus(NamedTuple):
    """VALVE_STATUS, valve to controller, 20 ms.

    Attributes
    ----------
    opening
        Open share as the position sensor measures it.
    state
        What the valve does.
    fault
        Why it is in its fault state.
    command_echo
        Counter of the last VALVE_CMD accepted; None before the first.
    fail_position
        Where it goes without a command.
    moving
        It is on its way.
    open_limit, shut_limit
        The limit switch of that end is closed.
    """

    opening: float
    state: ValveState | None
    fault: ValveFault | None
    command_echo: int | None
    fail_position: FailPosition | None
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
    quality: Quality | None


@_dbc_message("SENSOR_TANK")
class SensorTank(NamedTuple):
    """SENSOR_TANK, sensors to controller, 20 ms.

    Attributes
    ----------
    port_level_m, starboard_level_m
        Level above the still-water level, measured independently; negative below.
    port_high, starboard_high
        Independent high-level switches.
    quality
        Quality of both levels.
    """

    port_level_m: float
    starboard_level_m: float
    port_high: Switch | None
    starboard_high: Switch | None
    quality: Quality | None


@_dbc_message("SENSOR_PUMP")
class SensorPump(NamedTuple):
    """SENSOR_PUMP, sensors to controller, 20 ms.

    Attributes
    ----------
    pressure_pa
        Differential pressure across the pump, signed as the command.
    flow_m3_s
        Flow through the duct, positive to starboard; NaN where no flow meter is fitted.
    quality
        Quality of the pressure.
    """

    pressure_pa: float
    flow_m3_s: float
    quality: Quality | None


@_dbc_message("HARDWIRED_INPUTS")
class HardwiredInputs(NamedTuple):
    """HARDWIRED_INPUTS, a node apart from sensors and drive to controller, 50 ms.

    Attributes
    ----------
    port_high, starboard_high
        Hard-wired high-level switches.
    stop_loop
        ON where the hard-wired stop loop is open: a stop is asked for.
    quality
        Quality of all inputs.
    """

    port_high: Switch | None
    starboard_high: Switch | None
    stop_loop: Switch | None
    quality: Quality | None


@_dbc_message("CTRL_STATUS")
class ControllerStatus(NamedTuple):
    """CTRL_STATUS, controller to all, 100 ms.

    Attributes
    ----------
    mode
        Mode of the controller.
    fault
        The fault that is active or latched.
    armed
        Pump and valve may be commanded.
    alarm
        An alarm is waiting to be acknowledged.
    degraded
        Running with a substitute or at a reduced limit.
    saturated
        The command is held at a limit.
    not_realtime
        The controller runs without real-time scheduling.
    bus_load
        Share of the bus in use, 0 to 1.
    catalogue_version, configuration_version
        Hashes of the DBC and of the configuration, to be equal on all nodes before arming.
    retuning
        State of its retuning; None if it has none.
    station
        Operator station in command.
    """

    mode: Mode | None
    fault: Fault | None
    armed: bool
    alarm: bool
    degraded: bool
    saturated: bool
    not_realtime: bool
    bus_load: float
    catalogue_version: int | None
    configuration_version: int | None
    retuning: RetuningState | None = None
    station: Station | None = None


@_dbc_message("SEA_ESTIMATE")
class SeaEstimate(NamedTuple):
    """SEA_ESTIMATE, controller to panels, 1 s.

    Attributes
    ----------
    verdict
        Whether the sea can be told.
    significant_height_m, peak_period_s
        Significant wave height, and encounter period of the spectrum's peak.
    moment_rms_rad
        RMS of the wave's roll moment over the roll stiffness: the static heel of that moment.
    relative_deviation
        Standard deviation of `moment_rms_rad`, as a share of it.
    age_s
        Time since the estimate was made.
    """

    verdict: Verdict | None
    significant_height_m: float
    peak_period_s: float
    moment_rms_rad: float
    relative_deviation: float
    age_s: float


@_dbc_message("SHIP_ESTIMATE")
class ShipEstimate(NamedTuple):
    """SHIP_ESTIMATE, controller to panels, 1 s.

    Attributes
    ----------
    verdict
        Whether the ship can be told.
    roll_period_s, roll_period_deviation_s
        Natural roll period with the tank's water at rest, and its standard deviation.
    gm_m, gm_deviation_m
        Metacentric height and its standard deviation; NaN where the displacement is not known.
    age_s
        Time since the estimate was made.
    """

    verdict: Verdict | None
    roll_period_s: float
    roll_period_deviation_s: float
    gm_m: float
    gm_deviation_m: float
    age_s: float


@_dbc_message("PASSIVE_TWIN")
class PassiveTwin(NamedTuple):
    """PASSIVE_TWIN, controller to panels, 100 ms: the ship with a passive tank in the same waves.

    Attributes
    ----------
    quality
        Quality of the twin's roll.
    twin_roll_rad
        Its roll angle, positive starboard down.
    twin_rms_rad, roll_rms_rad
        RMS of the twin's and of the ship's own roll over some roll periods.
    """

    quality: Quality | None
    twin_roll_rad: float
    twin_rms_rad: float
    roll_rms_rad: float


@_dbc_message("ALARM")
class Alarm(NamedTuple):
    """ALARM, controller to panels, 100 ms: one alarm of the list a frame, one after the other.

    An empty list is one frame of 0 `alarms`, code NONE and state NORMAL.

    Attributes
    ----------
    state
        State of the alarm.
    code
        What it is about.
    place, alarms
        Place in the list, 0 the most urgent, and number of alarms in it.
    times_raised
        How often it was raised since it was last accepted.
    age_s
        Time since it was last raised.
    """

    state: AlarmState | None
    code: Fault | None
    place: int | None
    alarms: int | None
    times_raised: int | None
    age_s: float


@_dbc_message("OPERATOR_CMD")
class OperatorCommand(NamedTuple):
    """OPERATOR_CMD, operator panel to controller, 200 ms and on change.

    OPERATOR_CMD_2 is that of a second station.

    Attributes
    ----------
    mode_request
        Requested mode; None for no request.
    arm
        Permission to use the pump; a rising edge arms, False disarms.
    stop
        Zero pressure at once.
    reset
        Rising edge: clear a latched fault.
    acknowledge
        Rising edge: accept the alarms.
    retune
        Rising edge: identify the ship and retune the controller.
    undo
        Rising edge: back to the law before the last retuning.
    forbid_retuning
        No retuning, requested or automatic; one under way is cancelled.
    take_command
        Rising edge: ask for the command, which one station has at a time.
    acknowledge_code
        Code of the alarm that `acknowledge` accepts; None accepts all.
    power_budget_w
        Mean electric power that the pump may take; NaN asks for the greatest comfort.
    """

    mode_request: Mode | None
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
    """HEARTBEAT_<NODE>, every node to all, 100 ms.

    Attributes
    ----------
    state
        State of the node.
    reset_cause
        Cause of its last start.
    uptime_s
        Time since then, in steps of 10 s; a decrease means a restart.
    catalogue_version, configuration_version
        Hashes of the DBC and of the configuration, to be equal on all nodes before arming.
    transmit_error_count, receive_error_count
        CAN error counters in steps of 16 (96 warning, 128 error passive); NaN where unknown.
    """

    state: NodeState | None
    reset_cause: ResetCause | None
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
