"""Simulated bus with faults: bit errors, error counters and bus-off, and gateway faults.

A bit error is detected at the end of the frame, the worst case. An error frame destroys the frame,
which takes part in the next arbitration again. The sender's transmit error counter rises by 8 with
each and falls by 1 with each successful frame (ISO 11898-1); above 127 the sender is error-passive,
above 255 it is off the bus until the fault is over.

A gateway or repeater may also lose, delay, double or swap frames without any CAN controller
detecting it.
"""

import random
from collections.abc import Callable
from dataclasses import dataclass
from heapq import heappop, heappush
from typing import Final, Literal

from firmware_sim.fault_injection.faulty_node import Span
from utank_hil.canbus import Frame
from utank_hil.runners import SimulatedBus

ERROR_FRAME_BITS: Final = 17
"""Error flag and delimiter, at most 20 bits, minus the end of frame that is not sent."""
PASSIVE: Final = 128  #: Transmit error counter of an error-passive node (ISO 11898-1).
OFF: Final = 256  #: Transmit error counter of a node in bus-off (ISO 11898-1).

Arrived = tuple[int, int, Frame]


class Destroyed(Frame):
    """Transmission destroyed by a bit error."""

    __slots__ = ()


class OtherFrame(Frame):
    """Frame with an 11-bit identifier, or remote frame: it occupies the bus and has no data."""

    __slots__ = ()


@dataclass(frozen=True, slots=True)
class Disturbance:
    """Gateway fault of a share of the frames."""

    span: Span
    #: "loses", "delays", "doubles" or "swaps" (with the next frame of its identifier).
    does: Literal["loses", "delays", "doubles", "swaps"]
    share: float
    can_id: int | None  #: Identifier concerned; None for all.
    by_ns: int = 0


class FaultyBus:
    """Simulated bus with faults.

    `warn` and `cut_off` take time and sender, when it becomes error-passive and while it is off the
    bus.
    """

    def __init__(self, bit_rate: int = 250_000, seed: int = 1) -> None:
        self._bus = SimulatedBus(bit_rate)
        #: Method of `SimulatedBus`; destroyed transmissions count as frames.
        self.load = self._bus.load
        self._draw = random.Random(seed).random
        self.disturbances: list[Disturbance] = []
        #: Share of the transmissions that are destroyed, for one sender or for all.
        self.bit_errors: list[tuple[Span, float, int | None]] = []
        self.error_counts: dict[int, int] = {}
        self._off_until_ns: dict[int, int] = {}
        self._held: list[tuple[int, int, int, Frame]] = []
        self._held_count = 0
        self._swapped: dict[int, Arrived] = {}
        self.warn: Callable[[int, int], None] = lambda *_: None
        self.cut_off: Callable[[int, int], None] = lambda *_: None
        #: Function called with each `OtherFrame` that was carried.
        self.hear_others: Callable[[OtherFrame], None] = lambda _: None

    def queue(self, sender: int, frame: Frame, now_ns: int) -> None:
        """Queue a frame as in `SimulatedBus`, preceded by its attempts that will fail."""
        if now_ns < self._off_until_ns.get(sender, 0):
            self.cut_off(now_ns, sender)
            return
        for span, share, of in self.bit_errors:
            if of in (None, sender) and span.holds(now_ns):
                attempts = OFF // 8
                while attempts and self._draw() < share:
                    self._bus.queue(sender, Destroyed(*frame), now_ns, ERROR_FRAME_BITS)
                    attempts -= 1
        self._bus.queue(sender, frame, now_ns)

    def carry_until(self, before_ns: int) -> list[Arrived]:
        """Carry frames as in `SimulatedBus`; return those that the faults leave."""
        arrived = self._bus.carry_until(before_ns)
        if self.bit_errors:
            arrived = [each for each in arrived if self._count_errors(*each)]
        others = [each for each in arrived if isinstance(each[2], OtherFrame)]
        if others:
            for _, _, frame in others:
                self.hear_others(OtherFrame(*frame))
            arrived = [each for each in arrived if not isinstance(each[2], OtherFrame)]
        if self.disturbances:
            arrived = [out for each in arrived for out in self._disturbed(each)]
        if self._held:
            while self._held and self._held[0][0] < before_ns:
                time_ns, _, sender, frame = heappop(self._held)
                arrived.append((time_ns, sender, frame))
            arrived.sort(key=lambda each: each[0])
        return arrived

    def _count_errors(self, time_ns: int, sender: int, frame: Frame) -> bool:
        """Update the error counter; return whether the frame was transmitted."""
        if time_ns < self._off_until_ns.get(sender, 0):
            return False
        count = self.error_counts.get(sender, 0)
        if not isinstance(frame, Destroyed):
            self.error_counts[sender] = max(count - 1, 0)
            return True
        self.error_counts[sender] = count + 8
        if count < PASSIVE <= count + 8:
            self.warn(time_ns, sender)
        if count + 8 >= OFF:
            self._off_until_ns[sender] = max(
                (
                    span.end_ns
                    for span, _, of in self.bit_errors
                    if of in (None, sender) and span.holds(time_ns)
                ),
                default=time_ns,  # the fault ended during its last attempts
            )
            self.error_counts[sender] = 0
            self.cut_off(time_ns, sender)
        return False

    def _disturbed(self, arrived: Arrived) -> list[Arrived]:
        """Frames that a disturbance makes of one that was transmitted."""
        time_ns, sender, frame = arrived
        before = self._swapped.pop(frame.can_id, None)
        frames = [arrived] if before is None else [arrived, (time_ns, *before[1:])]
        for each in self.disturbances:
            if each.can_id not in (None, frame.can_id) or not each.span.holds(time_ns):
                continue
            if self._draw() >= each.share:
                continue
            if each.does == "loses":
                frames.remove(arrived)
            elif each.does == "doubles":
                frames.append(arrived)
            elif each.does == "swaps" and before is None:
                frames.remove(arrived)
                self._swapped[frame.can_id] = arrived
            elif each.does == "delays":
                frames.remove(arrived)
                self._held_count += 1
                held = (time_ns + each.by_ns, self._held_count, sender, frame)
                heappush(self._held, held)
            break
        return frames
