"""A tap changes nothing on the way, and writes down all of it in its order."""

import tracemalloc
from dataclasses import dataclass, field
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from utank_hil.canbus import Frame
from utank_hil.control import PredictiveLaw
from utank_hil.retuning import Answer, Candidate, ModelSummary, Refusal
from utank_hil.retuning.answer import answer_bytes
from utank_hil.runners import LoopStatistics
from utank_hil.telemetry.frame_comparison import RecordedRetuner
from utank_hil.telemetry.frame_log import LAYOUT, Kind
from utank_hil.telemetry.node_tap import NodeTap, RetunerTap

TICK = 10_000_000
SUMMARY = ModelSummary(8.0, 0.01, 2e9, 1e9, 5e7, 0.1, 0.99, 1.2, 0.3)
LAW = PredictiveLaw(np.full((3, 1, 1), 0.1), np.full((3, 1, 1), 1 / 3), np.zeros((5, 1, 1)), 0.2)
CANDIDATE = Candidate(LAW, 0.02, SUMMARY)


@dataclass
class Node:
    """Notes what it is handed; sends one frame a tick."""

    retuner: Any = None
    name: str = "controller"
    period_ns: int = TICK
    last_ns: int = 0
    telemetry: Any = field(
        default_factory=lambda: SimpleNamespace(statistics=LoopStatistics(real_time=True))
    )
    calls: list[tuple[Any, ...]] = field(default_factory=list)

    def receive(self, frame, now_ns):
        self.calls.append(("receive", frame, now_ns))

    def other_frames(self, count):
        self.calls.append(("other_frames", count))

    def link_error(self, now_ns, reason):
        self.calls.append(("link_error", now_ns, reason))

    def tick(self, now_ns):
        self.calls.append(("tick", now_ns))
        self.last_ns = now_ns
        if self.retuner is not None:
            self.calls.append((self.retuner.alive, self.retuner.answer(1, now_ns)))
        return (Frame(0x100 + len(self.calls), b"\x01\x02"),)

    def stop(self, now_ns):
        self.calls.append(("stop", now_ns))
        return (Frame(0x1FFFFFFF, b""),)


@dataclass
class Retuner:
    """Has one answer."""

    reply: Answer | None
    alive: bool = True
    submitted: int = 0

    def submit(self, number, record, now_ns):
        self.submitted = number

    def answer(self, number, now_ns):
        reply, self.reply = self.reply, None
        return reply


def drive(node):
    """What a runner does with a node."""
    sent = []
    node.receive(Frame(0x0CFF3182, b"12345678"), 5)
    sent.append(list(node.tick(TICK)))
    node.link_error(TICK, "no buffer space")
    node.other_frames(3)
    node.receive(Frame(7, b""), 2 * TICK)
    sent.append(list(node.tick(3 * TICK)))  # one was skipped
    sent.append(list(node.stop(4 * TICK)))
    return sent


def test_the_node_meets_the_same_with_a_tap_and_all_of_it_is_written_down():
    bare, tapped = Node(), Node()
    chunks: list[tuple[bytes, int]] = []
    assert drive(NodeTap(tapped, lambda data, now_ns: chunks.append((data, now_ns)))) == drive(bare)
    assert tapped.calls == bare.calls
    assert [now_ns for _, now_ns in chunks] == [TICK, 3 * TICK, 4 * TICK]  # one write a tick
    found = [
        (Kind(kind), number, now_ns, data)
        for number, data, kind, now_ns in LAYOUT.iter_unpack(b"".join(data for data, _ in chunks))
    ]
    assert found == [
        (Kind.RECEIVED, 0x0CFF3182, 5, b"12345678"),
        (Kind.STARTED, 0, TICK, b"\x01"),
        (Kind.TICK, 0, TICK, b""),
        (Kind.SENT, 0x102, TICK, b"\x01\x02"),
        (Kind.LINK_ERROR, 0, TICK, b""),
        (Kind.OTHERS, 3, TICK, b""),
        (Kind.RECEIVED, 7, 2 * TICK, b""),
        (Kind.TICK, 0, 3 * TICK, b""),
        (Kind.SENT, 0x106, 3 * TICK, b"\x01\x02"),
        (Kind.STOP, 0, 4 * TICK, b""),
        (Kind.SENT, 0x1FFFFFFF, 4 * TICK, b""),
    ]


def test_records_of_several_ticks_are_handed_on_together_and_the_rest_at_the_end():
    def written(every):
        chunks: list[tuple[bytes, int]] = []
        drive(NodeTap(Node(), lambda data, now_ns: chunks.append((data, now_ns)), (), every))
        return chunks

    (_, stopped_ns), *_ = chunks = written(5)
    assert (len(chunks), stopped_ns) == (1, 4 * TICK)
    assert [now_ns for _, now_ns in written(2)] == [3 * TICK, 4 * TICK]
    every_tick = b"".join(data for data, _ in written(1))
    assert every_tick == chunks[0][0] == b"".join(data for data, _ in written(2))


@pytest.mark.parametrize("reply", [None, Refusal(("no", "too short")), CANDIDATE])
def test_answers_of_the_retuner_come_back_bit_for_bit_in_their_tick(reply):
    asked = Retuner(reply)
    tap = RetunerTap(asked)
    tap.submit(4, np.zeros((2, 2)), 0)
    assert asked.submitted == 4
    chunks: list[bytes] = []
    node = NodeTap(Node(tap), lambda data, _: chunks.append(data), [tap])
    node.tick(TICK)
    node.tick(2 * TICK)
    again = RecordedRetuner()
    seen = []
    for _, data, kind, _ in LAYOUT.iter_unpack(b"".join(chunks)):
        if kind in (Kind.ALIVE, Kind.ANSWER):
            again.take(data, alive=kind == Kind.ALIVE)
        elif kind == Kind.TICK:
            seen.append((again.alive, again.answer(1, 0)))
            assert again.left_over() == again.astray == ""
    assert [alive for alive, _ in seen] == [True, True]
    assert seen[1][1] is None
    first = seen[0][1]
    if reply is None:
        assert first is None
    else:
        assert first is not None
        assert answer_bytes(first) == answer_bytes(reply)


def test_a_question_that_was_not_asked_then_is_found():
    retuner = RecordedRetuner()
    assert not retuner.alive
    assert retuner.astray == "asked whether the retuner lives"
    retuner.take(answer_bytes(Refusal(("no",))), alive=False)
    assert retuner.left_over() == "took the retuner's answer"
    assert retuner.answer(1, 0) is None  # gone with its tick


def test_bursts_of_any_length_leave_no_memory_behind():
    """A packing for each number of records took 186 MiB in the end."""
    lengths: list[int] = []
    tap = NodeTap(Node(), lambda data, _: lengths.append(len(data) // LAYOUT.size))
    tap.tick(TICK)
    tracemalloc.start()
    try:
        before = tracemalloc.get_traced_memory()[0]
        for count in range(300):
            for _ in range(count):
                tap.receive(Frame(7, b"x"), TICK)
            tap.tick(TICK)
            tap._node.calls.clear()
        grown = tracemalloc.get_traced_memory()[0] - before
    finally:
        tracemalloc.stop()
    assert lengths[1:] == [count + 2 for count in range(300)]
    assert grown < 200_000


def test_frames_before_a_tick_that_raises_are_not_lost():
    class Failing(Node):
        def tick(self, now_ns):
            raise ZeroDivisionError

    chunks: list[bytes] = []
    tap = NodeTap(Failing(), lambda data, _: chunks.append(data))
    tap.receive(Frame(7, b"x"), TICK)
    with pytest.raises(ZeroDivisionError):
        tap.tick(TICK)
    tap.stop(TICK)  # which a runner does, however the run ends
    kinds = [Kind(kind) for _, _, kind, _ in LAYOUT.iter_unpack(b"".join(chunks))]
    assert kinds == [Kind.RECEIVED, Kind.STARTED, Kind.STOP, Kind.SENT]
