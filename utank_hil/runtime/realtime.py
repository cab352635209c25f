"""Nodes on a real bus in real time: one process, one thread, an absolute grid.

The tick does no I/O but the port's, takes no lock, logs nothing. Deadlines lie on one grid, laid at
the start of the run: a late tick neither shifts the grid nor is caught up.
"""

import os
from collections.abc import Callable, Sequence
from typing import Final

from utank_hil.canbus.frame import Frame
from utank_hil.canbus.port import Port, PortError
from utank_hil.runtime.clock import Clock, MonotonicClock
from utank_hil.runtime.group import OUTSIDE, NodeGroup
from utank_hil.runtime.node import Node
from utank_hil.runtime.statistics import LoopStatistics

_NEVER_NS: Final = 1 << 63
_REAL_TIME: Final = (os.SCHED_FIFO, os.SCHED_RR)


def _never() -> bool:
    return False


class RealTimeLoop:
    """Drive nodes on one port.

    At every point of the grid: frames that arrived are handed to every node, the nodes that are
    due tick in the order given and their frames go out, then each frame that went out is handed to
    the other nodes of the group, which a real bus would not bring back to this socket.

    Parameters
    ----------
    nodes : sequence of Node
        Names must differ. The grid's step is the greatest common divisor of their periods.
    port : Port, optional
        The bus; without one the group talks among itself.
    statistics : LoopStatistics, optional
        Counted into; new unless given.
    clock : Clock, optional
        The monotonic clock unless given.

    Attributes
    ----------
    statistics : LoopStatistics
        What was counted.

    Raises
    ------
    ValueError
        If there is no node, a name comes twice, or a period is not positive.
    """

    def __init__(
        self,
        nodes: Sequence[Node],
        port: Port | None = None,
        *,
        statistics: LoopStatistics | None = None,
        clock: Clock | None = None,
    ) -> None:
        self._group = NodeGroup(nodes)
        self._port = port
        self._clock = MonotonicClock() if clock is None else clock
        self.statistics = LoopStatistics() if statistics is None else statistics
        self._sent: list[tuple[int, Frame]] = []

    def run(self, stop: Callable[[], bool] = _never, duration_ns: int | None = None) -> None:
        """Run until `stop()` is true or the time is up; then let the nodes send their last frames.

        Nodes are handed the time of the grid's point, not of the wake-up, so that what they
        integrate and differentiate does not see the jitter.

        Parameters
        ----------
        stop : callable
            Asked before every tick.
        duration_ns : int, optional
            Ticks at the start and at every grid point less than this later; those of them that
            passed without a tick are counted as skipped, however late the last one was.

        Raises
        ------
        NodeError
            If a node raises; `stop` of those that have it is called all the same.
        """
        clock, statistics, period_ns = self._clock, self.statistics, self._group.base_period_ns
        statistics.real_time = os.sched_getscheduler(0) & ~os.SCHED_RESET_ON_FORK in _REAL_TIME
        deadline_ns = clock.now_ns()
        end_ns = _NEVER_NS if duration_ns is None else deadline_ns + duration_ns
        self._group.start(deadline_ns)
        try:
            while deadline_ns < end_ns:
                clock.sleep_until(deadline_ns)
                if stop():
                    break
                woken_ns = clock.now_ns()
                late_ns = woken_ns - deadline_ns
                # Woken after one or more further points: this is the tick of the latest of them.
                deadline_ns += self._skip((min(woken_ns, end_ns - 1) - deadline_ns) // period_ns)
                self._tick(deadline_ns)
                done_ns = clock.now_ns()
                statistics.ticks += 1
                statistics.lateness.add(late_ns)
                statistics.duration.add(done_ns - woken_ns)
                deadline_ns += period_ns
                # Points that passed while the tick ran: wait for the first that has not.
                deadline_ns += self._skip(-((deadline_ns - min(done_ns, end_ns)) // period_ns))
        finally:
            self._group.stop(clock.now_ns(), self._send)

    def _skip(self, points: int) -> int:
        """Count grid points that passed without a tick; return their time, 0 if there is none."""
        if points <= 0:
            return 0
        self.statistics.overruns += 1
        self.statistics.skipped += points
        return points * self._group.base_period_ns

    def _tick(self, now_ns: int) -> None:
        group, sent = self._group, self._sent
        for frame in self._receive(now_ns):
            group.deliver(OUTSIDE, frame, now_ns)
        sent.clear()
        group.tick(now_ns, self._send)
        for sender, frame in sent:
            group.deliver(sender, frame, now_ns)

    def _receive(self, now_ns: int) -> Sequence[Frame]:
        """Return what has arrived; an unreadable bus is counted, told to the nodes, and empty."""
        if self._port is None:
            return ()
        try:
            frames = self._port.receive()
        except PortError as error:
            self.statistics.receive_errors += 1
            self._group.link_error(now_ns, str(error))
            return ()
        self.statistics.frames_received += len(frames)
        return frames

    def _send(self, sender: int, frame: Frame, now_ns: int) -> None:
        """Send a frame now, and keep it for the rest of the group if the bus took it."""
        if self._port is not None:
            try:
                self._port.send(frame)
            except PortError as error:
                self.statistics.send_errors += 1
                self._group.link_error(now_ns, str(error))
                return
            self.statistics.frames_sent += 1
        self._sent.append((sender, frame))
