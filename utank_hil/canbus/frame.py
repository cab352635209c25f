"""The CAN frame of nodes and ports, and the interface of a port."""

from collections.abc import Sequence
from typing import Final, NamedTuple, Protocol

STANDARD: Final = 1 << 29  #: Mark of an identifier of 11 bits.
BUS_SHIFT: Final = 30  #: Above it stands the number of the interface; the controller's own is 0.
MOST_BUSES: Final = 4  #: Two motion sensors, drive and its own.
OTHER_BUS: Final = 1 << BUS_SHIFT  #: Identifiers from here on are of other interfaces.
LONGEST_ID: Final = (1 << 29) - 1
LONGEST_STANDARD_ID: Final = (1 << 11) - 1
CHECK_BUS: Final = "check wiring, termination and bit rate"


class Frame(NamedTuple):
    """One CAN 2.0 data frame of at most 8 bytes.

    `can_id` has 29 bits, or 11 bits with the mark `STANDARD`; above `BUS_SHIFT` stands the number
    of the interface.
    """

    can_id: int
    data: bytes


class PortError(OSError):
    """The bus can't be reached: no such interface, interface down, transmit queue full."""


class Port(Protocol):
    """A bus as seen by a runner; never blocks."""

    @property
    def others(self) -> int:
        """What was received so far and is no `Frame`: it loads the bus all the same."""

    def send(self, frame: Frame) -> None:
        """Queue one frame for transmission; PortError is raised if it was not accepted."""

    def receive(self) -> Sequence[Frame]:
        """Return the frames since the last call, oldest first; PortError if there is no bus."""

    def close(self) -> None:
        """Release the bus; idempotent."""
