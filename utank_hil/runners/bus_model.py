"""Simulated CAN bus for lockstep: bit timing and arbitration.

Modelled: bit rate, arbitration by identifier, non-preemptive transmission, bit stuffing and
intermission. Every queued frame of every node takes part in every arbitration, as in a CAN
controller with one mailbox per message. Frames of equal identifier are sent in queueing order.
Transmit queues are unbounded.

Not modelled: collisions of two nodes that send the same identifier. Errors and retransmission are
those of `firmware_sim.fault_injection.faulty_bus`.
"""

from array import array
from collections import Counter
from dataclasses import dataclass
from heapq import heappop, heappush
from typing import Final

from utank_hil.canbus.frame import LONGEST_STANDARD_ID, STANDARD, Frame
from utank_hil.runners.wire_time import INTERMISSION_BITS, frame_bits

WINDOW_NS: Final = 1_000_000_000
"""Length of the windows of the bus load."""


@dataclass(frozen=True, slots=True)
class BusStatistics:
    """Traffic on the bus since time 0."""

    frames: int  #: Frames whose transmission has begun.
    load: float  #: Bus load, 0 to 1.
    window_loads: tuple[float, ...]  #: Bus load of each complete window of 1 s, oldest first.
    #: Percentiles of the queueing delay, up to the start of frame; exact; 0 without frames.
    delay_p50_ns: int
    delay_p99_ns: int
    delay_max_ns: int
    waiting: int  #: Frames in the queue.


class SimulatedBus:
    """A CAN bus in simulated time, which starts at 0.

    ValueError is raised if the bit rate is not positive or a bit does not take whole nanoseconds.

    Parameters
    ----------
    bit_rate : int
        Bits per second; a bit must take whole nanoseconds.
    """

    def __init__(self, bit_rate: int = 250_000) -> None:
        if bit_rate <= 0 or 1_000_000_000 % bit_rate:
            raise ValueError(
                f"bit_rate {bit_rate}: must divide 1e9, as 125000, 250000, 500000, 1000000 do"
            )
        self._bit_ns: Final = 1_000_000_000 // bit_rate
        self._intermission_ns: Final = INTERMISSION_BITS * self._bit_ns
        # (rank by identifier, order of queueing, frame, sender, queued at, time on the wire)
        self._waiting: list[tuple[int, int, Frame, int, int, int]] = []
        self._order = 0
        self._in_flight: tuple[int, int, Frame] | None = None
        self._free_ns = 0  # end of the latest transmission
        self._new_delays_ns: list[int] = []  # counted in bulk when a window closes, which is faster
        self._delays: Counter[int] = Counter()
        self._window_end_ns = WINDOW_NS
        self._window_busy_ns = 0
        self._busy_before_ns = 0  # in all windows before this one
        self._window_loads = array("d")

    def queue(self, sender: int, frame: Frame, now_ns: int, more_bits: int = 0) -> None:
        """Queue a frame for transmission from `now_ns` on; calls must be in order of time.

        It keeps the bus for `more_bits` longer than its own bits take.

        ValueError is raised if the identifier or the payload is too long for CAN.
        """
        duration_ns = (frame_bits(frame) + more_bits) * self._bit_ns
        self._order += 1
        can_id = frame.can_id
        # twice, so that an identifier of 11 bits goes before all that begin with it
        rank = (can_id & LONGEST_STANDARD_ID) << 19 if can_id & STANDARD else 2 * can_id + 1
        heappush(self._waiting, (rank, self._order, frame, sender, now_ns, duration_ns))
        if self._free_ns < now_ns:
            self._free_ns = now_ns

    def carry_until(self, before_ns: int) -> list[tuple[int, int, Frame]]:
        """Advance the bus to `before_ns`.

        Returns
        -------
        list of tuple of (time in ns, sender, frame)
            Frames that ended before `before_ns`, with the time of their last bit; oldest first.
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
        """Close every window that ends by `end_ns`; the bus is busy from `start_ns` to `end_ns`."""
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
        """Return the statistics at `now_ns`, the time to which the bus was advanced."""
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
        """Return the smallest delay not exceeded by at least this fraction of the frames."""
        wanted = fraction * self._delays.total()
        passed = 0
        for delay_ns in sorted(self._delays):
            passed += self._delays[delay_ns]
            if passed >= wanted:
                return delay_ns
        return 0
