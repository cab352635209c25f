"""The nodes of one runner: schedule, routing of frames, and errors that name the node."""

from collections.abc import Callable, Sequence
from contextlib import ExitStack
from math import gcd
from typing import Final

from utank_hil.canbus.frame import Frame
from utank_hil.runners.node import (
    LinkObserver,
    LoadObserver,
    ModelError,
    Node,
    NodeError,
    Selective,
    Stoppable,
)

OUTSIDE: Final = -1  #: Sender index of a frame from outside the group.
Send = Callable[[int, Frame, int], None]  #: Called as (sender's index, frame, time in ns).
Receive = Callable[[Frame, int], None]  #: A node's `receive`.


def _failure(name: str, method: str, now_ns: int, error: Exception) -> NodeError:
    reason = f"{type(error).__name__}: {error}"
    return NodeError(f"node '{name}' failed in {method}() at {now_ns * 1e-9:.6f} s: {reason}")


class NodeGroup:
    """The nodes of one runner, in the order given.

    `names` are by sender index; `next_tick_ns` is the time at which the next node is due.
    ValueError is raised if a name comes twice. Every method raises NodeError if a node raises, or
    `send` refuses its frame; a ModelError in a tick passes as it is.
    """

    def __init__(self, nodes: Sequence[Node]) -> None:
        self.names: Final = tuple(node.name for node in nodes)
        for name in self.names:
            if self.names.count(name) > 1:
                raise ValueError(f"nodes: two are named '{name}'; names tell them apart in traces")
        self._nodes = tuple(nodes)
        self._periods_ns = tuple(node.period_ns for node in nodes)
        self.base_period_ns: Final = gcd(*self._periods_ns)
        # Bound methods and listeners are tabulated: this is the hot path of lockstep. The tables'
        # last entry belongs to OUTSIDE = -1.
        self._ticks = tuple(node.tick for node in nodes)
        senders = range(len(nodes) + 1)
        named = {can_id for node in nodes if isinstance(node, Selective) for can_id in node.hears}
        self._listeners = tuple(
            {can_id: self._who_hears(can_id, sender) for can_id in named} for sender in senders
        )
        self._listeners_to_others = tuple(self._who_hears(None, sender) for sender in senders)
        self.start(0)

    def _who_hears(self, can_id: int | None, sender: int) -> tuple[tuple[int, Receive], ...]:
        """Listeners to this identifier of this sender; None stands for one that no node lists."""
        return tuple(
            (index, node.receive)
            for index, node in enumerate(self._nodes)
            if index != sender and (not isinstance(node, Selective) or can_id in node.hears)
        )

    def start(self, now_ns: int) -> None:
        """Start every node's grid at `now_ns`: all are due then, and every period after it."""
        self._due_ns = [now_ns] * len(self._nodes)
        self.next_tick_ns = now_ns

    def joined_by(self, nodes: Sequence[Node], now_ns: int) -> "NodeGroup":
        """The group with more nodes: these are due now, the others when they were to be."""
        group = NodeGroup([*self._nodes, *nodes])
        group._due_ns = [*self._due_ns, *([now_ns] * len(nodes))]
        group.next_tick_ns = now_ns
        return group

    def tick(self, now_ns: int, send: Send) -> None:
        """Tick every due node once and pass its frames to `send`.

        A node that missed ticks is ticked once, and next due at the next point of its own grid.
        """
        due_ns = self._due_ns
        index = 0
        try:
            for index, tick in enumerate(self._ticks):
                late_ns = now_ns - due_ns[index]
                if late_ns >= 0:
                    period_ns = self._periods_ns[index]
                    due_ns[index] += (late_ns // period_ns + 1) * period_ns
                    for frame in tick(now_ns):
                        send(index, frame, now_ns)
        except ModelError:
            raise
        except Exception as error:
            raise _failure(self.names[index], "tick", now_ns, error) from error
        self.next_tick_ns = min(due_ns)

    def deliver(self, sender: int, frame: Frame, now_ns: int) -> None:
        """Deliver a frame to every node that hears it, except its sender."""
        listeners = self._listeners[sender].get(frame.can_id)
        if listeners is None:
            listeners = self._listeners_to_others[sender]
        index = 0
        try:
            for index, receive in listeners:  # noqa: B007 - names the node that raised
                receive(frame, now_ns)
        except Exception as error:
            raise _failure(self.names[index], "receive", now_ns, error) from error

    def link_error(self, now_ns: int, reason: str) -> None:
        """Notify every `LinkObserver` that the bus can't be reached."""
        for node in self._nodes:
            if isinstance(node, LinkObserver):
                try:
                    node.link_error(now_ns, reason)
                except Exception as error:
                    raise _failure(node.name, "link_error", now_ns, error) from error

    def other_frames(self, count: int) -> None:
        """Tell every `LoadObserver` of frames that no node is handed."""
        for node in self._nodes:
            if isinstance(node, LoadObserver):
                node.other_frames(count)

    def stop(self, now_ns: int, send: Send) -> None:
        """Stop every `Stoppable` node, even if one raises, and pass its last frames to `send`."""
        with ExitStack() as everyone:  # runs every callback even if one raises, last entered first
            for index in reversed(range(len(self._nodes))):
                everyone.callback(self._stop_one, index, now_ns, send)

    def _stop_one(self, index: int, now_ns: int, send: Send) -> None:
        node = self._nodes[index]
        if not isinstance(node, Stoppable):
            return
        try:
            for frame in node.stop(now_ns):
                send(index, frame, now_ns)
        except Exception as error:
            raise _failure(node.name, "stop", now_ns, error) from error
