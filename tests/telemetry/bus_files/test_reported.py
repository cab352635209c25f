"""What people reported of other programs, made anew: siblings of the field cases, kind by kind.

Each name is that of a public report on GitHub; docs/how-to/logs.md lists them.
"""

import numpy as np
import pytest

from utank_hil.telemetry.bus_files.frame import BusFrame, FrameKind
from utank_hil.telemetry.bus_files.log import BusLog
from utank_hil.telemetry.bus_files.writing import write_frames
from utank_hil.telemetry.signal_files import read_signals

HEAD = "date Mon Dec 6 11:21:13 am 2021\nbase hex  timestamps absolute\n"


def read(folder, text, name="a.asc"):
    """Return frames and notes of a log."""
    path, notes = folder / name, []
    path.write_text(text)
    return list(BusLog(path).frames(notes)), "; ".join(notes)


def copied(folder, frames, name):
    write_frames(folder / name, frames)
    return list(BusLog(folder / name).frames())


def frame(time_ns, **other):
    plain = BusFrame(time_ns, "can0", 0x301, False, FrameKind.DATA, b"\x63\x55", 2, False)
    return plain._replace(**other)


@pytest.mark.parametrize(
    ("report", "head", "stamps", "said"),
    [
        # the minute is that of a second ago: a silence, which is said
        ("BUSMASTER 717", HEAD, [736.639 + 0.001 * i for i in range(90)] + [796.384, 796.64],
         "no frame for 59."),
        # five days ahead, at once
        ("BUSMASTER 1236", HEAD, [1.1572, 1.1574, 429496.6736, 429496.6739], "step ahead by 4294"),
        # blocks of frames with one stamp
        ("BUSMASTER 112", HEAD, [10.6176] * 8 + [10.6186] * 8 + [10.6196] * 4, ""),
        ("can-utils 348", "date Mon Dec 6 11:21:13 am 2021\nbase hex  no internal events logged\n",
         [40874.8082, 40874.8091, 40874.8103], ""),
        # far from the measurement's begin, in whose head the time of the day is
        ("python-can 1788", HEAD + "Begin Triggerblock Thu May 16 06:16:50.884 pm 2024\n"
         "   0.000000 Start der Messung\n", [594680.670773, 594680.670873, 594680.670895], ""),
    ],
)  # fmt: skip
def test_times_of_others(tmp_path, report, head, stamps, said):
    lines = (f"   {stamp:.6f} 1 301 Rx d 2 63 55\n" for stamp in stamps)
    frames, notes = read(tmp_path, head + "".join(lines))
    assert len(frames) == len(stamps), report
    assert said in notes
    assert bool(said) == bool(notes)
    if "step" not in said:
        expected = [round(stamp * 1e6) for stamp in stamps]
        assert [each.time_ns // 1000 - frames[0].time_ns // 1000 for each in frames] == [
            each - expected[0] for each in expected
        ]


@pytest.mark.parametrize(
    ("report", "channels", "kind"),
    [
        ("python-can 279", ["can0", "can1"], FrameKind.DATA),
        ("python-can 1268", ["can1", "can2", "can10", "can12"], FrameKind.DATA),
        ("python-can 1578", ["can0", "can2"], FrameKind.ERROR),
    ],
)
@pytest.mark.parametrize("suffix", [".log", ".asc", ".blf"])
def test_where_a_frame_came_from(tmp_path, report, channels, kind, suffix):
    extended = kind is FrameKind.ERROR
    frames = [
        frame(10**9 + i * 10**6, channel=each, kind=kind, number=4, extended=extended)
        for i, each in enumerate(channels)
    ]
    again = copied(tmp_path, frames, f"a{suffix}")
    numbers = [int(each.channel.removeprefix("can")) for each in again]
    first = int(channels[0].removeprefix("can"))
    wanted = [int(each.removeprefix("can")) - first for each in channels]
    assert [number - numbers[0] for number in numbers] == wanted, report
    assert {each.kind for each in again} == {kind}


@pytest.mark.parametrize(
    ("report", "frames"),
    [
        # after an hour the copy was a minute late
        ("BUSMASTER 967", [frame(t * 10**5) for t in (35_999_919, 36_000_000, 36_000_014)]),
        # a frame without data got those of the one before
        ("BUSMASTER 427", [frame(1), frame(2000, data=b"", code=0), frame(3000)]),
        ("python-can 751", [frame(0, kind=FrameKind.REMOTE, data=b"", code=8)]),
        ("BUSMASTER 936",
         [frame(0, kind=FrameKind.REMOTE, data=b"", code=8, number=0x1ABCDEF, extended=True)]),
        ("python-can 1243", [frame(0, sent=True), frame(1000, sent=False)]),
        ("can-utils 211", [frame(0, sent=False), frame(1000, sent=True)]),
        ("can-utils 213", [frame(0, sent=True), frame(1000, sent=True)]),
        ("BUSMASTER 1161", [frame(0, number=0x657), frame(1000, number=0x45C, data=b"", code=0)]),
    ],
)  # fmt: skip
@pytest.mark.parametrize("suffix", [".log", ".asc", ".blf"])
def test_a_copy_is_what_was_copied(tmp_path, report, frames, suffix):
    again = copied(tmp_path, frames, f"a{suffix}")
    assert [each[2:] for each in again] == [each[2:] for each in frames], report
    times = np.array([(a.time_ns, b.time_ns) for a, b in zip(again, frames, strict=True)])
    off_ns = times - times[0]
    assert abs(off_ns[:, 0] - off_ns[:, 1]).max() <= 1000


@pytest.mark.parametrize(
    ("report", "lines", "count", "said"),
    [
        ("SavvyCAN 422", ["0.001231 2  701             Rx   d 1 05  Length = 107915 BitCount = 58",
                          "0.003210 1  80              Rx   d 0  Length = 93914 BitCount = 51",
                          "0.024998 CAN 1 Status:chip status error active",
                          "0.041638 1  701             Rx   d 1 05"], 3, ""),
        ("BUSMASTER 1161", ["0.037019 1  MMI_BRAKE_CANHS_RNr_01              Rx   d 4 34 00 00 08",
                            "0.037629 1  657                                 Rx   d 2 C0 C0"],
         1, "1 line is not understood and left out, the first line 3"),
        ("python-can 1299", ["0.5 1 3FF Rx d 13 55 AA 01 02 03 04 05 06 Length = 229910",
                             "0.6 1 3FF Rx d 8 55 AA 01 02 03 04 05 06"],
         1, "1 line is not understood and left out, the first line 3"),
        ("python-can 1595", ["-0.5 1 122 Rx d 1 0C", "0.1 1 122 Rx d 1 0C"], 2, ""),
    ],
)  # fmt: skip
def test_what_is_not_understood_is_said(tmp_path, report, lines, count, said):
    frames, notes = read(tmp_path, HEAD + "".join(f"   {line}\n" for line in lines))
    assert len(frames) == count, report
    assert said in notes
    assert bool(said) == ("left out" in notes)


@pytest.mark.parametrize(
    ("report", "encoding", "end"),
    [
        ("javarosa 687", "utf-8-sig", "\n"),
        ("node-csv 36", "utf-8-sig", "\r"),
        ("node-csv-parse 284", "utf-8-sig", "\r\n"),
        ("smarter_csv 219", "utf-16", "\r\n"),
    ],
)
def test_texts_of_others(tmp_path, report, encoding, end):
    text = end.join(["time_s,roll_rad", "0,1", "0.1,2", ""])
    (tmp_path / "a.csv").write_bytes(text.encode(encoding))
    (found,) = read_signals(tmp_path / "a.csv").values()
    assert list(found) == ["time_s", "roll_rad"], report
    np.testing.assert_array_equal(found["roll_rad"], [1, 2])


@pytest.mark.parametrize("report", ["SavvyCAN 472", "SavvyCAN 685", "rusefi 8380"])
def test_ends_that_are_cut(tmp_path, report):
    """A last line without its end, half a line, and half a compressed file."""
    lines = [f"({i / 10 + 1:.6f}) can0 301#63550000000000{i:02X} R\n" for i in range(40)]
    if report == "SavvyCAN 472":
        frames, notes = read(tmp_path, "".join(lines).rstrip(" R\n"), "a.log")
        assert (len(frames), notes) == (40, "")
    elif report == "SavvyCAN 685":
        frames, notes = read(tmp_path, "".join(lines)[:-12], "a.log")
        assert len(frames) == 39
        assert "is cut in line 40" in notes or "which may be cut" in notes
    else:
        import gzip

        packed = gzip.compress("".join(lines).encode())
        (tmp_path / "a.log.gz").write_bytes(packed[: len(packed) // 2])
        said: list[str] = []
        frames = list(BusLog(tmp_path / "a.log.gz").frames(said))
        assert 1 <= len(frames) < 40
        assert any("is cut near byte" in each for each in said)
