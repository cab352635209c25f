"""Value tables of the catalogue. A value that is not in the table decodes to None.

The raw value of all ones means "not available". It is not a member: a field `Mode | None` has None.
"""

from enum import IntEnum


class Address(IntEnum):
    """Source address of a node: the low byte of every identifier it sends.

    A second node of a kind has the name of the first with _2.
    """

    CONTROLLER = 0x80
    DRIVE = 0x81
    SENSORS = 0x82
    OPERATOR = 0x83
    VALVE = 0x84
    SENSORS_2 = 0x85
    HARDWIRED = 0x86
    OPERATOR_2 = 0x88
    PREVIEW = 0x89


class Mode(IntEnum):
    """Mode of the controller."""

    INIT = 0
    STANDBY = 1
    PASSIVE = 2
    ACTIVE = 3
    FAULT = 4


class Fault(IntEnum):
    """What stopped the controller, or degrades it.

    A code that is found has a row in `utank_hil.safety.faults`; the others are reserved. A number
    that was once sent keeps its meaning.
    """

    NONE = 0
    MOTION_SILENT = 1
    TANK_SILENT = 2
    PUMP_SENSOR_SILENT = 3
    PROTECTION = 4
    COUNTER_FROZEN = 5
    UNKNOWN_IDENTIFIERS = 6
    BUS_OVERLOAD = 7
    ADDRESS_CONFLICT = 8
    BUS_LOST = 9
    STUCK_SIGNAL = 10
    DRIFT = 11
    SPIKES = 12
    NOISE = 13
    LEVEL_LIMIT = 14
    DRIVE_NOT_FOLLOWING = 15
    SATURATION = 16
    SIGN_FLIP = 17
    DRIVE_FAULT = 18
    DRIVE_SILENT = 19
    OVERRUN = 20
    HEEL_LIMIT = 21
    ROLL_AMPLIFIED = 22
    OPERATOR_SILENT = 23
    VERSION_MISMATCH = 24
    INTERNAL = 26
    MOTION_SIGN_FLIP = 27
    VOLUME = 28
    SIGNAL_DELAYED = 29
    FOREIGN_SENDER = 30
    SENSORS_DISAGREE = 31
    HARDWIRED_STOP = 32
    HARDWIRED_SILENT = 33
    VALVE_SILENT = 34
    VALVE_FAULT = 35
    VALVE_NOT_FOLLOWING = 36
    NOT_COMMISSIONED = 37
    BUS_DEGRADED = 38
    STABILITY_LOW = 39
    DRIVE_WARNING = 40
    NODE_SILENT = 41
    FORECAST_IGNORED = 42
    DEVICE_ERROR = 43


class RetuningState(IntEnum):
    """State of the controller's retuning."""

    IDLE = 0
    IDENTIFY = 1
    DESIGN = 2
    TRIAL = 3
    RETUNED = 4
    REFUSED = 5
    UNDONE = 6


class ControlWord(IntEnum):
    """CiA 402 control word (object 0x6040), low byte, as the standard's commands."""

    DISABLE_VOLTAGE = 0x00
    QUICK_STOP = 0x02
    SHUTDOWN = 0x06
    SWITCH_ON = 0x07
    ENABLE_OPERATION = 0x0F
    FAULT_RESET = 0x80


class DriveState(IntEnum):
    """CiA 402 state, as the status word (object 0x6041) shows it under the mask 0x6F."""

    NOT_READY_TO_SWITCH_ON = 0x00
    SWITCH_ON_DISABLED = 0x40
    READY_TO_SWITCH_ON = 0x21
    SWITCHED_ON = 0x23
    OPERATION_ENABLED = 0x27
    QUICK_STOP_ACTIVE = 0x07
    FAULT_REACTION_ACTIVE = 0x0F
    FAULT = 0x08


class DriveFault(IntEnum):
    """Why the pump drive is in its fault state."""

    NONE = 0
    OVERCURRENT = 1
    OVERVOLTAGE = 2
    UNDERVOLTAGE = 3
    MOTOR_OVERTEMPERATURE = 4
    DRIVE_OVERTEMPERATURE = 5
    COMMAND_TIMEOUT = 6
    COMMAND_REFUSED = 7
    PRESSURE_SENSOR = 8
    OVERSPEED = 9
    OVERPRESSURE = 10
    STALL = 11
    INTERNAL = 12


class ValveControl(IntEnum):
    """What the controller tells the valve to do."""

    FAIL_POSITION = 0
    FOLLOW = 1
    RESET = 2


class ValveState(IntEnum):
    """What the valve does."""

    FAIL_POSITION = 0
    FOLLOWING = 1
    FAULT = 2


class ValveFault(IntEnum):
    """Why the valve is in its fault state."""

    NONE = 0
    COMMAND_TIMEOUT = 1
    COMMAND_REFUSED = 2
    STUCK = 3
    POSITION_SENSOR = 4
    SUPPLY = 5
    INTERNAL = 6


class FailPosition(IntEnum):
    """Where a valve goes without a command, and stays when power returns."""

    OPEN = 0
    SHUT = 1


class Station(IntEnum):
    """Operator station in command."""

    NONE = 0
    OPERATOR = 1
    OPERATOR_2 = 2


class AlarmState(IntEnum):
    """State of an alarm, in the terms of IEC 62923-1."""

    ACTIVE_UNACKNOWLEDGED = 0
    ACTIVE_ACKNOWLEDGED = 1
    RECTIFIED_UNACKNOWLEDGED = 2
    NORMAL = 3


class Verdict(IntEnum):
    """Whether an estimate can be relied on, and if not, why."""

    GOOD = 0
    UNCERTAIN = 1
    RECORD_SHORT = 2
    MOTION_SMALL = 3
    OUTDATED = 4


class Quality(IntEnum):
    """Quality of a measurement, as the sensor rates it."""

    GOOD = 0
    DEGRADED = 1
    BAD = 2


class Switch(IntEnum):
    """A switch with wire supervision, two bits as in SAE J1939-71."""

    OFF = 0
    ON = 1
    ERROR = 2


class NodeState(IntEnum):
    """State of a node, in its heartbeat."""

    INITIALISING = 0
    READY = 1
    OPERATIONAL = 2
    FAULT = 3


class ResetCause(IntEnum):
    """Why a node last started."""

    POWER_ON = 0
    COMMAND = 1
    WATCHDOG = 2
    CRASH = 3
