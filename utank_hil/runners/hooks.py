"""Optional interfaces of a node, used by the real-time runner only."""

from collections.abc import Iterable
from typing import Protocol, runtime_checkable

from utank_hil.canbus.frame import Frame


@runtime_checkable
class LinkObserver(Protocol):
    """A node that is notified when the bus can't be reached."""

    def link_error(self, now_ns: int, reason: str) -> None:
        """Handle a frame that could not be sent, or a bus that could not be read.

        Called in the same tick: a receive error before the nodes are ticked, a send error after
        `tick` has returned the frame.
        """


@runtime_checkable
class LoadObserver(Protocol):
    """A node that measures the load of the bus."""

    def other_frames(self, count: int) -> None:
        """Take note of what was received and is no `Frame`: other identifiers, remote, errors."""


@runtime_checkable
class Stoppable(Protocol):
    """A node that sends last frames before the process ends."""

    def stop(self, now_ns: int) -> Iterable[Frame]:
        """Return the last frames to send; called once, however the run ends."""
