"""The CAN bus of lockstep: one frame at a time, lowest identifier first, exact time on the wire.

What is modelled: bit rate, arbitration by identifier, frames that can't be interrupted, bit
stuffing, intermission. Every waiting frame of every node takes part in every arbitration, as in a
controller with a mailbox a message: no frame waits behind a less urgent one of its own node. Frames
of equal identifier go in the order they were queued. Transmit queues have no limit.

What is not: errors and retransmission, and the collision of two nodes that send one identifier at
the same time.
"""

from array import array
from collections import Counter
from dataclasses import dataclass
from heapq import heappop, heappush
from itertools import count
from typing import Final

from utank_hil.canbus.frame import Frame
from utank_hil.runtime.wire_time import INTERMISSION_BITS, frame_bits

WINDOW_NS: Final = 1_000_000_000
"""Bus load is measured over windows of this length."""


@dataclass(frozen=True, slots=True)
class BusStatistics:
    """What the bus carried from time 0 on.

    Attributes
    ----------
    frames : int
        Frames that began.
    load : float
        Fraction of the time in which the bus was taken.
    window_loads : tuple of float
        The same in each complete window of 1 s, oldest first.
    delay_p50_ns, delay_p99_ns, delay_max_ns : int
        Time from queueing to the start of frame, over all frames; exact; 0 without frames.
    waiting : int
        Frames queued that have not begun.
    """

    frames: int
    load: float
    window_loads: tuple[float, ...]
    delay_p50_ns: int
    delay_p99_ns: int
    delay_max_ns: int
    waiting: int


class SimulatedBus:
    """A CAN bus in simulated time, which starts at 0.

    Parameters
    ----------
    bit_rate : int
        Bits per second; a bit must take whole nanoseconds.

    Raises
    ------
    ValueError
        If the bit rate is not positive or a bit does not take whole nanoseconds.
    """

    def __init__(self, bit_rate: int = 250_000) -> None:
        if bit_rate <= 0 or 1_000_000_000 % bit_rate:
            raise ValueError(
                f"bit_rate {bit_rate}: must divide 1e9, as 125000, 250000, 500000, 1000000 do"
            )
        self._bit_ns: Final = 1_000_000_000 // bit_rate
        self._intermission_ns: Final = INTERMISSION_BITS * self._bit_ns
        # (identifier, order of queueing, frame, sender, queued at, time on the wire)
        self._waiting: list[tuple[int, int, Frame, int, int, int]] = []
        self._order = count()
        self._in_flight: tuple[int, int, Frame] | None = None
        self._free_ns = 0  # the bus is, or was last, taken until then
        self._new_delays_ns: list[int] = []  # counted when a window closes: together is faster
        self._delays: Counter[int] = Counter()
        self._window_end_ns = WINDOW_NS
        self._window_busy_ns = 0
        self._busy_before_ns = 0  # in all windows before this one
        self._window_loads = array("d")

    def queue(self, sender: int, frame: Frame, now_ns: int) -> None:
        """Let a frame take part in arbitration from `now_ns` on; times must not go back.

        Raises
        ------
        ValueError
            If the frame is none that CAN can carry.
        """
        duration_ns = frame_bits(frame) * self._bit_ns
        heappush(
            self._waiting, (frame.can_id, next(self._order), frame, sender, now_ns, duration_ns)
        )
        if self._free_ns < now_ns:
            self._free_ns = now_ns

    def carry_until(self, before_ns: int) -> list[tuple[int, int, Frame]]:
        """Let the bus work until `before_ns`.

        Returns
        -------
        list of tuple of (time in ns, sender, frame)
            The frames whose last bit is over, at that time, before `before_ns`; oldest first.
        """
        arrived = []
        waiting, in_flight = self._waiting, self._in_flight
        while in_flight is not None or (waiting and self._free_ns < before_ns):
            if in_flight is None:
                start_ns = self._free_ns
                _, _, frame, sender, queued_ns, duration_ns = heappop(waiting)
                self._free_ns = end_ns = start_ns + duration_ns
                self._new_delays_ns.append(start_ns - queued_ns)
                if end_ns < self._window_end_ns:
                    self._window_busy_ns += duration_ns
                else:
                    self._close_windows(start_ns, end_ns)
                in_flight = end_ns - self._intermission_ns, sender, frame
            if in_flight[0] >= before_ns:
                break
            arrived.append(in_flight)
            in_flight = None
        self._in_flight = in_flight
        return arrived

    def _close_windows(self, start_ns: int, end_ns: int) -> None:
        """Close every window that is over at `end_ns`; the bus is taken from `start_ns` to then."""
        while self._window_end_ns <= end_ns:
            in_window_ns = max(0, self._window_end_ns - start_ns)
            busy_ns = self._window_busy_ns + in_window_ns
            self._busy_before_ns += busy_ns
            self._window_loads.append(busy_ns / WINDOW_NS)
            start_ns += in_window_ns
            self._window_busy_ns = 0
            self._window_end_ns += WINDOW_NS
        self._window_busy_ns += end_ns - start_ns
        self._delays.update(self._new_delays_ns)
        self._new_delays_ns.clear()

    def statistics(self, now_ns: int) -> BusStatistics:
        """Return what the bus carried until `now_ns`, the time up to which it has worked."""
        self._close_windows(now_ns, now_ns)
        busy_ns = self._busy_before_ns + self._window_busy_ns - max(0, self._free_ns - now_ns)
        return BusStatistics(
            frames=self._delays.total(),
            load=busy_ns / now_ns if now_ns else 0.0,
            window_loads=tuple(self._window_loads),
            delay_p50_ns=self._delay_percentile_ns(0.50),
            delay_p99_ns=self._delay_percentile_ns(0.99),
            delay_max_ns=max(self._delays, default=0),
            waiting=len(self._waiting),
        )

    def _delay_percentile_ns(self, fraction: float) -> int:
        """Return the smallest delay that at least this fraction of the frames did not exceed."""
        wanted = fraction * self._delays.total()
        passed = 0
        for delay_ns in sorted(self._delays):
            passed += self._delays[delay_ns]
            if passed >= wanted:
                return delay_ns
        return 0
