"""Motion sentences against those of public documents and recorded ships, and against garbage."""

import math
import struct

import pytest
from hypothesis import given
from hypothesis import strategies as st

from utank_hil.canbus import Frame, SensorMotion
from utank_hil.canbus.sentences import (
    EM3000,
    GARBAGE,
    PSXN_ATTITUDE,
    PSXN_QUALITY,
    PSXN_RATES,
    TSS1,
    SentenceReader,
    sentence,
)
from utank_hil.configuration.devices import DevicesSection

LINE = "udp:127.0.0.1:5001:127.0.0.1"
SEAPATH = (  # NCEI 0086548, format/100097/seapath320.txt
    b"$GPHDT,104.68,T*0E\r\n$PSXN,20,0,0,0,0*3B\r\n$PSXN,23,1.28,1.93,104.68,-0.24*18\r\n"
)
RECORD = struct.pack("<BBhhhH", 0, 0x90, 36, 58, 3, 9)
NOVATEL = b":00FFCA -0003F-0325  0319\r\n"  # NovAtel OEM7, SPAN logs, TSS1
HEALY = b":000064 -0003U 0007 -0056\r\n"  # NCEI 0086548, format/100195/format_hly_mru.txt


def read(*pieces):
    reader = SentenceReader()
    return [frame for piece in pieces for frame in reader.take(piece)]


def value(profile, name, frame):
    section = DevicesSection(
        motion={"profile": profile, "bus": LINE, "accept_unprotected": True},
        motion_2={},
    ).motion
    plan = section.plan(SensorMotion, "motion", 1)
    message = next(
        each for each in plan.messages if each.can_ids[0] & 0x7FF == frame.can_id & 0x7FF
    )
    assert len(frame.data) == message.length
    good = all(each.holds(frame.data) for each in message.conditions)
    values = [each.value(frame.data) for each in message.signals]
    return values[0] if name == "roll" and values else good


def test_a_seapath_as_recorded():
    quality, attitude = read(SEAPATH)
    assert value("psxn", "roll", attitude) == pytest.approx(math.radians(1.28))
    assert quality == Frame(PSXN_QUALITY, bytes(4))
    assert value("psxn", "good", quality) is True


def test_sentences_of_others_on_the_line_are_passed_by():
    """Of an AIS receiver, as AIVDM/AIVDO Protocol Decoding (gpsd) has them."""
    aivdm = (
        b"!AIVDM,1,1,,B,177KQJ5000G?tO`K>RA1wUbN0TKH,0*5C\r\n",
        b"!AIVDM,2,1,3,B,55P5TL01VIaAL@7WKO@mBplU@<PDhh000000001S;AJ::4A80?4i@E53,0*3E\r\n",
    )
    assert read(SEAPATH, *aivdm, SEAPATH) == read(SEAPATH) * 2


@pytest.mark.parametrize(
    ("said", "roll_deg"),
    [(b"$PSXN,23,0.30,-0.97,298.57,0.13*1B\r\n", 0.30),  # pynmea2, test_proprietary
     (b"$PSXN,23,-1.47,0.01,235.77,-0.38*34\r\n", -1.47),  # OpenRVDAS, of a ship
     (b"$PSXN,23,-2.82,1.00,235.18,-1.66*3D\r\n", -2.82)],
)  # fmt: skip
def test_attitudes_of_others(said, roll_deg):
    (frame,) = read(said)
    assert value("psxn", "roll", frame) == pytest.approx(math.radians(roll_deg))


@pytest.mark.parametrize(("quality", "good"), [(b"0", True), (b"1", True), (b"2", False)])
def test_quality_of_roll_and_pitch(quality, good):
    (frame,) = read(checked(b"PSXN,20,2,2,2," + quality))
    assert value("psxn", "good", frame) is good


def checked(body):
    total = 0
    for byte in body:
        total ^= byte
    return b"$%b*%02X\r\n" % (body, total)


def test_an_empty_field_is_not_available():
    (frame,) = read(checked(b"PSXN,23,,,104.68,"))
    assert math.isnan(value("psxn", "roll", frame))


def test_rates():
    (frame,) = read(checked(b"PSXN,24,-0.50,0.25,0.10,0.02"))
    assert frame == Frame(PSXN_RATES, struct.pack("<ii", -500, 250))


@pytest.mark.parametrize(
    ("said", "roll_deg", "good"),
    [
        (NOVATEL, -3.25, True),
        (HEALY, 0.07, True),
        (HEALY.replace(b"U", b"u"), 0.07, False),
        (HEALY.replace(b"U", b"?"), 0.07, False),
    ],
)
def test_tss1(said, roll_deg, good):
    (frame,) = read(said)
    assert value("tss1", "roll", frame) == pytest.approx(math.radians(roll_deg))
    assert value("tss1", "good", frame) is good


@pytest.mark.parametrize(
    ("status", "good"), [(0x00, True), (0x90, True), (0x99, True), (0x9A, False), (0xA3, False)]
)
def test_em3000_whose_status_stands_in_the_first_byte(status, good):
    record = struct.pack("<BBhhhH", status, 0x90, -1234, 0x24, -100, 35_999)
    frames = read(record + record)
    assert len(frames) == 2
    assert value("em3000", "roll", frames[0]) == pytest.approx(math.radians(-12.34))
    assert value("em3000", "good", frames[0]) is good


@pytest.mark.parametrize(
    "bad", [(18_000, 0, 0, 0), (0, -18_000, 0, 0), (0, 0, 1000, 0), (0, 0, 0, 36_000)]
)
def test_em3000_out_of_its_range_is_spoilt(bad):
    record = struct.pack("<BBhhhH", 0, 0x90, *bad)
    good = struct.pack("<BBhhhH", 0, 0x90, 1, 2, 3, 4)
    assert [bool(each.data) for each in read(good, good, record, good)] == [True, True, False, True]


@pytest.mark.parametrize(
    "said", [SEAPATH, NOVATEL + HEALY, struct.pack("<BBhhhH", 0, 0x90, *4 * (7,)) * 3]
)
def test_pieces_of_any_length_are_the_same(said):
    whole = read(said, said)
    assert len(whole) >= 4
    assert read(*(bytes([each]) for each in said + said)) == whole


@pytest.mark.parametrize("said", [SEAPATH, HEALY, RECORD])
def test_what_is_cut_is_told_and_what_follows_is_read(said):
    good = read(said, said)
    for length in range(1, len(said) - 1):
        found = read(said, said, said[:length], said, said, said)
        assert found[: len(good)] == good
        assert found[-len(good) :] == good
        assert (Frame(good[-1].can_id, b"") in found) is not said[:length].endswith(b"\n")


@pytest.mark.parametrize("at", range(10, 37))
def test_one_wrong_byte_of_a_checked_sentence_is_spoilt(at):
    said = bytearray(b"$PSXN,23,1.28,1.93,104.68,-0.24*18\r\n")
    if at >= len(said) - 2:
        return
    said[at] ^= 0x02
    frames = read(b"$PSXN,23,0.30,-0.97,298.57,0.13*1B\r\n", bytes(said), SEAPATH)
    assert frames[1] == Frame(PSXN_ATTITUDE, b"")
    assert frames[-1].data


def test_bytes_that_never_were_a_sentence():
    assert set(read(b"\xff" * 500, b"GET / HTTP/1.1\r\n" * 20)) == {Frame(GARBAGE, b"")}


PARTS = (
    SEAPATH, NOVATEL, HEALY, RECORD, b"$PSXN,23,", b"\x00\x90", b":",
    b"$PSXN,23,1e400,1,1,1*00\r\n", b"$PSXN,20,--1,0,0,0*3B\r\n",
)  # fmt: skip


@given(st.lists(st.binary(max_size=60) | st.sampled_from(PARTS)))
def test_garbage_ends_nothing_and_holds_no_memory(pieces):
    reader = SentenceReader()
    for piece in pieces:
        for frame in reader.take(piece):
            assert frame.can_id in (GARBAGE, PSXN_QUALITY, PSXN_ATTITUDE, PSXN_RATES, TSS1, EM3000)
            assert len(frame.data) in (0, 4, 7, 8)
        assert len(reader._rest) <= 120
    ends = list(reader.take(b"\r\n" * 61 + SEAPATH))  # behind whatever was begun
    assert ends[-1].data


hundredths = st.integers(-9000, 9000)


@given(hundredths, hundredths)
def test_what_is_said_is_read(roll, pitch):
    motion = struct.pack("<Bhhh", ord("F"), roll, pitch, -5)
    for frame in (
        Frame(PSXN_ATTITUDE, struct.pack("<ii", 10 * roll, 10 * pitch)),
        Frame(TSS1, motion),
        Frame(PSXN_QUALITY, b"\0\1\2\0"),
        Frame(EM3000, b"\x90" + motion[1:]),
    ):
        assert read(sentence(frame) * 2)[0] == frame


def test_a_frame_that_is_no_sentence():
    with pytest.raises(ValueError, match="0x123 stands for no sentence"):
        sentence(Frame(GARBAGE | 0x123, bytes(8)))
