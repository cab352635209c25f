"""Nodes, a port and a clock with no content, for the tests of the runners."""

from collections.abc import Callable, Iterable
from dataclasses import dataclass, field

from utank_hil.canbus.frame import Frame, PortError

MS = 1_000_000
BIT_NS = 4_000
START_NS = 123_456_789


def frame(can_id, number=0):
    """Eight bytes that carry a number."""
    return Frame(can_id, number.to_bytes(8, "little"))


def nothing(_now_ns):
    return ()


@dataclass
class ToyNode:
    """Notes what it is handed; sends what `says` returns."""

    name: str
    period_ns: int = 10 * MS
    says: Callable[[int], Iterable[Frame]] = nothing
    heard: list[tuple[int, Frame]] = field(default_factory=list)
    ticked: list[int] = field(default_factory=list)

    def receive(self, frame, now_ns):
        self.heard.append((now_ns, frame))

    def tick(self, now_ns):
        self.ticked.append(now_ns)
        return self.says(now_ns)


@dataclass
class SelectiveNode(ToyNode):
    """A toy node that says what it hears."""

    hears: frozenset[int] = frozenset()


class FakeClock:
    """Time that passes only in sleeps, and where a test lets it."""

    def __init__(self, start_ns=START_NS):
        self.time_ns = start_ns
        self.sleeps_ns: list[int] = []
        self.late_ns: Callable[[], int] = lambda: 0

    def now_ns(self):
        return self.time_ns

    def sleep_until(self, time_ns):
        self.sleeps_ns.append(time_ns)
        self.time_ns = max(self.time_ns, time_ns + self.late_ns())


class ToyPort:
    """A bus whose other end is the test."""

    def __init__(self):
        self.sent: list[Frame] = []
        self.arriving: list[Frame] = []
        self.send_fails = False
        self.receive_fails = False
        self.others = 0

    def send(self, frame):
        if self.send_fails:
            raise PortError("transmit queue full")
        self.sent.append(frame)

    def receive(self):
        if self.receive_fails:
            raise PortError("interface down")
        arrived, self.arriving = self.arriving, []
        return arrived

    def close(self):
        pass
