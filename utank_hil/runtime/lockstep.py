"""Nodes on a simulated bus in simulated time: one thread, the same trace for the same seeds.

At one instant the nodes that are due tick first, in the order given; then frames that arrive are
delivered; then the bus arbitrates. So a frame handed out at one tick reaches the others, at the
earliest, for their next tick, as it does on a real bus. Nobody waits for anybody: a node that
hands out nothing is simply silent.
"""

from collections.abc import Callable, Sequence

from utank_hil.canbus.frame import Frame
from utank_hil.runtime.bus_model import SimulatedBus
from utank_hil.runtime.group import NodeGroup
from utank_hil.runtime.node import Node

Trace = Callable[[int, str, Frame], None]
"""Called with (time in nanoseconds, sender's name, frame) at the end of every frame."""


class Lockstep:
    """Drive nodes in simulated time, from 0.

    Parameters
    ----------
    nodes : sequence of Node
        Names must differ. All tick at 0 and every `period_ns` after it.
    bus : SimulatedBus, optional
        A new one; 250 kbit/s unless given.
    trace : callable, optional
        Sees every frame as it arrives, before the nodes do, as a logger on the bus would.

    Attributes
    ----------
    now_ns : int
        Everything before this time has happened.
    bus : SimulatedBus
        The bus between the nodes.

    Raises
    ------
    ValueError
        If there is no node, a name comes twice, or a period is not positive.
    """

    def __init__(
        self, nodes: Sequence[Node], bus: SimulatedBus | None = None, trace: Trace | None = None
    ) -> None:
        self._group = NodeGroup(nodes)
        self._trace = trace
        self.bus = SimulatedBus() if bus is None else bus
        self.now_ns = 0

    def run_until(self, time_ns: int) -> None:
        """Let everything happen that happens before `time_ns`.

        Running in slices is the same as running in one go, so a bench may look in between.

        Raises
        ------
        ValueError
            If `time_ns` is in the past.
        NodeError
            If a node raises; the run can't be continued then.
        """
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
