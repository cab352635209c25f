"""CAN bus: the catalogue of messages, their end-to-end protection, and the ports.

cantools is imported with the catalogue, python-can with `SocketCanPort`.
"""

from typing import TYPE_CHECKING

from utank_hil.canbus.catalogue import Catalogue as Catalogue
from utank_hil.canbus.catalogue import load_catalogue as load_catalogue
from utank_hil.canbus.endpoints import Receiver as Receiver
from utank_hil.canbus.endpoints import Rejection as Rejection
from utank_hil.canbus.endpoints import Transmitter as Transmitter
from utank_hil.canbus.enumerations import *  # noqa: F403 - every value table
from utank_hil.canbus.frame import Frame as Frame
from utank_hil.canbus.measurements import RetuningOrder as RetuningOrder
from utank_hil.canbus.messages import *  # noqa: F403 - every message
from utank_hil.canbus.port import Port as Port
from utank_hil.canbus.port import PortError as PortError

if TYPE_CHECKING:
    from utank_hil.canbus.socketcan import SocketCanPort as SocketCanPort


def __getattr__(name: str) -> object:
    if name == "SocketCanPort":
        from utank_hil.canbus.socketcan import SocketCanPort

        return SocketCanPort
    msg = f"module {__name__!r} has no attribute {name!r}"
    raise AttributeError(msg)
