"""A node whose work is timed."""

from collections.abc import Callable

from utank_hil.canbus import Frame
from utank_hil.runners import Node


class TimedNode:
    """A node whose ticks are timed, with the frames before each; `clock_ns` is the clock."""

    def __init__(self, node: Node, clock_ns: Callable[[], int]) -> None:
        self.name, self.period_ns = node.name, node.period_ns
        self._node, self._clock_ns = node, clock_ns
        self._heard_ns = 0
        self.ticks_ns: list[int] = []
        self.frames_ns: list[int] = []

    def receive(self, frame: Frame, now_ns: int) -> None:
        """Take a frame, on the next tick's account."""
        begin = self._clock_ns()
        self._node.receive(frame, now_ns)
        self.frames_ns.append(self._clock_ns() - begin)
        self._heard_ns += self.frames_ns[-1]

    def tick(self, now_ns: int) -> list[Frame]:
        """Tick and note what this and the frames before it cost."""
        begin = self._clock_ns()
        frames = list(self._node.tick(now_ns))
        self.ticks_ns.append(self._clock_ns() - begin + self._heard_ns)
        self._heard_ns = 0
        return frames
