"""Everything about the CAN bus: the catalogue of messages, their protection, and the ports.

Light to import: cantools is loaded with the catalogue, python-can with `SocketCanPort`.
"""

from typing import TYPE_CHECKING

from utank_hil.canbus.catalogue import Catalogue, load_catalogue
from utank_hil.canbus.enumerations import (
    Address,
    ControlWord,
    DriveFault,
    DriveState,
    Fault,
    Mode,
    NodeState,
    Quality,
    ResetCause,
    RetuningState,
    Switch,
)
from utank_hil.canbus.exchange import Receiver, Rejection, Transmitter
from utank_hil.canbus.frame import Frame
from utank_hil.canbus.messages import (
    AddressClaim,
    ControllerStatus,
    DriveStatus1,
    DriveStatus2,
    Heartbeat,
    OperatorCommand,
    PumpCommand,
    SensorMotion,
    SensorPump,
    SensorTank,
)
from utank_hil.canbus.port import Port, PortError

if TYPE_CHECKING:
    from utank_hil.canbus.socketcan import SocketCanPort

__all__ = [
    "Address",
    "AddressClaim",
    "Catalogue",
    "ControlWord",
    "ControllerStatus",
    "DriveFault",
    "DriveState",
    "DriveStatus1",
    "DriveStatus2",
    "Fault",
    "Frame",
    "Heartbeat",
    "Mode",
    "NodeState",
    "OperatorCommand",
    "Port",
    "PortError",
    "PumpCommand",
    "Quality",
    "Receiver",
    "Rejection",
    "ResetCause",
    "RetuningState",
    "SensorMotion",
    "SensorPump",
    "SensorTank",
    "SocketCanPort",
    "Switch",
    "Transmitter",
    "load_catalogue",
]


def __getattr__(name: str) -> object:
    if name == "SocketCanPort":
        from utank_hil.canbus.socketcan import SocketCanPort

        return SocketCanPort
    msg = f"module {__name__!r} has no attribute {name!r}"
    raise AttributeError(msg)
