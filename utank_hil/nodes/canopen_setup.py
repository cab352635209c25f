"""Configures a node by SDO: each entry is read, written where it differs, and read back.

One request is in flight; nothing waits. What the node lacks or does not keep is said with object,
index, value and remedy, and tried again after a while: somebody may have mended it.
"""

from collections.abc import Generator, Iterable
from typing import Any, Final

from utank_hil.canbus import Frame
from utank_hil.canbus.frame import BUS_SHIFT, STANDARD
from utank_hil.canbus.profiles import drive_plan as cia
from utank_hil.canbus.profiles.device import SILENT_NS, CalledTaker, ProfiledDevice, Taker, hear

ANSWER_NS: Final = 300_000_000  #: CiA 301 names no time; servers of drives answer within 50 ms.
PATIENCE_NS: Final = 300_000_000  #: For a mode to be entered, likewise.
AGAIN_NS: Final = 2_000_000_000  #: From a refusal, or from silence, to the next try.

_UNANSWERED: Final = (
    "look at its supply, wiring, bit rate and node number, and for what loses or delays frames"
)

_Talk = Generator[tuple[cia.Place, bytes], cia.Answer, None]


class _Refused(Exception):
    pass


class Emergency(Taker):
    """The last emergency of a node, in words; empty if it is over."""

    def __init__(self, bus: int, node: int) -> None:
        self.can_id = bus << BUS_SHIFT | STANDARD | cia.EMERGENCY + node
        self._node, self.words = node, ""

    @property
    def node_words(self) -> str:
        """The words with the node's number."""
        return self.words and f"node {self._node}: {self.words}"

    def take(self, frame: Frame, now_ns: int) -> None:  # noqa: ARG002
        """Take an emergency message."""
        said = cia.emergency_words(frame.data)
        self.words = self.words if said is None else said


class CanopenSetup:
    """The start of one node by its steps: `done`, or the `problem` that it was refused for.

    `takers` has, by identifier, what takes its answers, and its emergencies.
    """

    def __init__(self, bus: int, node: int, steps: Iterable[cia.Step]) -> None:
        self._node, self._steps = node, tuple(steps)
        self._tag = bus << BUS_SHIFT | STANDARD
        self.problem = self.unanswered = ""
        self.emergency = Emergency(bus, node)
        self.takers: dict[int, Taker] = {
            self._tag | cia.SDO_ANSWER + node: CalledTaker(self._take_answer),
            self.emergency.can_id: self.emergency,
        }
        self.restart(0)

    def restart(self, begin_ns: int) -> None:
        """Begin anew, not before this time: the node has started, or was refused."""
        self.done = False
        self._begin_ns = begin_ns
        self._talk: _Talk | None = None
        self._request: tuple[cia.Place, bytes] | None = None
        self._asked_ns: int | None = None
        self._now_ns = begin_ns

    def order(self, command: cia.NodeCommand) -> Frame:
        """Network management for this node."""
        return Frame(self._tag | cia.NMT, bytes((command, self._node)))

    def frames(self, now_ns: int) -> list[Frame]:
        """What is to be sent now: the next request, if the last one is answered or out of time."""
        self._now_ns = now_ns
        if self.done or now_ns < self._begin_ns:
            return []
        if self._talk is None:
            self._talk = self._conversation()
            self._request = next(self._talk)
            return [self.order(cia.NodeCommand.PRE_OPERATIONAL)]
        if self._asked_ns is not None:
            if now_ns - self._asked_ns <= ANSWER_NS:
                return []
            assert self._request is not None
            self._advance(cia.Answer(self._request[0], abort=cia.Abort.NO_ANSWER_IN_TIME))
        if self._request is None:
            if self._talk is None:
                return []
            self.done, self.problem, self.emergency.words = True, "", ""
            return [self.order(cia.NodeCommand.START)]
        self._asked_ns = now_ns
        return [Frame(self._tag | cia.SDO_REQUEST + self._node, self._request[1])]

    def _take_answer(self, frame: Frame, now_ns: int) -> None:  # noqa: ARG002
        """Take what the node's server says; what was not asked for is nothing."""
        got = cia.answer(frame.data)
        asked = self._request if self._asked_ns is not None else None
        if got is not None and asked is not None and got.place == asked[0]:
            self.unanswered = ""
            self._advance(got)

    def _advance(self, got: cia.Answer) -> None:
        assert self._talk is not None
        self._asked_ns = self._request = None
        try:
            self._request = self._talk.send(got)
        except StopIteration:
            pass  # all is written: the node can be started
        except _Refused as refused:
            self.problem = str(refused)
            self.restart(self._now_ns + AGAIN_NS)

    def _conversation(self) -> _Talk:
        for number, step in enumerate(self._steps):
            got = yield step.place, cia.read_request(step.place)
            if not number and got.abort == cia.Abort.NO_ANSWER_IN_TIME:
                # it is silent, and nothing is known against it
                self.unanswered = self._words(step, got) + f": {_UNANSWERED}"
                raise _Refused
            said = ""
            first_ns = self._now_ns
            while not step.writes and not self._kept(step, got):
                if got.abort or self._now_ns - first_ns > PATIENCE_NS:
                    break
                got = yield step.place, cia.read_request(step.place)
            if step.writes and not self._kept(step, got) and (got.size or step.size):
                value = (got.value or 0) & ~step.equal_bits | step.value & step.equal_bits
                size = got.size or step.size
                written = yield step.place, cia.write_request(step.place, value, size)
                if written.abort:
                    said = f", and writing it gave {cia.abort_words(written.abort)}"
                got = yield step.place, cia.read_request(step.place)
            # only its length counts, and a process value need not be readable, but has to be there
            there = got.abort != cia.Abort.NO_OBJECT
            unread = not step.equal_bits and got.value is None and there
            if step.needed and not unread and not self._kept(step, got):
                lost = got.abort == cia.Abort.NO_ANSWER_IN_TIME
                remedy = _UNANSWERED if lost else step.remedy
                raise _Refused(self._words(step, got) + said + f": {remedy}")

    @staticmethod
    def _kept(step: cia.Step, got: cia.Answer) -> bool:
        """Whether an entry has the value, and the length."""
        if got.value is None or (step.size and got.size != step.size):
            return False
        return not (got.value ^ step.value) & step.equal_bits & (1 << 8 * got.size) - 1

    def _words(self, step: cia.Step, got: cia.Answer) -> str:
        if got.value is None:
            what = f"can't be read ({cia.abort_words(got.abort)})"
        elif step.size and got.size != step.size:
            what = f"has {got.size} bytes"
        else:
            bits = (1 << 8 * got.size) - 1
            what = f"is {got.value:#x}, not {step.value & step.equal_bits & bits:#x}"
        return f"node {self._node}: {step.place} {what}"


class SensorSetup:
    """A CANopen sensor: it is configured, and read back, before what it measures counts.

    It takes the sensor's answers and its start from among the device's frames.
    """

    def __init__(self, device: ProfiledDevice[Any]) -> None:
        plan = device.plan
        assert plan.node is not None
        self.device = device
        self.setup = CanopenSetup(plan.bus, plan.node, plan.steps)
        beat = plan.bus << BUS_SHIFT | STANDARD | cia.HEARTBEAT + plan.node
        hears_beat = beat, CalledTaker(self._take_heartbeat)
        for can_id, taker in (*self.setup.takers.items(), hears_beat):
            hear(device.takers, can_id, taker)
        device.named = False
        self._done_ns = 0

    @property
    def words(self) -> str:
        """What is wrong with the sensor, by its own words; else empty."""
        setup = self.setup
        return setup.problem or setup.emergency.node_words or setup.unanswered

    def frames(self, now_ns: int) -> list[Frame]:
        """What the configuration needs in this tick, usually nothing."""
        setup = self.setup
        if setup.done and self.device.silent(now_ns) and now_ns - self._done_ns > SILENT_NS:
            setup.restart(now_ns)
        frames = setup.frames(now_ns)
        if setup.done and not self.device.named:
            self._done_ns = now_ns
        self.device.named = setup.done
        return frames

    def _take_heartbeat(self, frame: Frame, now_ns: int) -> None:
        if frame.data[:1] == bytes((cia.NetworkState.BOOT_UP,)):
            self.setup.restart(now_ns)
