"""CAN bus: the catalogue of messages, their end-to-end protection, and frames.

cantools is imported with the catalogue, python-can with `utank_hil.canbus.socketcan`.
"""

from utank_hil.canbus.catalogue import Catalogue as Catalogue
from utank_hil.canbus.catalogue import load_catalogue as load_catalogue
from utank_hil.canbus.endpoints import Receiver as Receiver
from utank_hil.canbus.endpoints import Rejection as Rejection
from utank_hil.canbus.endpoints import Transmitter as Transmitter
from utank_hil.canbus.enumerations import *  # noqa: F403 - every value table
from utank_hil.canbus.frame import Frame as Frame
from utank_hil.canbus.frame import Port as Port
from utank_hil.canbus.frame import PortError as PortError
from utank_hil.canbus.measurements import RetuningOrder as RetuningOrder
from utank_hil.canbus.messages import *  # noqa: F403 - every message
