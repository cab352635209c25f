"""What lives on the bus: a plain object that is handed frames and the time, and hands back frames.

A node opens no socket, reads no clock, starts no thread and never sleeps. That is what lets the
lockstep runner and the real-time runner drive the very same object.
"""

from collections.abc import Iterable
from typing import Protocol, runtime_checkable

from utank_hil.canbus.frame import Frame


class Node(Protocol):
    """Anything that lives on the CAN bus.

    Attributes
    ----------
    name : str
        Names the node in traces and statistics.
    period_ns : int
        Time between two ticks, in nanoseconds.
    """

    name: str
    period_ns: int

    def receive(self, frame: Frame, now_ns: int) -> None:
        """Take one frame from the bus, received at `now_ns` (monotonic clock, nanoseconds)."""

    def tick(self, now_ns: int) -> Iterable[Frame]:
        """Do one period's work and return the frames to send, in order."""


@runtime_checkable
class Selective(Protocol):
    """A node that says what it hears; one that does not say hears everything.

    The runner need not hand it other frames, nor the kernel other frames to its process. So a node
    that watches for strangers, or counts what is on the bus, has no such list.

    Attributes
    ----------
    hears : frozenset of int
        Identifiers; a runner asks once, before the first tick.
    """

    hears: frozenset[int]


def heard_by(nodes: Iterable[Node]) -> frozenset[int] | None:
    """Return the identifiers that a group of nodes hears, None if one of them hears everything."""
    heard: frozenset[int] = frozenset()
    for node in nodes:
        if not isinstance(node, Selective):
            return None
        heard |= node.hears
    return heard
