"""Interface from a runner to a bus."""

from collections.abc import Sequence
from typing import Protocol

from utank_hil.canbus.frame import Frame


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
