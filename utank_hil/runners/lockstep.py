"""Runs nodes on a simulated bus in simulated time: one thread, the same trace for the same seeds.

At each instant the due nodes tick first, in the order given; then arrived frames are delivered;
then the bus arbitrates. So a frame sent in one tick reaches other nodes at their next tick at the
earliest, as on a real bus. No node waits for another: a silent node does not stop the run.
"""

from collections.abc import Callable, Sequence
from typing import Protocol

from utank_hil.canbus.frame import BUS_SHIFT, OTHER_BUS, Frame
from utank_hil.runners.bus_model import SimulatedBus
from utank_hil.runners.group import NodeGroup
from utank_hil.runners.node import Node

Trace = Callable[[int, str, Frame], None]
"""Called as (time in ns, sender's name, frame) at the end of every frame."""


class Bus(Protocol):
    """The bus between the nodes, as `SimulatedBus` has it."""

    def queue(self, sender: int, frame: Frame, now_ns: int) -> None:
        """Take a frame to be sent."""

    def carry_until(self, before_ns: int) -> list[tuple[int, int, Frame]]:
        """Advance, and return what has arrived: time, sender, frame."""

    def load(self, now_ns: int) -> float:
        """Return the bus load, 0 to 1, since time 0."""


class Lockstep:
    """Runs nodes in simulated time; every event before `now_ns` has happened.

    By default the bus is a new one of 250 kbit/s. `trace` receives every frame before the nodes do.
    """

    def __init__(
        self, nodes: Sequence[Node], bus: Bus | None = None, trace: Trace | None = None
    ) -> None:
        self._group = NodeGroup(nodes)
        self._trace = trace
        self.bus: Bus = SimulatedBus() if bus is None else bus
        self.now_ns = 0

    def join(self, nodes: Sequence[Node]) -> None:
        """Have more nodes on the bus from now on, after the others; those keep their cycles."""
        self._group = self._group.joined_by(nodes, self.now_ns)

    def run_until(self, time_ns: int) -> None:
        """Run every event before `time_ns`; ValueError if past, NodeError if a node raises."""
        if time_ns < self.now_ns:
            raise ValueError(f"time_ns {time_ns}: the run is at {self.now_ns} already")
        group, bus, trace = self._group, self.bus, self._trace
        while True:
            until_ns = min(group.next_tick_ns, time_ns)
            for now_ns, sender, frame in bus.carry_until(until_ns):
                if trace is not None:
                    trace(now_ns, group.names[sender], frame)
                group.deliver(sender, frame, now_ns)
            if until_ns == time_ns:
                break
            group.tick(until_ns, bus.queue)
        self.now_ns = time_ns


class SeveralBuses:
    """The controller's own bus and more of them: a frame's identifier tells which carries it."""

    def __init__(self, first: Bus, more: int, bit_rate: int) -> None:
        self._buses = (first, *(SimulatedBus(bit_rate) for _ in range(more)))

    def queue(self, sender: int, frame: Frame, now_ns: int) -> None:
        """Take a frame to be sent on its bus."""
        bare = Frame(frame.can_id & (OTHER_BUS - 1), frame.data)
        self._buses[frame.can_id >> BUS_SHIFT].queue(sender, bare, now_ns)

    def carry_until(self, before_ns: int) -> list[tuple[int, int, Frame]]:
        """Advance, and return what has arrived on any bus, oldest first."""
        arrived = [
            (time_ns, sender, Frame(number << BUS_SHIFT | frame.can_id, frame.data))
            for number, bus in enumerate(self._buses)
            for time_ns, sender, frame in bus.carry_until(before_ns)
        ]
        return sorted(arrived, key=lambda each: each[0])

    def load(self, now_ns: int) -> float:
        """Return the load of the controller's own bus."""
        return self._buses[0].load(now_ns)


def with_more(first: Bus, more: int, bit_rate: int) -> Bus:
    """The bus itself, or with more beside it."""
    return SeveralBuses(first, more, bit_rate) if more else first
