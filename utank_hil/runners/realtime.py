"""Runs nodes on a real bus in real time: one process, one thread, absolute deadlines.

The tick does no I/O except the port's, takes no lock and logs nothing. Deadlines lie on a grid that
is fixed at the start of the run: a late tick does not shift it, and skipped ticks are not made up.
"""

import os
import time
import warnings
from collections.abc import Callable, Sequence
from typing import Final, Protocol

from utank_hil.canbus.frame import Frame, Port, PortError
from utank_hil.runners.group import OUTSIDE, NodeGroup
from utank_hil.runners.node import Node
from utank_hil.runners.statistics import LoopStatistics

_NEVER_NS: Final = 1 << 63
_REAL_TIME: Final = (os.SCHED_FIFO, os.SCHED_RR)


class Clock(Protocol):
    """A clock that never goes back, and a way to wait for it."""

    def now_ns(self) -> int:
        """Return the time in nanoseconds since an arbitrary instant."""

    def sleep_until(self, time_ns: int) -> None:
        """Return at `time_ns` or later, never earlier; at once if it has passed."""


class MonotonicClock:
    """CLOCK_MONOTONIC: not touched by changes of the wall clock."""

    def now_ns(self) -> int:
        """Return `time.monotonic_ns()`."""
        return time.monotonic_ns()

    def sleep_until(self, time_ns: int) -> None:
        """Sleep until an absolute time; `time.sleep` is clock_nanosleep on the monotonic clock."""
        while (left_ns := time_ns - time.monotonic_ns()) > 0:
            time.sleep(left_ns * 1e-9)


class RealTimeLoop:
    """Runs nodes on one port.

    At every grid point, arrived frames are delivered to every node. Then the due nodes tick in the
    order given, and their frames are sent. Last, each sent frame is delivered to the other nodes of
    the group, because the socket does not receive its own frames. The grid's step is the greatest
    common divisor of the nodes' periods.
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
        self._others = 0 if port is None else port.others

    def run(self, stop: Callable[[], bool] = lambda: False, duration_ns: int | None = None) -> None:
        """Run until `stop()` is true or the time is up; then let the nodes send their last frames.

        Nodes receive the time of the grid point, not of the wake-up, so that jitter does not enter
        what they integrate or differentiate. `stop` is called before every tick. In `duration_ns`
        the loop ticks at the start and at every grid point before the end. NodeError is raised if a
        node raises.
        """
        clock, statistics, period_ns = self._clock, self.statistics, self._group.base_period_ns
        statistics.real_time = os.sched_getscheduler(0) & ~os.SCHED_RESET_ON_FORK in _REAL_TIME
        deadline_ns = clock.now_ns()
        end_ns = _NEVER_NS if duration_ns is None else deadline_ns + duration_ns
        self._group.start(deadline_ns)
        with warnings.catch_warnings():
            # one that is printed where nobody reads would hold up the tick
            warnings.simplefilter("ignore")
            try:
                while deadline_ns < end_ns:
                    clock.sleep_until(deadline_ns)
                    if stop():
                        break
                    woken_ns = clock.now_ns()
                    late_ns = woken_ns - deadline_ns
                    # If further points have passed, this tick is that of the latest one.
                    deadline_ns += self._skip(
                        (min(woken_ns, end_ns - 1) - deadline_ns) // period_ns
                    )
                    self._tick(deadline_ns)
                    done_ns = clock.now_ns()
                    statistics.ticks += 1
                    statistics.lateness.add(late_ns)
                    statistics.duration.add(done_ns - woken_ns)
                    deadline_ns += period_ns
                    # Points that passed during the tick are skipped.
                    deadline_ns += self._skip(-((deadline_ns - min(done_ns, end_ns)) // period_ns))
            finally:
                self._group.stop(clock.now_ns(), self._send)

    def _skip(self, points: int) -> int:
        """Count skipped grid points; return their duration in ns, 0 if there are none."""
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
        """Return arrived frames; on a bus error count it, notify the nodes, return none."""
        if self._port is None:
            return ()
        try:
            frames: Sequence[Frame] = self._port.receive()
        except PortError as error:
            self.statistics.receive_errors += 1
            self._group.link_error(now_ns, str(error))
            frames = ()
        self.statistics.frames_received += len(frames)
        others = self._port.others - self._others
        if others:
            self._others += others
            self.statistics.others_received += others
            self._group.other_frames(others)
        return frames

    def _send(self, sender: int, frame: Frame, now_ns: int) -> None:
        """Send a frame, and keep it for the rest of the group if the bus accepted it."""
        if self._port is not None:
            try:
                self._port.send(frame)
            except PortError as error:
                self.statistics.send_errors += 1
                self._group.link_error(now_ns, str(error))
                return
            self.statistics.frames_sent += 1
        self._sent.append((sender, frame))
