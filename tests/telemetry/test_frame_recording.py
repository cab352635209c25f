"""The recorder writes the frame log: all of it, or all but a second, and says what it lost."""

import signal
import subprocess
import sys
import time
from itertools import count
from pathlib import Path

import numpy as np
import pytest

from utank_hil.nodes.signals import SIGNALS
from utank_hil.telemetry.bus_records import IN_A_SLOT, LAYOUT, ROW, Kind, Records
from utank_hil.telemetry.frame_log import FrameLog
from utank_hil.telemetry.recorder import FrameRecording, RecorderProcess
from utank_hil.telemetry.ring import RingWriter

pytestmark = pytest.mark.slow

TICK_NS = 10_000_000
HEAD = {"about": {"x": 1}}
NO_RERUN = """
import sys
sys.modules["rerun"] = None
from utank_hil.telemetry.recorder import _main
_main()
"""


def tick(number: int) -> bytes:
    """A tick with as many frames as can't be in one slot."""
    time_ns = number * TICK_NS
    frame = LAYOUT.pack(number, number.to_bytes(8, "little"), Kind.RECEIVED, time_ns)
    return frame * 40 + LAYOUT.pack(0, b"", Kind.TICK, time_ns)


def feed(ring: RingWriter, numbers: range) -> bytes:
    data = b"".join(map(tick, numbers))
    for number in numbers:
        ring.write(tick(number))
    return data


def read(file: Path) -> Records:
    log = FrameLog(file)
    assert log.head == HEAD
    return np.concatenate(list(log.blocks()))


def test_every_record_reaches_the_log_beside_the_recording(tmp_path: Path) -> None:
    file = tmp_path / "run-a.rrd"
    with RingWriter(SIGNALS) as ring, RingWriter(ROW, rows=IN_A_SLOT) as frames:
        data = feed(frames, range(50))  # before the recorder is there
        recorder = RecorderProcess(ring.name, file, frames=frames.name, head=HEAD)
        data += feed(frames, range(50, 200))
        ring.write(np.zeros(len(SIGNALS)))
    report = recorder.stop()
    assert report.records_lost == 0
    assert file.exists()
    assert read(file.with_suffix(".frames")).tobytes() == data


def test_what_the_recording_beside_it_could_not_take_is_in_the_next_part_alone(
    tmp_path: Path,
) -> None:
    file = tmp_path / "run-a.rrd"
    with RingWriter(ROW, rows=IN_A_SLOT) as frames:
        data = feed(frames, range(10))
        with FrameRecording(frames.name, file, HEAD) as log:
            log.write()
            place = log.place
            log.take_back(place)  # nothing came since
            log.write()
            log.take_back(0)  # nor was anything written
            data += feed(frames, range(10, 20))
            log.write()
            log.take_back(place)
        data += feed(frames, range(20, 30))
        with FrameRecording(frames.name, tmp_path / "run-a-part002.rrd", HEAD, place) as log:
            log.write()
    assert read(file.with_suffix(".frames")).tobytes() == data


def test_a_killed_recorder_leaves_all_but_the_last_second(tmp_path: Path) -> None:
    file = tmp_path / "run-a.rrd"
    with RingWriter(SIGNALS) as ring, RingWriter(ROW, rows=IN_A_SLOT) as frames:
        recorder = RecorderProcess(ring.name, file, frames=frames.name, head=HEAD)
        begin_s, data = time.monotonic(), b""
        for number in count():
            data += feed(frames, range(number, number + 1))
            time.sleep(0.01)
            if time.monotonic() - begin_s > 2.0:
                break
        recorder._process.send_signal(signal.SIGKILL)
        recorder._process.wait()
        recorder._output.close()
    left = read(file.with_suffix(".frames"))
    assert data.startswith(left.tobytes())
    assert left["time_ns"][-1] > (number - 150) * TICK_NS  # half a second more for the machine


def test_rows_that_came_too_fast_are_counted_where_they_are_missing(tmp_path: Path) -> None:
    with RingWriter(ROW, capacity=64, rows=IN_A_SLOT) as frames:
        feed(frames, range(10))
        recording = FrameRecording(frames.name, tmp_path / "a.rrd", HEAD)
        recording.write()
        feed(frames, range(10, 110))  # two slots each
        recording.write()
        feed(frames, range(110, 170))
        recording.write()
        recording.close()
    records = read(tmp_path / "a.frames")
    first, second = np.flatnonzero(records["kind"] == Kind.LOST)
    assert records["number"][first] == (2 * 100 - 64) * IN_A_SLOT
    assert records["number"][second] == (2 * 60 - 64) * IN_A_SLOT
    assert recording.lost == records["number"][[first, second]].sum()
    assert records["time_ns"][first - 1] == 9 * TICK_NS
    assert records["time_ns"][first + 1] == (10 + 68) * TICK_NS
    assert records["time_ns"][second - 1] == 109 * TICK_NS


def test_without_rerun_there_is_the_frame_log_and_nothing_else(tmp_path: Path) -> None:
    file = tmp_path / "run-a.rrd"
    with RingWriter(SIGNALS) as ring, RingWriter(ROW, rows=IN_A_SLOT) as frames:
        data = feed(frames, range(20))
        words = ["--ring", ring.name, "--file", str(file), "--frames", frames.name, "--content"]
        process = subprocess.Popen(
            [sys.executable, "-c", NO_RERUN, *words],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
        )
        process.stdin.write('{"head": {"about": {"x": 1}}}')
        process.stdin.close()
        assert process.stdout.readline() == '{"ready": 1}\n'
    with process.stdout as output:
        assert '"parts": 1' in output.read()
    assert process.wait() == 0
    assert [path.name for path in tmp_path.iterdir()] == ["run-a.frames"]
    assert read(tmp_path / "run-a.frames").tobytes() == data
