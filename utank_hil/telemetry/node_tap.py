"""Taps that record inputs and answers of a controller node, which behaves as without them.

They stand between runner and node, and between controller and retuner.
"""

from collections.abc import Callable, Iterable, Sequence
from struct import Struct
from typing import Any, Final

from utank_hil.canbus import Frame
from utank_hil.nodes.controller import ControllerNode
from utank_hil.retuning import Retuner
from utank_hil.retuning.answer import Answer, answer_bytes
from utank_hil.retuning.retuner import Request
from utank_hil.telemetry.frame_log import IN_A_SLOT, LAYOUT, PAYLOAD_BYTES, Kind

Sink = Callable[[bytes, int], None]
"""Function that takes the packed records of ticks and the time of the last; it must not wait."""
_FIELDS: Final = 4  #: Number of fields of a record, in the order of `LAYOUT`.
# read once: in Python 3.11 a member costs eight times as much from its class as from here
_RECEIVED, _SENT, _TICK = int(Kind.RECEIVED), int(Kind.SENT), int(Kind.TICK)
_PACKING: Final = [
    Struct(f"<{count * LAYOUT.format.lstrip('<')}").pack for count in range(IN_A_SLOT + 1)
]  # Functions that pack the fields of a number of records at once, up to a slot of the ring.
_AT_ONCE: Final = IN_A_SLOT * _FIELDS


class NodeTap:
    """A controller node whose inputs and outputs are recorded, with the records of `taps`.

    The records of `every` ticks are passed on together; the stop passes on the rest.
    """

    def __init__(
        self, node: ControllerNode, sink: Sink, taps: "Sequence[RetunerTap]" = (), every: int = 1
    ) -> None:
        self.name = node.name
        self.period_ns = node.period_ns
        self._node = node
        self._pass_on = node.receive
        self._sink = sink
        self._taps = taps
        # These are the fields of consecutive records, because packing many at once is quicker.
        self._fields: list[Any] = []
        self._started = False
        self._every = self._ticks_left = every

    def receive(self, frame: Frame, now_ns: int) -> None:
        """Take one frame from the bus."""
        self._fields += frame + (_RECEIVED, now_ns)  # noqa: RUF005 - twice as quick
        self._pass_on(frame, now_ns)

    def other_frames(self, count: int) -> None:
        """Record frames of other kinds on the bus."""
        self._note(Kind.OTHERS, self._node.last_ns, number=count)
        self._node.other_frames(count)

    def link_error(self, now_ns: int, reason: str) -> None:
        """Record that the bus could not be read or written."""
        self._note(Kind.LINK_ERROR, now_ns)
        self._node.link_error(now_ns, reason)

    def tick(self, now_ns: int) -> Iterable[Frame]:
        """Do one tick."""
        if not self._started:
            self._started = True
            self._note(Kind.STARTED, now_ns, bytes([self._node.telemetry.statistics.real_time]))
        frames = list(self._node.tick(now_ns))
        for tap in self._taps:
            self._fields += tap.take(now_ns)
        self._fields += (0, b"", _TICK, now_ns)
        self._note_sent(frames, now_ns)
        self._ticks_left -= 1
        if self._ticks_left == 0:
            self._ticks_left = self._every
            self._hand_on(now_ns)
        return frames

    def stop(self, now_ns: int) -> Iterable[Frame]:
        """Send the last frames."""
        frames = list(self._node.stop(now_ns))
        self._note(Kind.STOP, now_ns)
        self._note_sent(frames, now_ns)
        self._hand_on(now_ns)
        return frames

    def _note(self, kind: Kind, now_ns: int, data: bytes = b"", *, number: int = 0) -> None:
        self._fields += (number, data, kind, now_ns)

    def _note_sent(self, frames: list[Frame], now_ns: int) -> None:
        for frame in frames:
            self._fields += frame + (_SENT, now_ns)  # noqa: RUF005 - twice as quick

    def _hand_on(self, now_ns: int) -> None:
        fields = self._fields
        packed = b""
        for at in range(0, len(fields), _AT_ONCE):
            part = fields[at : at + _AT_ONCE]
            packed += _PACKING[len(part) // _FIELDS](*part)
        self._sink(packed, now_ns)
        fields.clear()


class RetunerTap:
    """A retuner, or an estimator, whose answers are recorded, as these kinds of records."""

    def __init__(
        self, retuner: Retuner, alive: Kind = Kind.ALIVE, answer: Kind = Kind.ANSWER
    ) -> None:
        self._retuner = retuner
        self._kinds = int(alive), int(answer)
        self._alive: list[bool] = []
        self._answers: list[bytes] = []

    @property
    def alive(self) -> bool:
        """Whether a request would be answered."""
        self._alive.append(self._retuner.alive)
        return self._alive[-1]

    def submit(self, number: int, request: Request, now_ns: int) -> None:
        """Request an answer under a new number."""
        self._retuner.submit(number, request, now_ns)

    def answer(self, number: int, now_ns: int) -> Answer | None:
        """Return the answer to request `number`, None while there is none."""
        answer = self._retuner.answer(number, now_ns)
        if answer is not None:
            self._answers.append(answer_bytes(answer))
        return answer

    def take(self, now_ns: int) -> list[Any]:
        """Return the fields of the records of questions and answers since the last call."""
        alive_kind, answer_kind = self._kinds
        fields: list[Any] = []
        for alive in self._alive:
            fields += (0, bytes([alive]), alive_kind, now_ns)
        for data in self._answers:
            for at in range(0, len(data), PAYLOAD_BYTES):
                fields += (len(data), data[at : at + PAYLOAD_BYTES], answer_kind, now_ns)
        self._alive.clear()
        self._answers.clear()
        return fields


class Tapped:
    """The desks for `build_controller_node`, each with a tap if its answers are recorded."""

    def __init__(
        self, retuner: Retuner | None, estimating: Retuner | None, *, wanted: bool
    ) -> None:
        self.retuner, self.estimating = retuner, estimating
        self.taps: list[RetunerTap] = []  #: Taps for `NodeTap`.
        if wanted and retuner is not None:
            self.retuner = tap = RetunerTap(retuner)
            self.taps.append(tap)
        if wanted and estimating is not None:
            self.estimating = tap = RetunerTap(estimating, Kind.ESTIMATOR_ALIVE, Kind.ESTIMATE)
            self.taps.append(tap)
