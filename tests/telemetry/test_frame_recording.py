"""The recorder writes the frame log: all of it, or all but a second, and says what it lost."""

import signal
import subprocess
import sys
import time
from itertools import count

import numpy as np
import pytest

from utank_hil.nodes.signals import SIGNALS
from utank_hil.telemetry.frame_log import (
    IN_A_SLOT,
    LAYOUT,
    FrameLog,
    FrameRecording,
    Kind,
    frame_ring,
)
from utank_hil.telemetry.recorder_process import RecorderProcess, RecorderState, RecordingTask
from utank_hil.telemetry.ring import RowWriter
from utank_hil.telemetry.rotation import part_of

pytestmark = pytest.mark.slow

TICK_NS = 10_000_000
HEAD = {"about": {"x": 1}}
NO_RERUN = """
import sys
sys.modules["rerun"] = None
from utank_hil.telemetry.recorder import _main
_main()
"""


def tick(number):
    """A tick with as many frames as can't be in one slot."""
    time_ns = number * TICK_NS
    frame = LAYOUT.pack(number, number.to_bytes(8, "little"), Kind.RECEIVED, time_ns)
    return frame * 40 + LAYOUT.pack(0, b"", Kind.TICK, time_ns)


def feed(ring, numbers):
    data = b"".join(map(tick, numbers))
    for number in numbers:
        ring.write(tick(number))
    return data


def read(file):
    log = FrameLog(file)
    assert log.head == HEAD
    return np.concatenate(list(log.blocks()))


def test_every_record_reaches_the_log_beside_the_recording(tmp_path):
    file = tmp_path / "run-a.rrd"
    with RowWriter(SIGNALS) as ring, frame_ring(8192) as frames:
        data = feed(frames, range(50))  # before the recorder is there
        recorder = RecorderProcess(
            RecordingTask(ring.name, str(file), frames=frames.name, head=HEAD)
        )
        data += feed(frames, range(50, 200))
        ring.write(np.zeros(len(SIGNALS)))
    report = recorder.stop()
    assert report.records_lost == 0
    assert file.exists()
    assert read(file.with_suffix(".frames")).tobytes() == data


def test_a_log_goes_on_in_the_next_part_where_the_last_ended(tmp_path):
    file = tmp_path / "run-a.rrd"
    with frame_ring(8192) as frames:
        data = feed(frames, range(10))
        with FrameRecording(frames.name, file, HEAD) as log:
            log.write()
        data += feed(frames, range(10, 20))
        with FrameRecording(frames.name, part_of(file, 2), HEAD, log.place) as later:
            later.write()
    assert read(file.with_suffix(".frames")).tobytes() == data


def test_a_killed_recorder_leaves_all_but_the_last_second(tmp_path):
    file = tmp_path / "run-a.rrd"
    with RowWriter(SIGNALS) as ring, frame_ring(8192) as frames:
        recorder = RecorderProcess(
            RecordingTask(ring.name, str(file), frames=frames.name, head=HEAD)
        )
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


def test_rows_that_came_too_fast_are_counted_where_they_are_missing(tmp_path):
    with frame_ring(64) as frames:
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


def test_without_rerun_there_is_the_frame_log_and_nothing_else(tmp_path):
    file = tmp_path / "run-a.rrd"
    with RowWriter(SIGNALS) as ring, frame_ring(8192) as frames:
        data = feed(frames, range(20))
        task = RecordingTask(ring.name, str(file), frames=frames.name, head=HEAD)
        process = subprocess.Popen(
            [sys.executable, "-c", NO_RERUN],
            stdin=RecorderState(task).as_input(),
            stdout=subprocess.PIPE,
            text=True,
        )
        assert process.stdout.readline() == '{"ready": 1}\n'
    with process.stdout as output:
        assert '"parts": 1' in output.read()
    assert process.wait() == 0
    assert [path.name for path in tmp_path.iterdir()] == ["run-a.frames"]
    assert read(tmp_path / "run-a.frames").tobytes() == data
