"""The fault table: what the controller does about each fault it finds while armed."""

from dataclasses import dataclass
from enum import Enum
from typing import Final

from utank_hil.canbus.enumerations import Fault

MILLISECOND_NS: Final = 1_000_000


class Reaction(Enum):
    """What a fault does to the pump pressure."""

    STOP = "zero pressure at once"
    RAMP = "ramp to zero at the rate limit, then zero"


@dataclass(frozen=True, slots=True)
class Response:
    """One row of the fault table.

    Attributes
    ----------
    fault : Fault
        As CTRL_STATUS carries it.
    reaction : Reaction
    zero_within_ns : int
        With `Reaction.RAMP`, when the pressure is cut even if the ramp has not come to its end.
    """

    fault: Fault
    reaction: Reaction
    zero_within_ns: int = 0


def _stop(fault: Fault) -> Response:
    return Response(fault, Reaction.STOP)


def _ramp(fault: Fault, zero_within_ms: int = 1000) -> Response:
    return Response(fault, Reaction.RAMP, zero_within_ms * MILLISECOND_NS)


# 250 ms count from the last good sample, of which the first 30 may pass unnoticed
MOTION_SILENT: Final = _ramp(Fault.MOTION_SILENT, 200)
TANK_SILENT: Final = _ramp(Fault.TANK_SILENT)
PUMP_SENSOR_SILENT: Final = _ramp(Fault.PUMP_SENSOR_SILENT)
PROTECTION: Final = _ramp(Fault.PROTECTION)
BUS_OVERLOAD: Final = _stop(Fault.BUS_OVERLOAD)
ADDRESS_CONFLICT: Final = _stop(Fault.ADDRESS_CONFLICT)
BUS_LOST: Final = _stop(Fault.BUS_LOST)
LEVEL_LIMIT: Final = _stop(Fault.LEVEL_LIMIT)
DRIVE_FAULT: Final = _stop(Fault.DRIVE_FAULT)
DRIVE_SILENT: Final = _stop(Fault.DRIVE_SILENT)
LONG_OVERRUN: Final = _stop(Fault.OVERRUN)
REPEATED_OVERRUNS: Final = _ramp(Fault.OVERRUN)
HEEL_LIMIT: Final = _ramp(Fault.HEEL_LIMIT)
OPERATOR_SILENT: Final = _ramp(Fault.OPERATOR_SILENT)
VERSION_MISMATCH: Final = _stop(Fault.VERSION_MISMATCH)
LAW_FAILED: Final = _stop(Fault.INTERNAL)
