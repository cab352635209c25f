"""The protection against its published vectors, an independent implementation, and bit flips."""

from itertools import combinations

import e2e
import pytest
from hypothesis import given
from hypothesis import strategies as st
from message_strategies import PROTECTED, PROTECTED_IDS

from utank_hil.canbus.catalogue import read_data_ids
from utank_hil.canbus.e2e import WORD_TABLES, crc8, data_ids, first_byte_table, profile2_crc

ID_LISTS = st.binary(min_size=16, max_size=16)
FRAMES = st.binary(min_size=8, max_size=8)


def table_crc(data, ids):
    """The CRC by four look-ups, as the generated codecs do it."""
    words = [int.from_bytes(data[i : i + 2], "little") for i in (2, 4, 6)]
    crc = first_byte_table(ids)[data[1]]
    for table, word in zip(WORD_TABLES, words, strict=True):
        crc ^= table[word]
    return crc


@pytest.mark.parametrize(
    ("data", "crc"),
    [
        (b"123456789", 0xDF),
        (bytes.fromhex("00000000"), 0x12),
        (bytes.fromhex("F20183"), 0xC2),
        (bytes.fromhex("0FAA0055"), 0xC6),
        (bytes.fromhex("332255AABBCCDDEEFF"), 0x11),
    ],
)
def test_crc8_published_vectors(data, crc):
    assert crc8(data) == crc


@pytest.mark.parametrize(
    ("ids", "frame"),
    [
        (bytes(range(16)), "6101020304050607"),
        (bytes(range(16)), "BC02020304050607"),
        (bytes(16), "4501000000000000"),
    ],
)
def test_profile2_published_vectors(ids, frame):
    data = bytes.fromhex(frame)
    assert profile2_crc(data, ids) == data[0]
    assert table_crc(data, ids) == data[0]


@given(FRAMES, ID_LISTS)
def test_crc_equals_the_oracle(data, ids):
    protected = bytearray(data)
    e2e.p02.e2e_p02_protect(protected, ids, increment_counter=False)
    assert profile2_crc(data, ids) == protected[0]
    assert table_crc(data, ids) == protected[0]


@given(st.binary(max_size=40))
def test_crc8_equals_the_oracle(data):
    assert crc8(data) == e2e.crc.calculate_crc8_h2f(data)


@pytest.mark.parametrize("case", PROTECTED, ids=PROTECTED_IDS)
def test_up_to_three_flipped_bits_are_found_at_every_counter(case):
    """Hamming distance 4, counter bits included, where a flip also changes the data ID.

    The difference between the CRC of a frame and that of the frame with flipped bits depends, by
    linearity, only on the counter and the flips: so all patterns are covered.
    """
    ids = read_data_ids(case[2])
    for counter in range(16):
        good = bytes((0, counter, 0, 0, 0, 0, 0, 0))
        reference = profile2_crc(good, ids)

        def change(bits, good=good, reference=reference):
            """What the flips change in the CRC computed, against the one received."""
            value = int.from_bytes(good, "little") ^ sum(1 << bit for bit in bits)
            received = (value & 0xFF) ^ reference
            return profile2_crc(value.to_bytes(8, "little"), ids) ^ received

        payload = [*range(8), *range(12, 64)]
        single = {change((bit,)) for bit in payload}
        pairs = {a ^ b for a, b in combinations(single, 2)}
        assert len(single) == len(payload)  # no two flips cancel
        assert 0 not in single
        assert not single & pairs  # no three flips cancel
        for flips in range(1, 4):
            for bits in combinations(range(8, 12), flips):
                with_counter = change(bits)
                assert with_counter != 0
                assert flips == 3 or with_counter not in single
                assert flips > 1 or with_counter not in pairs


def test_the_catalogues_data_ids_are_those_of_its_messages_numbers():
    lists = {dbc.name: read_data_ids(dbc) for _, _, dbc in PROTECTED}
    numbers = {name: ids[0] >> 1 for name, ids in lists.items()}
    assert len(set(numbers.values())) == len(lists)
    for name, ids in lists.items():
        assert ids == data_ids(numbers[name])


def test_no_message_passes_for_another_even_with_one_flipped_bit():
    lists = {dbc.name: read_data_ids(dbc) for _, _, dbc in PROTECTED}
    for sent, expected in ((a, b) for a in lists for b in lists if a != b):
        for counter in range(16):
            good = bytes((0, counter, 0, 0, 0, 0, 0, 0))
            received = profile2_crc(good, lists[sent])
            value = int.from_bytes(good, "little") | received
            for bit in (None, *range(64)):
                data = (value ^ (0 if bit is None else 1 << bit)).to_bytes(8, "little")
                assert profile2_crc(data, lists[expected]) != data[0], (sent, expected, bit)
