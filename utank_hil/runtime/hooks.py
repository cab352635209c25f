"""What a node may have besides `receive` and `tick`; only the real-time runner asks for it."""

from collections.abc import Iterable
from typing import Protocol, runtime_checkable

from utank_hil.canbus.frame import Frame


@runtime_checkable
class LinkObserver(Protocol):
    """A node that wants to know when its bus can't be reached."""

    def link_error(self, now_ns: int, reason: str) -> None:
        """Learn that a frame could not be sent, or that the bus could not be read, just now.

        Called within the tick in which it happened: before the nodes are ticked if the bus could
        not be read, after `tick` returned the frame if it could not be sent.
        """


@runtime_checkable
class Stoppable(Protocol):
    """A node that has something to say before the process ends."""

    def stop(self, now_ns: int) -> Iterable[Frame]:
        """Return the last frames to send; asked once, however the run ended."""
