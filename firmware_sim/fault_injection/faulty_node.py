"""A node whose frames are spoiled, or that hangs, between two times."""

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Final, NamedTuple

from utank_hil.canbus import Frame
from utank_hil.runners import Node
from utank_hil.runners.hooks import LinkObserver
from utank_hil.runners.node import Selective

NEVER_NS: Final = 1 << 62

Spoil = Callable[[Frame, float], Iterable[Frame]]
"""Frames that reach the bus instead of one of the node, at a time in s after the fault began."""


class Span(NamedTuple):
    """When a fault is there, on the clock of the nodes."""

    begin_ns: int
    end_ns: int = NEVER_NS

    def holds(self, now_ns: int) -> bool:
        """Whether it is there now."""
        return self.begin_ns <= now_ns < self.end_ns


@dataclass(frozen=True, slots=True)
class Spoiled:
    """Spoils the frames of one identifier, or of all if there is none."""

    span: Span
    spoil: Spoil
    can_id: int | None = None

    def frames(self, frame: Frame, now_ns: int) -> Iterable[Frame]:
        """What leaves instead of a frame."""
        if self.can_id not in (None, frame.can_id) or not self.span.holds(now_ns):
            return (frame,)
        return self.spoil(frame, (now_ns - self.span.begin_ns) * 1e-9)


class FaultyNode:
    """A node with faults; without any it is as the node itself.

    Attributes
    ----------
    node : Node
        The one that runs at present.
    hears : frozenset of int
        As the node's, if it has such a filter.
    spoiled : list of Spoiled
        Applied one after another.
    hangs : list of Span
        It neither ticks nor hears.
    deaf : list of Span
        It hears nothing.
    cut_off : list of tuple of (Span, str)
        The bus can't be reached, and why.
    warned : list of tuple of (Span, str)
        Its interface reports this in every tick, and carries frames all the same.
    """

    def __init__(self, node: Node) -> None:
        self.node = node
        self.name = node.name
        self.period_ns = node.period_ns
        if isinstance(node, Selective):
            self.hears = node.hears
        self.spoiled: list[Spoiled] = []
        self.hangs: list[Span] = []
        self.deaf: list[Span] = []
        self.cut_off: list[tuple[Span, str]] = []
        self.warned: list[tuple[Span, str]] = []
        self._actions: list[tuple[int, Callable[[], object]]] = []

    def at(self, time_ns: int, action: Callable[[], object]) -> None:
        """Do something before the tick at a time."""
        self._actions.append((time_ns, action))
        self._actions.sort(key=lambda timed: timed[0])

    def receive(self, frame: Frame, now_ns: int) -> None:
        """Take a frame, unless a fault keeps it away."""
        for span in (*self.hangs, *self.deaf):
            if span.holds(now_ns):
                return
        if not any(span.holds(now_ns) for span, _ in self.cut_off):
            self.node.receive(frame, now_ns)

    def other_frames(self, count: int) -> None:
        """Hand on that frames of other kinds were on the bus."""
        other_frames = getattr(self.node, "other_frames", None)
        if other_frames is not None:
            other_frames(count)

    def link_error(self, now_ns: int, reason: str) -> None:
        """Hand on that the bus can't be reached."""
        if isinstance(self.node, LinkObserver):
            self.node.link_error(now_ns, reason)

    def tick(self, now_ns: int) -> Iterable[Frame]:
        """Run a period, and spoil what it sends."""
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
