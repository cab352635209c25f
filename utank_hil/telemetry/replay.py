"""Replay: recorded inputs are given to the controller again, and its answers are compared.

The controller gets each record in the order of the log and at its recorded time, so the result does
not depend on machine or present. Every frame that it returns is compared byte by byte.
"""

from collections import Counter, deque
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Final, NamedTuple

import numpy as np

from utank_hil.assembly import build_controller_node, build_law
from utank_hil.base.arrays import FloatArray
from utank_hil.canbus import Frame, load_catalogue
from utank_hil.configuration import ControllerConfig
from utank_hil.control import BuiltLaw
from utank_hil.control.python_law import PythonDesign
from utank_hil.nodes.controller import ControllerNode
from utank_hil.nodes.signals import SIGNALS, shown_by
from utank_hil.retuning.answer import Answer, read_answer
from utank_hil.retuning.retuner import Request
from utank_hil.runners import LoopStatistics
from utank_hil.telemetry.frame_log import LAYOUT, PAYLOAD_BYTES, FrameLog, Kind, Records
from utank_hil.telemetry.law_values import Values, differences, law_values
from utank_hil.telemetry.law_verdict import LawVerdict, law_verdict
from utank_hil.telemetry.replay_head import causes, law_differences, recorded_law

NONE: Final = "none"


def said(value: object) -> str:
    """Return a value exactly as text, a member of an enumeration by its name."""
    return str(getattr(value, "name", None) or repr(value))


class Number(NamedTuple):
    """A value of the explained tick, exact as text; what was not recorded stands under replayed."""

    stage: str  #: "received", "controller", "law" or "sent".
    name: str
    recorded: str
    replayed: str


class ExplainedTick:
    """Takes the `numbers` of a `tick` of a replay, from 0; `ended` if the replay came to it."""

    def __init__(self, tick: int) -> None:
        self.tick = tick
        self.numbers: list[Number] = []
        self.ended = False
        self._before: Values = {}

    def received(self, frame: Frame) -> None:
        """Take a frame that came in before the tick."""
        for name, value in self._signals(frame).items():
            self.numbers.append(Number("received", name, value, value))

    def begin(self, node: ControllerNode) -> None:
        """Take the law's numbers before the tick."""
        self._before = {name: np.copy(value) for name, value in law_values(node.law.law).items()}

    def end(self, node: ControllerNode, recorded: Sequence[Frame], sent: Sequence[Frame]) -> None:
        """Take the controller's values after the tick, and the frames of both runs."""
        self.ended = True
        values = dict(zip(SIGNALS, shown_by(node), strict=True))
        values["law_pressure_pa"] = node.law.pressure_pa
        values["pressure_share"] = node.law.share(node.judgement)
        self.numbers += [Number("controller", name, "", said(x)) for name, x in values.items()]
        now = law_values(node.law.law)
        changed = {each.name.partition("[")[0] for each in differences(self._before, now)}
        for name in sorted(changed & now.keys()):
            self.numbers += _of_array(name, self._before.get(name), now[name])
        before, again = self._all_signals(recorded), self._all_signals(sent)
        for name in dict.fromkeys((*before, *again)):
            both = before.get(name, NONE), again.get(name, NONE)
            self.numbers.append(Number("sent", name, *both))

    def _all_signals(self, frames: Sequence[Frame]) -> dict[str, str]:
        return {name: value for frame in frames for name, value in self._signals(frame).items()}

    def _signals(self, frame: Frame) -> dict[str, str]:
        """Signals of a frame by name; its bytes if it is none of the catalogue, or damaged."""
        message = load_catalogue().decoded(frame)
        if message is None:
            return {f"{frame.can_id:08X}": frame.data.hex(" ")}
        name = load_catalogue().by_id[frame.can_id].codec.name
        return {f"{name}.{field}": said(getattr(message, field)) for field in message._fields}


def _of_array(name: str, before: FloatArray | None, now: FloatArray) -> list[Number]:
    """A changed array; of a long one, as a memory of samples, only the elements that changed."""
    if before is not None and before.shape == now.shape:
        places = np.argwhere(before != now)
        if len(places) < _FEW < now.size:
            return [
                Number("law", f"{name}{place.tolist()}", "", said(now[tuple(place)].item()))
                for place in places
            ]
    return [Number("law", name, "", said(now.tolist()))]


_FEW: Final = 20
_NAMED: Final = 1000
_MOST_SENT: Final = (
    1 << 16
)  #: Largest number of frames that a recorded tick sent; it sends some 20.
_NOTHING: Final = "nothing"


class Entry(NamedTuple):
    """One record, its fields in the order of `LAYOUT`."""

    number: int
    data: bytes
    kind: int
    time_ns: int


@dataclass(frozen=True, slots=True)
class Difference:
    """First difference between a replay and the recording."""

    tick: int  #: Number of the controller's tick, from 0.
    time_s: float  #: Time since its first tick.
    #: message, signal: message and signal that differ; the message is "retuner" or "estimator" if
    #: the controller sent it a different request.
    message: str
    signal: str
    recorded: str
    replayed: str

    def __str__(self) -> str:
        return (
            f"tick {self.tick} ({self.time_s:.3f} s), {self.message}, {self.signal}: "
            f"recorded {self.recorded}, replayed {self.replayed}"
        )


@dataclass(slots=True)
class ReplayResult:
    """Result of a replay."""

    #: ticks, frames: ticks run, and recorded frames of the controller that were compared.
    ticks: int = 0
    frames: int = 0
    #: Number of frames that differ, by message.
    different: Counter[str] = field(default_factory=Counter)
    first: Difference | None = None  #: First difference; None if every frame is equal bit for bit.
    #: Received frames whose checksum is wrong: the tick that they came before, and their message,
    #: of the first `_NAMED` of them, and how many they are.
    damaged: list[tuple[int, str]] = field(default_factory=list)
    damaged_frames: int = 0
    lost_rows: int = 0  #: Rows that the recorder lost; after these an exact replay is impossible.

    @property
    def exact(self) -> bool:
        """Whether everything is as recorded."""
        return self.first is None


class ReplayedLog(NamedTuple):
    """A replayed log: the result, other differences from the recording, and the law."""

    result: ReplayResult
    causes: list[str]
    law: LawVerdict


class RecordedRetuner:
    """Gives the answers of a recording, in the ticks in which they were taken."""

    def __init__(self) -> None:
        #: Request of the controller that was not recorded; empty if there is none.
        self.astray = ""
        self._alive: deque[bool] = deque()
        self._answer = bytearray()

    @property
    def alive(self) -> bool:
        """Whether the retuner lived."""
        if not self._alive:
            self.astray = "asked whether the retuner lives"
            return False
        return self._alive.popleft()

    def submit(self, number: int, request: Request, now_ns: int) -> None:
        """Take a request, whose answer is known."""

    def answer(self, number: int, now_ns: int) -> Answer | None:  # noqa: ARG002
        """Return the answer if it was taken in this tick."""
        if not self._answer:
            return None
        answer = read_answer(bytes(self._answer))
        self._answer.clear()
        return answer

    def take(self, data: bytes, *, alive: bool) -> None:
        """Take a record for the next tick: the retuner's state, or a piece of its answer."""
        if alive:
            self._alive.append(bool(data[0]))
        else:
            self._answer += data

    def left_over(self) -> str:
        """Return, and clear, the recorded requests of this tick that were not repeated."""
        left = "took the retuner's answer" if self._answer else ""
        left = "asked whether the retuner lives" if self._alive else left
        self._alive.clear()
        self._answer.clear()
        return left


def entries_of(blocks: Iterable[Records]) -> Iterator[Entry]:
    """Yield the records one by one."""
    for block in blocks:
        yield from map(Entry._make, LAYOUT.iter_unpack(block.tobytes()))


def replay_log(
    log: FrameLog,
    config: ControllerConfig,
    folder: Path,
    *,
    as_recorded: bool = True,
    explained: ExplainedTick | None = None,
) -> ReplayedLog:
    """Run `replay` with a controller as the log's head describes it.

    If `config` is the recorded one (`as_recorded`), the recorded law runs if possible, else that of
    `config`.
    """
    law = designed = build_law(config)
    why_not = "another configuration was named"
    if as_recorded or isinstance(config.law, PythonDesign):
        law, why_not = recorded_law(log.head, config, designed)
    result = replay(
        entries_of(log.blocks()),
        config,
        law,
        retuner=log.head["retuner"],
        estimating=log.head.get("estimating", False),
        commissioned=log.head.get("commissioned", True),
        explained=explained,
    )
    apart = law_differences(log.head, designed)
    verdict = law_verdict(law, designed, config, why_not, apart)
    return ReplayedLog(result, causes(log.head, config, folder), verdict)


def replay(
    entries: Iterable[Entry],
    config: ControllerConfig,
    law: BuiltLaw,
    *,
    retuner: bool = False,
    estimating: bool = False,
    commissioned: bool = True,
    open_end: bool = False,
    explained: ExplainedTick | None = None,
) -> ReplayResult:
    """Give recorded entries of a whole run to a new controller and compare what it sends.

    `law` is that of the configuration. `retuner`, `estimating` and `commissioned` say what the
    controller had and whether it could be armed. With `open_end` the log may end before what the
    controller sent in its last tick. `explained` takes the numbers of its tick.
    """
    answers, estimates = RecordedRetuner(), RecordedRetuner()
    statistics = LoopStatistics()
    node = build_controller_node(
        config,
        law,
        retuner=answers if retuner else None,
        estimating=estimates if estimating else None,
        statistics=statistics,
        commissioned=commissioned,
    )
    result = ReplayResult()
    comparison = _Comparison(result)
    sent: list[Frame] = []
    recorded: list[Frame] = []
    waiting = False
    explained = explained or ExplainedTick(-2)  # that of no tick

    panel = node.inbox.panel
    challenge = None if panel is None else panel.plan.authentication

    def compare() -> None:
        nonlocal challenge
        if challenge is not None and panel is not None:  # the first one was drawn by lot
            for place, frame in enumerate(sent):
                first = [each for each in recorded if each.can_id == frame.can_id]
                if frame.can_id == challenge.challenge_id and first:
                    sent[place], panel.nonce, challenge = first[0], first[0].data, None
                    break
        comparison.compare(recorded, sent)
        if result.ticks == explained.tick + 1 and not explained.ended:
            explained.end(node, recorded, sent)

    for number, data, kind, time_ns in entries:
        if kind == Kind.SENT:
            recorded.append(Frame(number, data))
            if len(recorded) > _MOST_SENT:
                raise ValueError(f"tick {result.ticks} sent more than {_MOST_SENT} frames")
            continue
        if waiting:
            compare()
            waiting = False
            recorded = []
        if kind == Kind.RECEIVED:
            comparison.received(number, data)
            if result.ticks == explained.tick:
                explained.received(Frame(number, data))
            node.receive(Frame(number, data), time_ns)
        elif kind == Kind.TICK:
            if result.ticks == explained.tick:
                explained.begin(node)
            sent, waiting = list(node.tick(time_ns)), True
            comparison.tick = result.ticks
            comparison.time_s = (time_ns - node.start_ns) * 1e-9
            result.ticks += 1
            comparison.retuner("retuner", answers)
            comparison.retuner("estimator", estimates)
        elif kind == Kind.STOP:
            sent, waiting = list(node.stop(time_ns)), True
        elif kind == Kind.OTHERS:
            node.other_frames(number)
        elif kind == Kind.LINK_ERROR:
            node.link_error(time_ns, "")
        elif kind == Kind.STARTED:
            statistics.real_time = bool(data[0])
        elif kind in (Kind.ALIVE, Kind.ANSWER):
            answers.take(data, alive=kind == Kind.ALIVE)
        elif kind in (Kind.ESTIMATOR_ALIVE, Kind.ESTIMATE):
            estimates.take(data, alive=kind == Kind.ESTIMATOR_ALIVE)
        elif kind == Kind.LOST:
            result.lost_rows += number
    if waiting and (recorded or not open_end):
        compare()
    return result


class _Comparison:
    """Compares frames tick by tick."""

    def __init__(self, result: ReplayResult) -> None:
        self._result = result
        self._catalogue = load_catalogue()
        self.tick, self.time_s = 0, 0.0

    def received(self, can_id: int, data: bytes) -> None:
        """Count a received frame whose checksum is wrong."""
        known = can_id in self._catalogue.can_ids and len(data) == PAYLOAD_BYTES
        if known and self._catalogue.decoded(Frame(can_id, data)) is None:
            self._result.damaged_frames += 1
            if len(self._result.damaged) < _NAMED:
                self._result.damaged.append((self._result.ticks, self._name(can_id)))

    def retuner(self, who: str, answers: RecordedRetuner) -> None:
        left = answers.left_over()
        if answers.astray or left:
            self._note(who, "asked", left or _NOTHING, answers.astray or _NOTHING)
            answers.astray = ""

    def compare(self, recorded: list[Frame], sent: list[Frame]) -> None:
        self._result.frames += len(recorded)
        if recorded == sent:
            return
        ids = dict.fromkeys(frame.can_id for frame in (*recorded, *sent))
        for can_id in ids:
            before = [frame.data for frame in recorded if frame.can_id == can_id]
            now = [frame.data for frame in sent if frame.can_id == can_id]
            name = self._name(can_id)
            for data, again in zip(before, now, strict=False):
                if data != again:
                    self._note(name, *self._signal(can_id, data, again))
            for data in before[len(now) :]:
                self._note(name, "frame", data.hex(" "), "none")
            for data in now[len(before) :]:
                self._note(name, "frame", "none", data.hex(" "))
        if sorted(recorded) == sorted(sent):
            order = (", ".join(map(self._name, (f.can_id for f in fs))) for fs in (recorded, sent))
            self._note("frames", "order", *order)

    def _note(self, message: str, signal: str, recorded: str, replayed: str) -> None:
        result = self._result
        result.different[message] += 1
        if result.first is None:
            result.first = Difference(self.tick, self.time_s, message, signal, recorded, replayed)

    def _name(self, can_id: int) -> str:
        known = self._catalogue.by_id.get(can_id)
        return f"{can_id:08X}" if known is None else known.codec.name

    def _signal(self, can_id: int, data: bytes, again: bytes) -> tuple[str, str, str]:
        before, now = (self._catalogue.decoded(Frame(can_id, each)) for each in (data, again))
        if before is not None and now is not None:
            for name in before._fields:
                values = said(getattr(before, name)), said(getattr(now, name))
                if values[0] != values[1]:
                    return name, *values
            if data[1] & 15 != again[1] & 15:
                return "counter", str(data[1] & 15), str(again[1] & 15)
        return "bytes", data.hex(" "), again.hex(" ")
