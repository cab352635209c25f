"""The simulated bus against the rules of CAN, on frames queued at random."""

import pytest
from hypothesis import given
from hypothesis import strategies as st
from toy_nodes import BIT_NS, MS, frame

from utank_hil.canbus.frame import STANDARD, Frame
from utank_hil.runners import SimulatedBus, frame_bits

SECOND_NS = 1000 * MS

# (time of queueing in bits, sender, identifier), in order of time
queued = st.lists(
    st.tuples(st.integers(0, 3000), st.integers(0, 3), st.integers(0, 9)), max_size=30
).map(lambda rows: sorted(rows, key=lambda row: row[0]))


def length_ns(sent):
    return frame_bits(sent) * BIT_NS


def carry(rows):
    """Put the rows on a bus; return (queued at, begun at, identifier, row) as they go over it."""
    bus = SimulatedBus(bit_rate=250_000)
    arrived = []

    def advance(until_ns):
        for end_ns, _, sent in bus.carry_until(until_ns):
            row = int.from_bytes(sent.data, "little")
            begun_ns = end_ns + 3 * BIT_NS - length_ns(sent)
            arrived.append((rows[row][0] * BIT_NS, begun_ns, sent.can_id, row))

    for number, (bits, sender, can_id) in enumerate(rows):
        advance(bits * BIT_NS)
        bus.queue(sender, frame(can_id, number), bits * BIT_NS)
    advance(100 * SECOND_NS)
    return arrived


@given(queued)
def test_every_frame_arrives_once_and_only_one_is_on_the_bus_at_a_time(rows):
    arrived = carry(rows)
    assert sorted(row for *_, row in arrived) == list(range(len(rows)))
    free_ns = 0
    for queued_ns, begun_ns, can_id, row in arrived:
        assert begun_ns >= queued_ns
        assert begun_ns >= free_ns
        free_ns = begun_ns + length_ns(frame(can_id, row))


@given(queued)
def test_no_frame_begins_while_a_more_urgent_one_waits(rows):
    arrived = carry(rows)
    for position, (_, begun_ns, can_id, row) in enumerate(arrived):
        for other_queued_ns, _, other_id, other_row in arrived[position + 1 :]:
            assert other_queued_ns > begun_ns or (can_id, row) < (other_id, other_row)


@given(queued)
def test_bus_is_never_idle_while_a_frame_waits(rows):
    arrived = carry(rows)
    free_ns = 0
    for position, (_, begun_ns, can_id, row) in enumerate(arrived):
        if begun_ns > free_ns:
            assert min(queued_ns for queued_ns, *_ in arrived[position:]) == begun_ns
        free_ns = begun_ns + length_ns(frame(can_id, row))


def test_frame_on_the_bus_is_not_interrupted_by_a_more_urgent_one():
    arrived = carry([(0, 0, 9), (1, 1, 5), (2, 2, 0), (3, 3, 5)])
    assert [can_id for _, _, can_id, _ in arrived] == [9, 0, 5, 5]
    assert arrived[1][1] == length_ns(frame(9, 0))


def test_load_is_the_share_of_time_that_frames_take():
    bus = SimulatedBus()
    sent = frame(1)
    for second, number in enumerate([100, 0, 1000, 1]):
        for _ in range(number):
            bus.queue(0, sent, second * SECOND_NS)
        bus.carry_until((second + 1) * SECOND_NS)
    assert bus.load(4 * SECOND_NS) == pytest.approx(1101 * length_ns(sent) / SECOND_NS / 4)
    assert bus.frames == 1101


def test_load_counts_a_frame_under_way_up_to_now():
    bus = SimulatedBus()
    bus.queue(0, frame(1), 0)
    assert bus.carry_until(10 * BIT_NS) == []
    assert bus.load(10 * BIT_NS) == 1.0
    assert SimulatedBus().load(0) == 0.0


@pytest.mark.parametrize("bit_rate", [0, -1, 300_000, 2_000_000_001])
def test_bit_rate_without_whole_nanoseconds_is_refused(bit_rate):
    with pytest.raises(ValueError, match="bit_rate"):
        SimulatedBus(bit_rate=bit_rate)


def test_an_identifier_of_11_bits_goes_before_all_that_begin_with_it():
    bus = SimulatedBus()
    standard = STANDARD | 0x123
    ids = [0x123 << 18, 0x124 << 18, standard, (0x123 << 18) - 1]
    for can_id in ids:
        bus.queue(0, Frame(can_id, b""), 0)
    arrived = [frame.can_id for _, _, frame in bus.carry_until(10_000_000)]
    assert arrived == [(0x123 << 18) - 1, standard, 0x123 << 18, 0x124 << 18]
