import random
import zlib

import pytest
from hypothesis import given
from hypothesis import strategies as st
from toy_nodes import BIT_NS, MS, SelectiveNode, ToyNode, frame

from utank_hil.canbus.frame import LONGEST_STANDARD_ID, OTHER_BUS, STANDARD, Frame
from utank_hil.runners import Lockstep, NodeError, SimulatedBus, frame_bits


class RandomNode(ToyNode):
    """Sends at random, and a digest of what it heard: disorder shows in its frames."""

    def __init__(self, name, period_ns, seed):
        super().__init__(name, period_ns)
        self.random = random.Random(seed)
        self.digest = 0

    def receive(self, frame, now_ns):
        self.digest = zlib.crc32(repr((frame, now_ns)).encode(), self.digest)

    def tick(self, now_ns):
        return [
            Frame(
                self.random.randrange(2**29),
                self.digest.to_bytes(4, "little") + self.random.randbytes(self.random.randrange(5)),
            )
            for _ in range(self.random.choice([0, 0, 1, 2, 5]))
        ]


def random_run(seed, until_ns):
    chooser = random.Random(seed)
    nodes = [
        RandomNode(f"node {i}", chooser.choice([1, 2, 5, 7, 10]) * MS, chooser.randrange(2**32))
        for i in range(4)
    ]
    trace = bytearray()
    run = Lockstep(nodes, trace=lambda *row: trace.extend(repr(row).encode()))
    for time_ns in until_ns:
        run.run_until(time_ns)
    return bytes(trace), run


@given(st.integers(0, 2**32))
def test_same_seed_same_trace_byte_for_byte(seed):
    trace, run = random_run(seed, [50 * MS])
    again, rerun = random_run(seed, [50 * MS])
    assert trace == again
    assert run.bus.load(50 * MS) == rerun.bus.load(50 * MS)


def test_different_seeds_give_different_traces():
    assert random_run(1, [50 * MS])[0] != random_run(2, [50 * MS])[0]


@pytest.mark.slow
@given(st.integers(0, 2**32), st.lists(st.integers(0, 50 * MS // BIT_NS)))
def test_run_in_slices_equals_run_in_one_go(seed, cuts):
    whole, run = random_run(seed, [50 * MS])
    sliced, rerun = random_run(seed, [*(BIT_NS * cut for cut in sorted(cuts)), 50 * MS])
    assert sliced == whole
    assert run.bus.load(50 * MS) == rerun.bus.load(50 * MS)
    assert run.now_ns == rerun.now_ns == 50 * MS


def test_slices_may_end_exactly_at_ticks_and_ends_of_frames():
    sent = frame(1)
    end_ns = (frame_bits(sent) - 3) * BIT_NS
    listener = ToyNode("listener")
    run = Lockstep([ToyNode("sender", says=lambda now: [sent] if now == 0 else ()), listener])
    run.run_until(0)
    assert listener.ticked == []
    run.run_until(end_ns)
    assert listener.ticked == [0]
    assert listener.heard == []
    run.run_until(end_ns + 1)
    assert listener.heard == [(end_ns, sent)]
    run.run_until(10 * MS)
    assert listener.ticked == [0]
    run.run_until(10 * MS + 1)
    assert listener.ticked == [0, 10 * MS]


def test_nodes_tick_at_their_own_period_in_the_order_given():
    order: list[tuple[int, str]] = []

    def node(name, period_ns):
        def says(now_ns):
            order.append((now_ns, name))
            return ()

        return ToyNode(name, period_ns, says)

    Lockstep([node("b", 3 * MS), node("a", 2 * MS)]).run_until(7 * MS)
    due = {"b": range(0, 7, 3), "a": range(0, 7, 2)}
    in_order = sorted((ms, "ba".index(name)) for name in due for ms in due[name])
    assert order == [(ms * MS, "ba"[index]) for ms, index in in_order]


def test_frame_reaches_every_node_but_its_sender_at_its_last_bit():
    sent = frame(0x08FF1080, 0xDEADBEEF)
    nodes = [ToyNode("a"), ToyNode("b", says=lambda now: [sent] if now == 0 else ()), ToyNode("c")]
    Lockstep(nodes, SimulatedBus(bit_rate=125_000)).run_until(1000 * MS)
    end_of_frame_ns = (frame_bits(sent) - 3) * 8_000
    assert nodes[0].heard == nodes[2].heard == [(end_of_frame_ns, sent)]
    assert nodes[1].heard == []


ids = st.frozensets(st.integers(0, 5))


@given(st.lists(ids, min_size=1, max_size=4), st.lists(ids, min_size=1, max_size=3))
def test_selective_node_hears_what_it_names_and_any_other_node_everything(choices, said):
    talkers = [
        ToyNode(f"talker {i}", says=lambda now, said=said: map(frame, sorted(said)))
        for i, said in enumerate(said)
    ]
    listeners = [
        SelectiveNode(f"listener {i}", says=lambda now: [frame(0)], hears=chosen)
        for i, chosen in enumerate(choices)
    ]
    rows: list[tuple[int, str, Frame]] = []
    run = Lockstep([*talkers, *listeners], trace=lambda *row: rows.append(row))
    run.run_until(30 * MS)
    for node in [*talkers, *listeners]:
        chosen = node.hears if isinstance(node, SelectiveNode) else frozenset(range(6))
        assert node.heard == [
            (now_ns, sent)
            for now_ns, name, sent in rows
            if name != node.name and sent.can_id in chosen
        ]


def test_silent_node_does_not_hold_up_the_others():
    talker, silent = ToyNode("talker", says=lambda now: [frame(5)]), ToyNode("silent")
    Lockstep([silent, talker]).run_until(1000 * MS)
    assert len(silent.heard) == len(talker.ticked) == 100


def test_trace_sees_every_frame_with_its_sender():
    rows: list[tuple[int, str, Frame]] = []
    sent = frame(5)
    talker = ToyNode("talker", says=lambda now: [sent])
    Lockstep([talker, ToyNode("b")], trace=lambda *row: rows.append(row)).run_until(20 * MS)
    length_ns = (frame_bits(sent) - 3) * BIT_NS
    assert rows == [(length_ns, "talker", sent), (10 * MS + length_ns, "talker", sent)]


def broken(_, __=None):
    raise KeyError("no such gain")


def test_node_that_raises_in_its_tick_is_named():
    nodes = [ToyNode("sound"), ToyNode("broken", says=broken), ToyNode("also sound")]
    with pytest.raises(
        NodeError, match=r"'broken' failed in tick\(\) at 0.0.*no such gain"
    ) as error:
        Lockstep(nodes).run_until(1)
    assert isinstance(error.value.__cause__, KeyError)


def test_node_that_raises_in_receive_is_named_with_the_time():
    sent = frame(1)
    deaf = ToyNode("deaf")
    deaf.receive = broken
    time_s = (frame_bits(sent) - 3) * BIT_NS * 1e-9
    with pytest.raises(NodeError, match=rf"'deaf' failed in receive\(\) at {time_s:.6f} s"):
        Lockstep([ToyNode("talker", says=lambda now: [sent]), ToyNode("b"), deaf]).run_until(MS)


@pytest.mark.parametrize(
    ("sent", "message"),
    [
        (frame(STANDARD | LONGEST_STANDARD_ID + 1), "29-bit"),  # 12 bits, marked as 11
        (frame(OTHER_BUS), "29-bit"),  # an interface that this bus is not
        (Frame(5, bytes(9)), "9 data bytes"),
    ],
)
def test_frame_that_can_carries_not_is_its_senders_fault(sent, message):
    with pytest.raises(NodeError, match=f"'wild'.*{message}"):
        Lockstep([ToyNode("wild", says=lambda now: [sent])]).run_until(1)


def test_time_does_not_go_back():
    run = Lockstep([ToyNode("a")])
    run.run_until(5)
    with pytest.raises(ValueError, match="already"):
        run.run_until(4)


def test_two_nodes_of_one_name_are_refused():
    with pytest.raises(ValueError, match="two are named 'a'"):
        Lockstep([ToyNode("a"), ToyNode("a")])
