"""Logs that other programs wrote: counted as by readers that share nothing with this one."""

from collections import Counter
from pathlib import Path

import pytest
from others import others_file

from utank_hil.telemetry.bus_files.frame import BusLogError, FrameKind
from utank_hil.telemetry.bus_files.log import BusLog

D, F, R, E = FrameKind.DATA, FrameKind.FD, FrameKind.REMOTE, FrameKind.ERROR
CHANNELS_5 = {"1", "2", "3", "4", "5"}


def frames_of(name):
    return list(BusLog(others_file(f"logs/{name}")).frames())


@pytest.mark.parametrize(
    ("name", "kinds", "first_ns", "last_ns", "sent", "channels"),
    [
        ("logfile.asc", {(D, True): 8, (D, False): 2, (R, False): 3, (F, False): 2, (R, True): 1,
                         (E, False): 4}, 2_501_000_000, 30_806_898_000, 5, CHANNELS_5),
        ("logfile_errorframes.asc", {(D, True): 6, (D, False): 1, (R, False): 2, (E, False): 3},
         2_501_000_000, 20_248_887_000, 2, {"1", "2", "3", "4"}),
        ("issue_1256.asc", {(D, False): 1457}, 19_968_000, 7_960_498_000, 0, {"1"}),
        ("issue_1299.asc", {(D, False): 4}, 13_258_199_000, 13_258_907_000, 4, {"1"}),
        ("test_CanErrorFrames.asc", {(E, False): 4}, 2_501_000_000, 30_806_898_000, 1,
         {"1", "2", "5"}),
        ("test_CanFdMessage.asc", {(F, False): 2, (F, True): 1}, 30_005_021_000, 30_005_071_000, 1,
         {"1", "2", "3"}),
        ("test_CanFdMessage64.asc", {(F, False): 1, (F, True): 1}, 30_506_898_000, 31_506_898_000,
         0, {"4"}),
        ("test_CanRemoteMessage.asc", {(R, False): 3}, 2_510_001_000, 2_584_921_000, 1,
         {"2", "3", "4"}),
        ("single_frame_us_locale.asc", {(D, True): 1}, 0, 0, 0, {"1"}),
        ("test_CanMessage.asc.gz", {(D, False): 2}, 2_501_000_000, 17_876_708_000, 1, {"1", "2"}),
        ("test_CanMessage.blf", {(D, False): 2}, 2459565876494606882, 2459565876494606882, 0,
         {"4369"}),
        ("test_CanMessage2.blf", {(D, False): 2}, 2459565876494606882, 2459565876494606882, 0,
         {"4369"}),
        ("test_CanFdMessage.blf", {(F, False): 2}, 2459565876494606882, 2459565876494606882, 0,
         {"4369"}),
        ("test_CanErrorFrameExt.blf", {(E, True): 2}, 2459565876494606882, 2459565876494606882, 0,
         {"4369"}),
        ("test_CanMessage_V1_0_BUS1.trc", {(D, True): 7, (D, False): 3, (R, False): 1},
         17_535_000_000, 48_937_000_000, 0, {"1"}),
        ("test_CanMessage_V1_1.trc", {(D, True): 7, (D, False): 3, (R, False): 1}, 17_535_400_000,
         48_937_600_000, 10, {"1"}),
        ("test_CanMessage_V1_3.trc", {(D, True): 7, (D, False): 3, (R, False): 1}, 17_535_400_000,
         48_937_600_000, 10, {"1"}),
        ("test_CanMessage_V2_1.trc", {(D, True): 7, (D, False): 3, (R, False): 1}, 17_535_400_000,
         48_937_600_000, 10, {"1"}),
        ("actisense-522.candump.log", {(D, True): 106}, 1745600961335462000, 1745600961338397000,
         0, {"can0"}),
        ("candump-fast-cr.txt", {(D, True): 23}, 352_000_000, 1_502_000_000, 0, {"vcan0"}),
    ],
)  # fmt: skip
def test_frames_are_those_that_others_count(name, kinds, first_ns, last_ns, sent, channels):
    notes: list[str] = []
    frames = list(BusLog(others_file(f"logs/{name}")).frames(notes))
    assert notes == []
    assert Counter((frame.kind, frame.extended) for frame in frames) == kinds
    assert (frames[0].time_ns, frames[-1].time_ns) == (first_ns, last_ns)
    assert sum(bool(frame.sent) for frame in frames) == sent
    assert {frame.channel for frame in frames} == channels


def test_lengths_and_bytes_are_those_that_stand_there():
    sizes = Counter(len(frame.data) for frame in frames_of("issue_1256.asc"))
    assert sizes == {8: 344, 4: 954, 3: 79, 1: 80}
    raw = frames_of("issue_1299.asc")[2]
    assert (raw.code, raw.data.hex()) == (13, "55aa010203040506")
    fd = frames_of("test_CanFdMessage64.asc")
    assert [(f.number, f.data[:4].hex(), f.data[-1], len(f.data), f.speed) for f in fd] == [
        (0x4EE, "a1020304", 0x64, 64, 2),
        (0x1C4D80A7, "b1020304", 0x64, 64, 1),
    ]
    asked = [(f.number, f.code) for f in frames_of("test_CanRemoteMessage.asc")]
    assert asked == [(0x100, 0), (0x200, 0), (0x300, 8)]
    counted = frames_of("issue_1905.blf")
    assert len(counted) == 22
    assert {(len(f.data), f.data[48:], f.channel) for f in counted} == {(64, bytes(16), "7")}
    assert (counted[0].time_ns % 10**12 // 1000, len({f.number for f in counted})) != (0, 0)


@pytest.mark.parametrize(
    ("name", "said"),
    [
        ("candumpSample2.txt", "line 7: has no times: log with candump -l"),
        ("test_batch.mf4", "no frames of a bus in it"),
        ("test_metadata.mf4", "no frames of a bus in it"),
        ("README.md", "is no log of the bus, such as candump"),
    ],
)
def test_what_is_no_log_with_times_is_refused_with_its_reason(name, said):
    with pytest.raises(BusLogError, match=said) as refusal:
        frames_of(name)
    assert Path(str(refusal.value).partition(": ")[0]).name == name
