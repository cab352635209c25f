"""Records of a node's inputs and outputs keep every bit on their way."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from utank_hil.telemetry.frame_log import (
    LAYOUT,
    PAYLOAD_BYTES,
    RECORD,
    Kind,
    frame_ring,
    pack,
    unpack,
)
from utank_hil.telemetry.ring import RingReader

ENTRIES = st.lists(
    st.tuples(
        st.sampled_from(Kind),
        st.integers(0, (1 << 32) - 1),
        st.integers(-(1 << 62), (1 << 62) - 1),
        st.binary(max_size=PAYLOAD_BYTES),
    ),
    max_size=40,
)


def packed(entries):
    return b"".join(
        LAYOUT.pack(number, data, kind, time_ns) for kind, number, time_ns, data in entries
    )


def records(entries):
    return np.frombuffer(packed(entries), dtype=RECORD)


@given(ENTRIES)
def test_packed_records_come_back_in_their_order_bit_for_bit(entries):
    before = records(entries)
    assert unpack(pack(before)).tobytes() == before.tobytes()


@given(ENTRIES)
def test_a_ring_hands_out_the_same_records(entries):
    data = packed(entries)
    with frame_ring(64) as ring, RingReader(ring.name) as reader:
        if data:
            ring.write(data)
        assert b"".join(reader.read()) == data


def test_bytes_that_are_no_records_are_refused():
    with pytest.raises(ValueError, match="are not 2 records"):
        unpack(b"\x02\0\0\0" + bytes(45))
