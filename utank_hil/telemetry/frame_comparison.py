"""Frames of a replay against those of its recording, tick by tick, and the first that differs."""

from collections import Counter, deque
from dataclasses import dataclass, field
from typing import Final

from utank_hil.canbus import Frame, load_catalogue
from utank_hil.retuning.answer import Answer, read_answer
from utank_hil.retuning.retuner import Request
from utank_hil.telemetry.explained_tick import said
from utank_hil.telemetry.frame_log import PAYLOAD_BYTES


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
            self._alive.append(any(data))
        else:
            self._answer += data

    def left_over(self) -> str:
        """Return, and clear, the recorded requests of this tick that were not repeated."""
        left = "took the retuner's answer" if self._answer else ""
        left = "asked whether the retuner lives" if self._alive else left
        self._alive.clear()
        self._answer.clear()
        return left


_NAMED: Final = 1000  #: Damaged frames that are listed each.
_NOTHING: Final = "nothing"


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


class FrameComparison:
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
        """Compare what the controller asked for in a tick with what was recorded."""
        left = answers.left_over()
        if answers.astray or left:
            self._note(who, "asked", left or _NOTHING, answers.astray or _NOTHING)
            answers.astray = ""

    def compare(self, recorded: list[Frame], sent: list[Frame]) -> None:
        """Compare the frames of a tick, recorded and sent again."""
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
