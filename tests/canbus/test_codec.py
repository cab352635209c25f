"""The generated codecs against cantools, an independent reader of the same DBC."""

import math
from typing import get_type_hints

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from message_strategies import CASE_IDS, CASES, PROTECTED, PROTECTED_IDS, messages

from utank_hil.canbus import DriveState, DriveStatus1, load_catalogue
from utank_hil.canbus.catalogue import read_data_ids
from utank_hil.canbus.codec import Signal, compile_codec, field_kind
from utank_hil.canbus.e2e import profile2_crc

CATALOGUE = load_catalogue()
EVERY_MESSAGE = pytest.mark.parametrize("case", CASES, ids=CASE_IDS)


def is_missing(value):
    return value is None or value != value


def same(a, b):
    """Equal to the last bit, NaN and None like themselves."""
    return all(
        x == y or (isinstance(x, float) and math.isnan(x) and math.isnan(y))
        for x, y in zip(a, b, strict=True)
    )


def by_cantools(dbc, message, data):
    """Encode with cantools; CRC and counter are taken from `data`."""
    values = {}
    for name, value in message._asdict().items():
        signal = dbc.get_signal_by_name(name)
        ones = (1 << signal.length) - 1
        if value is None:
            values[name] = ones
        elif isinstance(value, float):
            values[name] = ones * signal.scale + signal.offset if math.isnan(value) else value
        else:
            values[name] = int(value)
    if "crc" in dbc.signal_tree:
        values |= {"crc": data[0], "counter": data[1] & 15}
    return dbc.encode(values, strict=False)


@pytest.mark.slow
@EVERY_MESSAGE
@settings(max_examples=10)  # for each message
@given(st.data())
def test_encode_equals_cantools(case, data):
    kind, source, dbc = case
    codec = CATALOGUE.codec(kind, source)
    message = data.draw(messages(case))
    encoded = codec.encode(message, data.draw(st.integers(0, 15)))
    assert encoded == by_cantools(dbc, message, encoded)
    if codec.protected:
        assert encoded[0] == profile2_crc(encoded, read_data_ids(dbc))


@EVERY_MESSAGE
@settings(max_examples=10)  # for each message
@given(st.data())
def test_decode_equals_cantools_on_random_bytes(case, data):
    kind, source, dbc = case
    codec = CATALOGUE.codec(kind, source)
    frame = data.draw(st.binary(min_size=8, max_size=8))
    if codec.protected:
        frame = bytes((profile2_crc(frame, read_data_ids(dbc)),)) + frame[1:]
    raw = dbc.decode(frame, scaling=False, decode_choices=False)
    scaled = dbc.decode(frame, decode_choices=False)
    expected = []
    for name, hint in get_type_hints(kind).items():
        signal = dbc.get_signal_by_name(name)
        what = field_kind(hint)
        if what is bool:
            expected.append(raw[name] == 1)
        elif what is float:
            low, high = (
                round((x - signal.offset) / signal.scale) for x in (signal.minimum, signal.maximum)
            )
            expected.append(scaled[name] if low <= raw[name] <= high else math.nan)
        elif what is int:
            in_range = signal.minimum <= raw[name] <= signal.maximum
            expected.append(raw[name] if in_range else None)
        else:
            expected.append(what(raw[name]) if raw[name] in set(what) else None)
    decoded = codec.decode(frame)
    assert same(decoded, expected)
    kinds = map(field_kind, get_type_hints(kind).values())
    assert all(x is None or type(x) is y for x, y in zip(decoded, kinds, strict=True))


@pytest.mark.slow
@EVERY_MESSAGE
@settings(max_examples=10)  # for each message
@given(st.data())
def test_values_out_of_range_saturate_and_never_raise(case, data):
    kind, source, dbc = case
    codec = CATALOGUE.codec(kind, source)
    wild = data.draw(messages(case, wild=True))

    def tamed(name, value):
        if isinstance(value, bool) or is_missing(value):
            return value
        signal = dbc.get_signal_by_name(name)
        return type(value)(min(max(value, signal.minimum), signal.maximum))

    hints = get_type_hints(kind)
    tame = kind._make(
        tamed(name, value) if field_kind(hints[name]) in (float, int) else value
        for name, value in zip(kind._fields, wild, strict=True)
    )
    assert codec.encode(wild, 3) == codec.encode(tame, 3)


@EVERY_MESSAGE
def test_all_ones_is_not_available(case):
    kind, source, dbc = case
    codec = CATALOGUE.codec(kind, source)
    frame = bytearray(b"\xff" * 8)
    if codec.protected:
        frame[0] = profile2_crc(frame, read_data_ids(dbc))
    for name, value in codec.decode(bytes(frame))._asdict().items():
        assert is_missing(value) or value is True, name


@pytest.mark.slow
@pytest.mark.parametrize("case", PROTECTED, ids=PROTECTED_IDS)
@settings(max_examples=10)  # for each message
@given(st.data())
def test_a_wrong_crc_gives_no_message(case, data):
    kind, source, _ = case
    codec = CATALOGUE.codec(kind, source)
    frame = bytearray(codec.encode(data.draw(messages(case)), 5))
    frame[0] ^= data.draw(st.integers(1, 255))
    assert codec.decode(bytes(frame)) is None


@given(st.integers(12, 40), st.integers(2, 24), st.integers(0, (1 << 24) - 2), st.integers(0, 15))
def test_a_signal_may_lie_anywhere(start, length, raw, counter):
    """Also across the words a frame is packed from; checked by shifting the frame as one number."""
    raw &= (1 << length) - 1
    signal = Signal("value", int, start, length, 1.0, 0.0, 0, (1 << length) - 2)
    codec = compile_codec(
        tuple, [signal], name="test", can_id=1, cycle_ns=0, data_ids=bytes(range(16))
    )
    frame = codec.encode((raw,), counter)
    number = int.from_bytes(frame, "little")
    assert number >> 8 == counter | min(raw, (1 << length) - 2) << (start - 8)


@pytest.mark.parametrize("annotation", [str, int, float | None, int | str | None, list[int]])
def test_a_field_of_another_type_is_refused(annotation):
    with pytest.raises(ValueError, match="a field is float, bool"):
        field_kind(annotation)


def test_numpy_scalars_are_encoded_like_pythons_own():
    codec = CATALOGUE.codec(DriveStatus1)
    plain = DriveStatus1(1230.0, -42.0, DriveState.FAULT, 3, True, False, True, False)
    numbers = (np.float64(1230.0), np.float64(-42.0), DriveState.FAULT, np.int64(3))
    flags = tuple(np.bool_(flag) for flag in plain[4:])
    assert codec.encode(DriveStatus1(*numbers, *flags), 7) == codec.encode(plain, 7)
