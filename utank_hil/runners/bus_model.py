"""Simulated CAN bus for lockstep: bit timing and arbitration.

Modelled: bit rate, arbitration by identifier, non-preemptive transmission, bit stuffing and
intermission. Every queued frame of every node takes part in every arbitration, as in a CAN
controller with one mailbox per message; frames of equal identifier in queueing order. Not modelled:
limits of queues, collisions of two nodes that send the same identifier. Errors and retransmission
are those of `firmware_sim.fault_injection.bench_parts`.
"""

from heapq import heappop, heappush
from typing import Final

from utank_hil.canbus.frame import LONGEST_STANDARD_ID, STANDARD, Frame
from utank_hil.runners.wire_time import INTERMISSION_BITS, frame_bits


class SimulatedBus:
    """A CAN bus in simulated time, which starts at 0; a bit must take whole nanoseconds."""

    def __init__(self, bit_rate: int = 250_000) -> None:
        if bit_rate <= 0 or 1_000_000_000 % bit_rate:
            raise ValueError(
                f"bit_rate {bit_rate}: must divide 1e9, as 125000, 250000, 500000, 1000000 do"
            )
        self._bit_ns: Final = 1_000_000_000 // bit_rate
        self._intermission_ns: Final = INTERMISSION_BITS * self._bit_ns
        # (rank by identifier, order of queueing, frame, sender, time on the wire)
        self._waiting: list[tuple[int, int, Frame, int, int]] = []
        self._order = 0
        self._in_flight: tuple[int, int, Frame] | None = None
        self._free_ns = 0  # end of the latest transmission
        self._busy_ns = 0  # of all transmissions begun
        self.frames = 0  #: Frames whose transmission has begun.

    def queue(self, sender: int, frame: Frame, now_ns: int, more_bits: int = 0) -> None:
        """Queue a frame for transmission from `now_ns` on; calls must be in order of time.

        It keeps the bus for `more_bits` longer than its own bits take. ValueError is raised if the
        identifier or the payload is too long for CAN.
        """
        duration_ns = (frame_bits(frame) + more_bits) * self._bit_ns
        self._order += 1
        can_id = frame.can_id
        # twice, so that an identifier of 11 bits goes before all that begin with it
        rank = (can_id & LONGEST_STANDARD_ID) << 19 if can_id & STANDARD else 2 * can_id + 1
        heappush(self._waiting, (rank, self._order, frame, sender, duration_ns))
        if self._free_ns < now_ns:
            self._free_ns = now_ns

    def carry_until(self, before_ns: int) -> list[tuple[int, int, Frame]]:
        """Advance the bus, and return the frames that ended before `before_ns`, oldest first.

        Each comes with the time of its last bit in ns and its sender.
        """
        arrived = []
        waiting, in_flight = self._waiting, self._in_flight
        while in_flight is not None or (waiting and self._free_ns < before_ns):
            if in_flight is None:
                start_ns = self._free_ns
                _, _, frame, sender, duration_ns = heappop(waiting)
                self._free_ns = end_ns = start_ns + duration_ns
                self.frames += 1
                self._busy_ns += duration_ns
                in_flight = end_ns - self._intermission_ns, sender, frame
            if in_flight[0] >= before_ns:
                break
            arrived.append(in_flight)
            in_flight = None
        self._in_flight = in_flight
        return arrived

    def load(self, now_ns: int) -> float:
        """Return the bus load, 0 to 1, from time 0 to `now_ns`, to which the bus was advanced."""
        busy_ns = self._busy_ns - max(0, self._free_ns - now_ns)
        return busy_ns / now_ns if now_ns else 0.0
