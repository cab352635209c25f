"""Nodes, a port and a clock with no content, for the tests of the runners."""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field

from utank_hil.canbus.frame import Frame, PortError

MS = 1_000_000
BIT_NS = 4_000
START_NS = 123_456_789


def frame(can_id: int, number: int = 0) -> Frame:
    """Eight bytes that carry a number."""
    return Frame(can_id, number.to_bytes(8, "little"))


def nothing(_now_ns: int) -> Iterable[Frame]:
    return ()


@dataclass
class ToyNode:
    """Notes what it is handed; sends what `says` returns."""

    name: str
    period_ns: int = 10 * MS
    says: Callable[[int], Iterable[Frame]] = nothing
    heard: list[tuple[int, Frame]] = field(default_factory=list)
    ticked: list[int] = field(default_factory=list)

    def receive(self, frame: Frame, now_ns: int) -> None:
        self.heard.append((now_ns, frame))

    def tick(self, now_ns: int) -> Iterable[Frame]:
        self.ticked.append(now_ns)
        return self.says(now_ns)


@dataclass
class SelectiveNode(ToyNode):
    """A toy node that says what it hears."""

    hears: frozenset[int] = frozenset()


class FakeClock:
    """Time that passes only in sleeps, and where a test lets it."""

    def __init__(self, start_ns: int = START_NS) -> None:
        self.time_ns = start_ns
        self.sleeps_ns: list[int] = []
        self.late_ns: Callable[[], int] = lambda: 0

    def now_ns(self) -> int:
        return self.time_ns

    def sleep_until(self, time_ns: int) -> None:
        self.sleeps_ns.append(time_ns)
        self.time_ns = max(self.time_ns, time_ns + self.late_ns())


class ToyPort:
    """A bus whose other end is the test."""

    def __init__(self) -> None:
        self.sent: list[Frame] = []
        self.arriving: list[Frame] = []
        self.send_fails = False
        self.receive_fails = False
        self.others = 0

    def send(self, frame: Frame) -> None:
        if self.send_fails:
            raise PortError("transmit queue full")
        self.sent.append(frame)

    def receive(self) -> Sequence[Frame]:
        if self.receive_fails:
            raise PortError("interface down")
        arrived, self.arriving = self.arriving, []
        return arrived

    def close(self) -> None:
        pass
