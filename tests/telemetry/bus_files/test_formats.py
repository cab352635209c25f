"""Texts and objects of other programs, as people reported them: read, or refused with the reason.

Numbers are those of reports: python-can 1256, 1299, 1584, 1595, 1786, 1905, 997; can-utils 348;
cantools 817; SavvyCAN 571, 795, 1068.
"""

import gzip
import struct
import zlib

import can
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from utank_hil.base.text_files import TextFileError
from utank_hil.telemetry.bus_files import binary
from utank_hil.telemetry.bus_files.frame import FD_LENGTHS, BusFrame, BusLogError, FrameKind
from utank_hil.telemetry.bus_files.log import BusLog
from utank_hil.telemetry.bus_files.writing import write_frames

D, F, R, E = FrameKind.DATA, FrameKind.FD, FrameKind.REMOTE, FrameKind.ERROR
ASC = "date Mon Dec 6 11:21:13 am 2021\nbase hex  timestamps absolute\n"


def read(folder, text, name="a.log"):
    """Return frames and notes of a log."""
    path, notes = folder / name, []
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    return list(BusLog(path).frames(notes)), notes


@pytest.mark.parametrize(
    ("line", "expected"),
    [
        ("(1.5) can0 123#0102 R", (D, 0x123, False, "0102", 2, False)),
        ("(1.5) can0 00000123#01.02 T", (D, 0x123, True, "0102", 2, True)),
        ("(1.5) can0 123#R5", (R, 0x123, False, "", 5, None)),
        ("(1.5) can0 123#R", (R, 0x123, False, "", 0, None)),
        ("(1.5) can0 123#R8_E", (R, 0x123, False, "", 14, None)),
        ("(1.5) can0 123##3" + "00" * 12, (F, 0x123, False, "00" * 12, 9, None)),
        ("(1.5) can0 20000040#0000000000000000", (E, 0x40, True, "00" * 8, 8, None)),
        ("(1.5) can0 123#0102030405060708_9", (D, 0x123, False, "0102030405060708", 9, None)),
        (" (1.5)  vcan0  20000004   [8]  00 00 00 00 00 00 00 00   ERRORFRAME",
         (E, 4, True, "00" * 8, 8, None)),
        (" (1.5)  can0  123   [4]  remote request", (R, 0x123, False, "", 4, None)),
        (" (1.5)  can0  123  [12]  00 01 02 03 04 05 06 07 08 09 0A 0B",
         (F, 0x123, False, "000102030405060708090a0b", 9, None)),
        (" (1.5)  can0  RX - -  123   [2]  01 02   '..'", (D, 0x123, False, "0102", 2, False)),
        (" (1.5)  can0  123   [0]", (D, 0x123, False, "", 0, None)),
    ],
)  # fmt: skip
def test_lines_of_candump(tmp_path, line, expected):
    ((frame,), notes) = read(tmp_path, f"# comment\n\n{line}\r\n")
    kind, number, extended, data, code, sent = expected
    assert notes == []
    assert frame.time_ns == 1_500_000_000
    assert (frame.kind, frame.number, frame.extended) == (kind, number, extended)
    assert (frame.data.hex(), frame.code, frame.sent) == (data, code, sent)


@pytest.mark.parametrize(
    ("line", "why"),
    [
        ("(1.6) can0 1234#01", "is no frame as candump writes it"),
        ("(1.6) can0 FFF#01", "FFF is no identifier"),
        ("(1.6) can0 40000000#01", "40000000 is no identifier"),
        ("(1.6) can0 123#010", "is no frame as candump writes it"),
        ("(1.6) can0 123#010203040506070809", "can't have 9 bytes"),
        ("(1.6) can0 123##0" + "00" * 13, "can't have 13 bytes"),
        ("(1.6) can0 123#01_9", "can't have 1 bytes"),
        ("(1.6)  can0  123   [3]  01 02", "has 2 of 3 bytes"),
        ("garbage", "is no frame as candump writes it"),
        ("0.6 CANFD 1 Rx", "ends before its identifier"),
        ("0.6 1 SENSOR_MOTION Rx d 1 00", "'SENSOR_MOTION' is no identifier"),
        ("0.6 1 100 d 1 00", "says neither Rx nor Tx"),
        ("0.6 1 100 Rx", "is no frame, such as"),
    ],
)
def test_a_line_that_is_not_understood_is_counted_with_its_reason(tmp_path, line, why):
    text = f"(1.5) can0 123#01\n{line}\n(1.7) can0 123#02\n"
    if line.startswith("0.6"):
        text = f"{ASC}0.5 1 100 Rx d 1 00\n{line}\n0.7 1 100 Rx d 1 00\n"
    frames, (note,) = read(tmp_path, text, "a.log")
    assert len(frames) == 2
    first = text[: text.index(line)].count("\n") + 1
    assert f"a.log: 1 line is not understood and left out, the first line {first}" in note
    assert why in note


@pytest.mark.parametrize(
    ("text", "why"),
    [
        ("(2026-02-03 10:00:00.000000) can0 123#01\n", "line 1: '2026-02-03 10:00:00.000000' is"),
        ("  can0  123   [2]  01 02\n", "line 1: has no times: log with candump -l"),
        ("(1.5) can0 123#01\n(-3.0) can0 123#01\n", "line 2: '-3.0' is no time in seconds"),
        ("(٣.5) can0 123#01\n", "is no time in seconds"),
        (ASC + "   nan 1  100 Rx d 1 00\n", "line 3: 'nan' is no time in seconds"),
        (ASC, "no frames in it"),
        ("", "it is empty"),
        ("x" * 70_000, "is no log of the bus"),
    ],
)
def test_a_log_that_can_not_be_read_is_refused_with_its_line(tmp_path, text, why):
    with pytest.raises(BusLogError, match=why.replace("(", r"\(")):
        read(tmp_path, text)


@pytest.mark.parametrize(
    ("line", "expected"),
    [
        ("40874.8 1 122 Rx d 2 E3 0C", (D, 0x122, False, "e30c", 2, False)),  # BusMaster
        ("0.5 1 3FF Tx d D 55 AA 01 02 03 04 05 06 Length = 1",
         (D, 0x3FF, False, "55aa010203040506", 13, True)),
        ("0.5 1 1af Rx d 0", (D, 0x1AF, False, "", 0, False)),
        ("0.5 CANFD   1 Rx        206  msg1   1 1 9 12 " + "00 " * 12 + "1 6 307000 a8 4b 4b 20 20",
         (F, 0x206, False, "00" * 12, 9, False)),
        ("0.5 CANFD   2 Tx        1C4D80A7x   0 0 8 8 01 02 03 04 05 06 07 08 1 1 0 0 0 0 0 0",
         (D, 0x1C4D80A7, True, "0102030405060708", 8, True)),
        ("0.5 2 ErrorFrame Flags = 0xe CodeExt = 0x20a2", (E, 0, False, "", 0, None)),
        ("-0.5 1 122 Rx d 1 0C", (D, 0x122, False, "0c", 1, False)),
    ],
)  # fmt: skip
def test_lines_of_asc(tmp_path, line, expected):
    start = "   0.000000 CANFD   Start of measurement\n"
    ((frame,), notes) = read(tmp_path, f"{ASC}{start}   {line}\nEnd TriggerBlock\n", "a.asc")
    kind, number, extended, data, code, sent = expected
    assert notes == []
    assert (frame.kind, frame.number, frame.extended) == (kind, number, extended)
    assert (frame.data.hex(), frame.code, frame.sent) == (data, code, sent)


def test_asc_of_base_ten(tmp_path):
    head = "base dec  timestamps absolute\nno internal events logged\n"
    ((frame,), _) = read(tmp_path, f"{head} 0.5 1 291x Rx d 3 16 255 0\n")
    assert (frame.number, frame.data) == (291, bytes([16, 255, 0]))
    frames, notes = read(tmp_path, f"{head} 0.5 1 291x Rx d 1 16\n 0.6 1 291x Rx d 1 25")
    assert (len(frames), "is cut in line 4" in notes[0]) == (1, True)


def test_savvycan(tmp_path):
    head = "Time Stamp,ID,Extended,Dir,Bus,LEN,D1,D2,D3,D4,D5,D6,D7,D8\n"
    text = f"{head}973,0000013B,false,Rx,0,2,00,4C\n2009,18FF0080,true,Tx,1,1,0A,\n"
    frames, notes = read(tmp_path, text, "a.csv")
    assert notes == []
    assert frames[0] == BusFrame(973_000, "0", 0x13B, False, D, b"\x00\x4c", 2, False)
    assert frames[1] == BusFrame(2_009_000, "1", 0x18FF0080, True, D, b"\x0a", 1, True)
    old = "Time Stamp,ID,Extended,Bus,LEN,D1\n-1769872318259854,141,false,0,1,1A,\n"
    ((frame,), _) = read(tmp_path, f"{old}", "a.csv")
    assert (frame.time_ns, frame.sent) == (-1769872318259854000, None)


def test_ends_that_are_damaged_are_read_up_to_there_and_said(tmp_path):
    whole = "".join(f"({1 + i / 100:.6f}) can0 123#0102030405060708\n" for i in range(50))
    for end in ("(1.600000) can0 123#01020304", "(1.6", "\0" * 100_000, "(1.600000) can0 123#0"):
        frames, (note,) = read(tmp_path, whole + end)
        assert len(frames) == 50
        assert "line 51" in note
        assert "what follows in it is left out" in note
    assert len(read(tmp_path, whole + "(1.600000) can0 123#0102030405060708")[0]) == 51
    frames, notes = read(tmp_path, gzip.compress(whole.encode())[:-30], "a.log.gz")
    assert 0 < len(frames) <= 50
    assert "a.log.gz is cut near byte" in notes[0]


def test_a_bomb_is_refused(tmp_path):
    bomb = gzip.compress(b"(1.0) can0 123#" + b"0" * 5_000_000)
    with pytest.raises(TextFileError, match="line 1 has more than 65536 characters"):
        read(tmp_path, bomb)


def blf(*containers):
    """Return a BLF file of containers' contents."""
    head = struct.pack("<4sL136x", b"LOGG", 144)
    objects = []
    for content in containers:
        packed = zlib.compress(content)
        body = struct.pack("<H6xL4x", 2, len(content)) + packed
        size = 16 + len(body)
        objects.append(struct.pack("<4sHHLL", b"LOBJ", 16, 1, size, 10) + body + bytes(size % 4))
    return head + b"".join(objects)


def blf_message(time, flags=2, size=48):
    return (
        struct.pack("<4sHHLL", b"LOBJ", 32, 1, size, 1)
        + struct.pack("<LHHQ", flags, 0, 0, time)
        + struct.pack("<HBBL8s", 1, 0, 2, 0x123, b"\x01\x02")
    )


def test_objects_of_blf_continue_in_the_next_container_and_count_in_two_units(tmp_path):
    content = blf_message(1_000_000) + blf_message(200, flags=1) + blf_message(3_000_000)
    for cut in (10, 48, 60, 100, 140):
        frames, notes = read(tmp_path, blf(content[:cut], content[cut:]), "a.blf")
        assert notes == []
        assert [frame.time_ns for frame in frames] == [1_000_000, 2_000_000, 3_000_000]
        assert {(f.number, f.extended, f.data) for f in frames} == {(0x123, False, b"\x01\x02")}
    theirs = [m.timestamp for m in can.BLFReader(tmp_path / "a.blf")]
    assert theirs == pytest.approx([0.001, 0.002, 0.003])


def test_a_cut_blf_is_read_up_to_there_and_a_damaged_one_is_an_error(tmp_path, monkeypatch):
    whole = blf(blf_message(1), blf_message(2))
    frames, (note,) = read(tmp_path, whole[:-9], "a.blf")
    assert len(frames) == 1
    assert "a.blf is cut after frame 1: the file ends in an object" in note
    for size in (0, 15, 1 << 30):
        with pytest.raises(BusLogError, match=f"after frame 1, .*an object of {size} bytes"):
            read(tmp_path, blf(blf_message(1) + blf_message(2, size=size)), "a.blf")
    with pytest.raises(BusLogError, match="no object where one should begin"):
        read(tmp_path, blf(blf_message(1) + bytes(60)), "a.blf")
    monkeypatch.setattr(binary, "_LIMIT", 1000)
    with pytest.raises(BusLogError, match="more than 1000 bytes"):
        read(tmp_path, blf(blf_message(1), bytes(2000)), "a.blf")


FRAMES = st.lists(
    st.builds(
        lambda step, number, extended, kind, data, code, sent, speed: (
            step,
            BusFrame(
                0,
                "can0",
                number & (0x1FFFFFFF if extended else 0x7FF),
                extended or kind is E,
                kind,
                b""
                if kind is R
                else data.ljust(FD_LENGTHS[code], b"\1")[: FD_LENGTHS[code]]
                if kind is F
                else data[:8],
                code if kind is F else min(code, 8) if kind is R else len(data[:8]),
                None if kind is E else sent,
                speed if kind is F else 0,
            ),
        ),
        st.integers(0, 19_000),
        st.integers(0, 0x1FFFFFFF),
        st.booleans(),
        st.sampled_from(FrameKind),
        st.binary(max_size=64),
        st.integers(0, 15),
        st.booleans(),
        st.integers(0, 3),
    ),
    min_size=1,
    max_size=30,
)


@settings(max_examples=12)
@given(steps=FRAMES, begin_us=st.sampled_from([0, 2_501_000, 1_780_000_000_000_123]))
def test_a_copy_is_the_same_to_a_microsecond_and_others_read_the_same(
    tmp_path_factory, steps, begin_us
):
    folder = tmp_path_factory.getbasetemp()
    times_ns = np.cumsum([begin_us, *(step for step, _ in steps[1:])]) * 1000
    frames = [f._replace(time_ns=int(t)) for t, (_, f) in zip(times_ns, steps, strict=True)]
    readers = {"log": can.CanutilsLogReader, "asc": can.ASCReader, "blf": can.BLFReader}
    for suffix, theirs in readers.items():
        path, notes, said = folder / f"copy.{suffix}", [], []
        assert write_frames(path, frames, said) == len(frames)
        found = list(BusLog(path).frames(notes))
        assert notes == []
        origin_us = begin_us // 1000 * 1000 if suffix == "asc" and begin_us > 10**12 else 0
        for ours, original in zip(found, frames, strict=True):
            expected = original
            if original.kind is E:  # ASC has no class, and no format marks who sent it.
                expected = original._replace(sent=ours.sent)
                if suffix == "asc":
                    expected = expected._replace(number=0, extended=False, data=b"", code=0)
                    assert said or not (original.number or original.data)
            elapsed_us = round(ours.time_ns / 1000) - original.time_ns // 1000 + origin_us
            assert elapsed_us == 0
            assert ours._replace(time_ns=0, channel="") == expected._replace(time_ns=0, channel="")
        with theirs(path) as messages:
            heard = list(messages)
        assert len(heard) == len(frames)
        for message, original in zip(heard, frames, strict=True):
            if original.kind is E:  # of candump's error classes python-can knows that of the bus
                assert message.is_error_frame or suffix == "log"
                continue
            if original.kind is F and not original.data and suffix == "asc":
                continue  # python-can takes a frame of CAN FD without data for a remote one
            assert message.arbitration_id == original.number
            assert message.is_extended_id == original.extended
            assert (message.is_fd, message.is_remote_frame) == (
                original.kind is F,
                original.kind is R,
            )
            assert bytes(message.data) == original.data
            assert message.is_rx != original.sent


def test_channels_of_like_names_stay_apart(tmp_path):
    names = ["can1", "can11", "can0", "vcan1", "11", "1"]
    frames = [BusFrame(number, name, 5, False, D, b"", 0) for number, name in enumerate(names)]
    for suffix, theirs in (("asc", can.ASCReader), ("blf", can.BLFReader)):
        write_frames(tmp_path / f"a.{suffix}", frames)
        with theirs(tmp_path / f"a.{suffix}") as messages:
            assert len({message.channel for message in messages}) == len(names)


@pytest.mark.parametrize("suffix", ["mf4", "trc"])
def test_files_of_others_are_read_as_they_read_them(tmp_path, suffix):
    pytest.importorskip("asammdf")
    from importlib import reload

    import can.io.mf4
    import can.io.trc

    path = tmp_path / f"a.{suffix}"
    writer = can.io.trc.TRCWriter if suffix == "trc" else reload(can.io.mf4).MF4Writer
    with writer(path) as log:
        for number in range(40):
            log.on_message_received(
                can.Message(
                    timestamp=1_780_000_000.0 + number / 128,
                    arbitration_id=0x18FF0080 if number % 2 else 0x123,
                    is_extended_id=bool(number % 2),
                    is_remote_frame=number == 6 and suffix == "mf4",
                    data=bytes([number] * (number % 9)) if number != 6 else b"",
                    dlc=number % 9 if number != 6 or suffix == "mf4" else 0,
                    is_rx=number % 3 > 0,
                    channel=1,
                )
            )
    notes: list[str] = []
    found = list(BusLog(path).frames(notes))
    assert (len(found), notes) == (40, [])
    begin_ns = found[0].time_ns
    for number, frame in enumerate(found):
        # TRC has a tenth of a millisecond, MF4 a microsecond.
        off_ns = frame.time_ns - begin_ns - round(number / 128 * 1e9)
        assert abs(off_ns) < (100_000 if suffix == "trc" else 1000)
        assert frame.kind is (R if number == 6 and suffix == "mf4" else D)
        assert frame.data == (b"" if number == 6 else bytes([number] * (number % 9)))
        assert (frame.extended, frame.sent) == (bool(number % 2), number % 3 == 0)
    if suffix == "trc":
        return
    damaged = bytearray((tmp_path / "a.mf4").read_bytes())
    damaged[200:260] = bytes(60)
    (tmp_path / "b.mf4").write_bytes(damaged)
    with pytest.raises(BusLogError, match=r"b\.mf4"):
        list(BusLog(tmp_path / "b.mf4").frames())


CANDUMP = "".join(f"({1 + i / 50:.6f}) can0 08FF1080#01020304050607{i:02X} R\n" for i in range(20))
SEEDS = [
    CANDUMP.encode(),
    (ASC + "".join(f"  {i / 50:.6f} 1  {i:X}x Rx d 2 01 {i:02X}\n" for i in range(20))).encode(),
    b";$FILEVERSION=2.1\n;$COLUMNS=N,O,T,B,I,d,R,L,D\n"
    + b"".join(b"%d %d.0 DT 1 0123 Rx - 2 00 01\n" % (i, 20 * i) for i in range(20)),
    b"Time Stamp,ID,Extended,Dir,Bus,LEN,D1\n"
    + b"".join(b"%d,123,false,Rx,0,1,0A\n" % (20_000 * i) for i in range(20)),
    blf(*(blf_message(20_000_000 * i) for i in range(20))),
    gzip.compress(CANDUMP.encode(), mtime=0),
]


@given(
    seed=st.sampled_from(SEEDS),
    edits=st.lists(
        st.tuples(st.integers(0, 1 << 16), st.sampled_from(["set", "cut", "copy", "drop"]),
                  st.binary(min_size=1, max_size=12)),
        min_size=1, max_size=4,
    ),
)  # fmt: skip
def test_damaged_files_give_frames_notes_or_an_error_and_nothing_else(
    tmp_path_factory, seed, edits
):
    content = bytearray(seed)
    for place, how, data in edits:
        place %= max(1, len(content))
        if how == "set":
            content[place : place + len(data)] = data
        elif how == "cut":
            del content[place:]
        elif how == "drop":
            del content[place : place + len(data)]
        else:
            content[place:place] = content[: 8 * len(data)]
    path = tmp_path_factory.getbasetemp() / "mutant"
    path.write_bytes(content)
    notes: list[str] = []
    try:
        frames = list(BusLog(path).frames(notes))
    except (BusLogError, TextFileError) as error:
        refusal = str(error)
    else:
        refusal = ""
        assert 0 < len(frames) <= 200
        assert all(len(frame.data) <= 64 for frame in frames)
    assert not refusal or path.name in refusal
