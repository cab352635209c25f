"""Parts of a bench in which faults are placed: nodes, simulated bus, and a law that fails.

A bit error is detected at the end of the frame, the worst case. An error frame destroys the frame,
which takes part in the next arbitration again. The sender's transmit error counter rises by 8 with
each and falls by 1 with each successful frame (ISO 11898-1); above 127 the sender is error-passive,
above 255 it is off the bus until the fault is over. A gateway or repeater may also lose, delay,
double or swap frames without any CAN controller detecting it.
"""

import random
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from heapq import heappop, heappush
from typing import TYPE_CHECKING, Any, Final, Literal, NamedTuple

import numpy as np

from utank_hil.base.arrays import FloatArray
from utank_hil.canbus import Frame
from utank_hil.control.interface import Controller
from utank_hil.runners import Node, SimulatedBus
from utank_hil.runners.node import LinkObserver, Selective

if TYPE_CHECKING:  # compiled: a scenario is read without them
    from firmware_sim.canopen_drive import CanopenPumpDrive
    from firmware_sim.drive import PumpDrive
    from firmware_sim.plant import Plant
    from firmware_sim.valve import ValveNode

NEVER_NS: Final = 1 << 62  #: Time beyond the end of every run.

Spoil = Callable[[Frame, float], Iterable[Frame]]
"""Function of a frame and the time in s since the fault that gives the frames sent instead."""


class Span(NamedTuple):
    """Time span of a fault on the clock of the nodes."""

    begin_ns: int
    end_ns: int = NEVER_NS

    def holds(self, now_ns: int) -> bool:
        """Whether the span includes a time."""
        return self.begin_ns <= now_ns < self.end_ns


@dataclass(frozen=True, slots=True)
class Spoiled:
    """Fault of the frames of one identifier, or of all if there is none."""

    span: Span
    spoil: Spoil
    can_id: int | None = None

    def frames(self, frame: Frame, now_ns: int) -> Iterable[Frame]:
        """Frames that leave instead of one frame."""
        if self.can_id not in (None, frame.can_id) or not self.span.holds(now_ns):
            return (frame,)
        return self.spoil(frame, (now_ns - self.span.begin_ns) * 1e-9)


class FaultyNode:
    """Node with faults; without any it behaves as the node itself."""

    def __init__(self, node: Node) -> None:
        self.node = node
        self.name = node.name
        self.period_ns = node.period_ns
        if isinstance(node, Selective):
            self.hears = node.hears
        self.spoiled: list[Spoiled] = []  #: Faults of its frames, applied in order.
        self.hangs: list[Span] = []  #: Spans in which it neither ticks nor receives.
        self.deaf: list[Span] = []  #: Spans in which it receives nothing.
        #: Spans in which its interface reports an error in every tick, with its text.
        self.reported: list[tuple[Span, str]] = []
        self._actions: list[tuple[int, Callable[[], object]]] = []

    def at(self, time_ns: int, action: Callable[[], object]) -> None:
        """Schedule an action before the tick at a time."""
        self._actions.append((time_ns, action))
        self._actions.sort(key=lambda timed: timed[0])

    def receive(self, frame: Frame, now_ns: int) -> None:
        """Pass on a frame, unless a fault blocks it."""
        if not any(span.holds(now_ns) for span in (*self.hangs, *self.deaf)):
            self.node.receive(frame, now_ns)

    def other_frames(self, count: int) -> None:
        """Pass on the number of frames of other formats on the bus."""
        other_frames = getattr(self.node, "other_frames", None)
        if other_frames is not None:
            other_frames(count)

    def link_error(self, now_ns: int, reason: str) -> None:
        """Pass on an error of the link."""
        if isinstance(self.node, LinkObserver):
            self.node.link_error(now_ns, reason)

    def tick(self, now_ns: int) -> Iterable[Frame]:
        """Tick the node, and spoil its frames."""
        while self._actions and now_ns >= self._actions[0][0]:
            self._actions.pop(0)[1]()
        if any(span.holds(now_ns) for span in self.hangs):
            return ()
        for span, reason in self.reported:
            if span.holds(now_ns):
                self.link_error(now_ns, reason)
        frames = list(self.node.tick(now_ns))
        for spoiled in self.spoiled:
            frames = [out for frame in frames for out in spoiled.frames(frame, now_ns)]
        return frames


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

    `link_error` takes time, sender and reason, when it becomes error-passive and while it is off
    the bus; `hear_others` is called with each `OtherFrame` that was carried.
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
        self.link_error: Callable[[int, int, str], None] = lambda *_: None
        self.hear_others: Callable[[OtherFrame], None] = lambda _: None

    def queue(self, sender: int, frame: Frame, now_ns: int) -> None:
        """Queue a frame as in `SimulatedBus`, preceded by its attempts that will fail."""
        if now_ns < self._off_until_ns.get(sender, 0):
            self.link_error(now_ns, sender, "bus-off")
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
        for _, _, frame in arrived:
            if isinstance(frame, OtherFrame):
                self.hear_others(frame)
        arrived = [each for each in arrived if not isinstance(each[2], OtherFrame)]
        if self.disturbances:
            arrived = [out for each in arrived for out in self._disturbed(each)]
        while self._held and self._held[0][0] < before_ns:
            time_ns, _, sender, frame = heappop(self._held)
            arrived.append((time_ns, sender, frame))
        return sorted(arrived, key=lambda each: each[0])

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
            self.link_error(time_ns, sender, "error-passive on sending")
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
            self.link_error(time_ns, sender, "bus-off")
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


LEANING_PA: Final = 1e4  #: Answer of a law that leans to one side. Chosen; no study.


LawFailure = Literal["raises", "answers_nan", "opposite", "leans"]


class BreakableLaw:
    """Controller that fails as `fails` says at each step, whichever law a restart has created."""

    def __init__(self, law: Controller, fails: set[LawFailure]) -> None:
        self._law, self._fails = law, fails

    def step(self, y: FloatArray, reference: FloatArray | None = None) -> FloatArray:
        """Return the law's answer, or the failure's."""
        answer, fails = self._law.step(y, reference), self._fails
        if "raises" in fails:
            raise ArithmeticError("injected")
        if "answers_nan" in fails:
            return np.full_like(answer, np.nan)
        if "leans" in fails:
            return np.full_like(answer, LEANING_PA)
        return -answer if "opposite" in fails else answer

    def __getattr__(self, name: str) -> Any:
        return getattr(self._law, name)


@dataclass(slots=True)
class Bench:
    """Parts of a bench in which faults are placed."""

    nodes: dict[str, FaultyNode]
    plant: "Plant"
    drive: "PumpDrive | CanopenPumpDrive | None"
    valve: "ValveNode | None"
    version: int
    bus: FaultyBus | None = None  #: Simulated bus, where a fault of it may be placed.
    law: set[LawFailure] = field(default_factory=set)  #: Failures of the controller's law.
    #: Function that replaces the controller by a new one.
    restart: Callable[[], None] | None = None
    joining: list[Node] = field(default_factory=list)
