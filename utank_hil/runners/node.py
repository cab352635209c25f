"""Interface of a node: a plain object that receives frames and the time, and returns frames.

A node opens no socket, reads no clock, starts no thread and never sleeps. So the lockstep runner
and the real-time runner can run the same object.
"""

from collections.abc import Iterable
from typing import Protocol, runtime_checkable

from utank_hil.canbus.frame import Frame


class Node(Protocol):
    """A participant on the CAN bus."""

    name: str  #: Name in traces and statistics.
    period_ns: int  #: Time between two ticks.

    def receive(self, frame: Frame, now_ns: int) -> None:
        """Take one frame from the bus, received at `now_ns` (monotonic clock, nanoseconds)."""

    def tick(self, now_ns: int) -> Iterable[Frame]:
        """Run one period and return the frames to send, in order."""


@runtime_checkable
class Selective(Protocol):
    """A node with an acceptance filter; a node without one receives every frame.

    Runner and kernel need not deliver other frames. A node that detects unknown identifiers or
    measures the bus load must not have a filter.
    """

    hears: frozenset[int]  #: Identifiers to receive; read once, before the first tick.


def heard_by(nodes: Iterable[Node]) -> frozenset[int] | None:
    """Return the joint acceptance filter of some nodes, None if one of them has none."""
    heard: frozenset[int] = frozenset()
    for node in nodes:
        if not isinstance(node, Selective):
            return None
        heard |= node.hears
    return heard


class NodeError(RuntimeError):
    """A node raised; the original exception is the `__cause__`, and the message names the node."""


class ModelError(OSError):
    """A model of another program failed, which a node runs; it leaves a runner as it is."""


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
