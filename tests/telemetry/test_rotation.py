"""A long recording in several files, within a bound of the disk."""

import os
import re
import time
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from rerun.chunk import RrdReader

from utank_hil.canbus import RetuningState
from utank_hil.canbus.events import RetuningEvent
from utank_hil.nodes.signals import SIGNALS
from utank_hil.telemetry.events import EventWriter
from utank_hil.telemetry.frame_log import LAYOUT, FrameLog, Kind, frame_ring
from utank_hil.telemetry.recorder_process import RecorderProcess, RecorderReport, RecordingTask
from utank_hil.telemetry.recording_reader import read_about, read_recording
from utank_hil.telemetry.ring import RowWriter
from utank_hil.telemetry.rotation import make_room, part_of, remove_oldest

TIME = SIGNALS.index("time_s")
EVENT_EVERY = 4  # rows: the ring's 64 last while a busy machine starts the recorder


def rows(first, count):
    """Rows of 10 ms."""
    values = np.zeros((count, len(SIGNALS)))
    values[:, TIME] = np.arange(first, first + count) / 100
    return values


def times(file):
    return read_recording(file)["live"]["time_s"]


def names(count, suffix):
    return ["run-a" + suffix] + [f"run-a-part{n:03d}{suffix}" for n in range(2, count + 1)]


@pytest.mark.slow
def test_no_row_event_or_frame_is_lost_or_twice_between_files(tmp_path):
    oldest = tmp_path / "run-0.rrd"
    oldest.write_bytes(bytes(2_000_000))
    head, records = {"x": 1}, b""
    with (
        RowWriter(SIGNALS, about=head) as ring,
        frame_ring(8192) as frames,
        EventWriter() as events,
    ):
        recorder = RecorderProcess(
            RecordingTask(
                ring.name,
                str(tmp_path / "run-a.rrd"),
                events=events.name,
                part_s=0.4,
                keep_bytes=2_200_000,
                frames=frames.name,
                head=head,
            )
        )
        pid, sent = recorder.pid, 0
        while not (tmp_path / "run-a-part003.rrd").exists():
            assert sent < 1000
            ring.write(rows(5 * sent, 1)[0])
            tick = LAYOUT.pack(0, b"", Kind.TICK, 50_000_000 * sent)
            frames.write(tick)
            if sent % EVENT_EVERY == 0:
                time_ns = 50_000_000 * sent
                events.write_event(RetuningEvent(time_ns, RetuningState.REFUSED, (f"<{sent}>",)), 0)
            records += tick
            sent += 1
            time.sleep(0.05)
    report = recorder.stop()
    assert recorder.pid == pid
    assert report == RecorderReport(sent, 0, 3)
    assert not oldest.exists()  # there was room for it, until the second part
    files = [tmp_path / name for name in names(3, ".rrd")]
    np.testing.assert_allclose(np.concatenate([*map(times, files)]), np.arange(sent) / 20)
    assert all(len(times(file)) > 8 for file in files[:-1])
    log = FrameLog(tmp_path / "run-a.frames")
    assert np.concatenate([*log.blocks()]).tobytes() == records
    refused: list[str] = []
    for file in files:
        RrdReader(file).store()  # needs the footer
        assert read_about(file) == head
        refused += re.findall(r"<\d+>", " ".join(texts(file)))
    assert refused == [f"<{number}>" for number in range(0, sent, EVENT_EVERY)]
    assert sorted(path.name for path in tmp_path.iterdir()) == sorted(
        names(3, ".rrd") + names(3, ".frames")
    )


def texts(file):
    """Lines of the text log."""
    chunks = RrdReader(file).stream().filter(components="TextLog:text").to_chunks()
    found = [chunk.to_record_batch().column("TextLog:text").flatten() for chunk in chunks]
    return [str(text) for each in found for text in each.to_pylist()]


@pytest.mark.evidence
def test_a_stop_between_two_files_loses_no_row_of_a_ring_that_is_gone(tmp_path):
    """When the signal comes, the process is a program that has not set anything up yet."""
    with RowWriter(SIGNALS) as ring:
        recorder = RecorderProcess(
            RecordingTask(ring.name, str(tmp_path / "run-a.rrd"), part_s=1.0)
        )
        ring.write(rows(0, 110))
        deadline = time.monotonic() + 20.0
        while "part2" not in os.readlink(f"/proc/{recorder.pid}/fd/0"):
            assert time.monotonic() < deadline
        ring.write(rows(110, 7))
    assert recorder.stop() == RecorderReport(117, 0, 2)
    assert len(times(tmp_path / "run-a-part002.rrd")) == 7


@given(
    sizes=st.lists(st.integers(980, 1020), min_size=8, max_size=8),
    keep_bytes=st.integers(2200, 5000),
)
def test_the_parts_of_a_recording_stay_within_the_bound(sizes, keep_bytes):
    with TemporaryDirectory() as folder:
        file = Path(folder) / "run-a.rrd"
        for number, size in enumerate(sizes, 1):
            make_room(file, number, keep_bytes)
            part = part_of(file, number)
            part.write_bytes(bytes(size))
            os.utime(part, ns=(number, number))
            left = [path.stat().st_size for path in file.parent.iterdir()]
            assert sum(left) <= keep_bytes
            assert sum(left) + 2 * 1050 > keep_bytes or len(left) == number


@settings(suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(sizes=st.lists(st.integers(0, 500), max_size=8), keep_bytes=st.integers(0, 2000))
def test_what_is_removed_is_the_oldest_and_no_more_than_needed(tmp_path, sizes, keep_bytes):
    for path in tmp_path.iterdir():
        path.unlink()
    files = []
    for age, size in enumerate(sizes):
        path = tmp_path / f"run-{len(sizes) - age}.rrd"  # by time, not by name
        path.write_bytes(bytes(size))
        os.utime(path, ns=(age, age))
        files.append(path)
    apart = [tmp_path / name for name in ("bench-1.rrd", "run-1.yaml", "run-now.rrd")]
    for path in apart:
        path.write_bytes(bytes(3000))
    removed = remove_oldest(tmp_path / "run-now.rrd", keep_bytes)
    left = [path for path in files if path.exists()]
    assert removed + left == files
    assert all(path.exists() for path in apart)
    total = sum(path.stat().st_size for path in left)
    assert total <= keep_bytes
    if removed:
        assert total + sizes[len(removed) - 1] > keep_bytes


def test_a_clock_that_was_set_back_does_not_cost_the_run_its_own_parts(tmp_path):
    """As at a start without a battery behind the clock: the new files look the oldest."""
    file, before = tmp_path / "run-20000101T000000Z.rrd", tmp_path / "run-20261101T000000Z.rrd"
    for path, time_s in ((before, 2e9), (file, 1e9), (part_of(file, 2), 1e9 + 3600)):
        path.write_bytes(bytes(1000))
        os.utime(path, (time_s, time_s))
    assert remove_oldest(part_of(file, 3), 2500) == [before]
    assert remove_oldest(part_of(file, 3), 1500) == [file]


def test_runs_of_a_computer_without_a_clock_are_removed_in_their_order(tmp_path, monkeypatch):
    """Each start begins in the year 2000; one run has had the time from the network."""
    starts = [2e9, 1e9, 1e9 + 5, 2.1e9, 1e9 + 1]
    for number, start_s in enumerate(starts):
        file = tmp_path / f"run-{9 - number}.rrd"  # names tell nothing either
        monkeypatch.setattr(time, "time_ns", lambda now=start_s: int(now * 1e9))
        make_room(file, 1, 10_000)
        for part in (file, part_of(file, 2)):
            part.write_bytes(bytes(1000))
            os.utime(part, (start_s + 3600, start_s + 3600))
    removed = remove_oldest(tmp_path / "run-0.rrd", 2000)
    assert [int(path.stem[4]) for path in removed] == [9, 9, 8, 8, 7, 7, 6, 6]


def test_a_file_that_somebody_else_removes_meanwhile_ends_no_recording(tmp_path):
    """A link to nowhere is as such a file: it has a name, and nothing is known of it."""
    (tmp_path / "run-1.rrd").symlink_to(tmp_path / "gone")
    old = tmp_path / "run-2.rrd"
    old.write_bytes(bytes(1000))
    assert remove_oldest(tmp_path / "run-3.rrd", 500) == [old]
