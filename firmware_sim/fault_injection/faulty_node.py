"""Node whose frames are spoiled, or that hangs, during a time span."""

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Final, NamedTuple

from utank_hil.canbus import Frame
from utank_hil.runners import Node
from utank_hil.runners.node import LinkObserver, Selective

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
        #: Spans in which the bus is unreachable, with the reason.
        self.cut_off: list[tuple[Span, str]] = []
        #: Spans in which its interface reports a warning in every tick and still carries frames.
        self.warned: list[tuple[Span, str]] = []
        self._actions: list[tuple[int, Callable[[], object]]] = []

    def at(self, time_ns: int, action: Callable[[], object]) -> None:
        """Schedule an action before the tick at a time."""
        self._actions.append((time_ns, action))
        self._actions.sort(key=lambda timed: timed[0])

    def receive(self, frame: Frame, now_ns: int) -> None:
        """Pass on a frame, unless a fault blocks it."""
        for span in (*self.hangs, *self.deaf):
            if span.holds(now_ns):
                return
        if not any(span.holds(now_ns) for span, _ in self.cut_off):
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
        cut_off = [reason for span, reason in self.cut_off if span.holds(now_ns)]
        for reason in (*cut_off, *(why for span, why in self.warned if span.holds(now_ns))):
            self.link_error(now_ns, reason)
        frames = list(self.node.tick(now_ns))
        if cut_off:
            return ()
        for spoiled in self.spoiled:
            frames = [out for frame in frames for out in spoiled.frames(frame, now_ns)]
        return frames
