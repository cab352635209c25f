"""The log of a run: nothing lost, nothing waited for, readable however it ends."""

import json
import os
import resource
import signal
import time
from contextlib import contextmanager
from itertools import count
from multiprocessing import Pipe

import numpy as np
import pytest

from utank_hil.canbus import AlarmState, Fault, Mode, RetuningState
from utank_hil.canbus.events import AlarmEvent, RetuningEvent
from utank_hil.commands import recording
from utank_hil.commands.recording import record
from utank_hil.nodes.signals import SIGNALS
from utank_hil.runners import beside
from utank_hil.runners.beside import Beside
from utank_hil.telemetry.events import EventWriter
from utank_hil.telemetry.frame_log import (
    EVENTS,
    IN_A_SLOT,
    LAYOUT,
    ROWS,
    FrameLog,
    FrameLogError,
    FrameLogWriter,
    Kind,
    frame_ring,
)
from utank_hil.telemetry.ring import RingError, RowWriter
from utank_hil.telemetry.rotation import part_of
from utank_hil.telemetry.run_log import RunLogReport, RunLogTask, RunLogWriter, read_run_log

TICK_NS = 10_000_000
HEAD = {"about": {"x": 1}}
REFUSED = RetuningEvent(70_000_000, RetuningState.REFUSED, ("größer",))
ALARM = AlarmEvent(90_000_000, Fault.DRIFT, AlarmState.NORMAL, Mode.STANDBY, "a word")


def tick(number):
    """A tick with as many frames as can't be in one slot."""
    time_ns = number * TICK_NS
    frame = LAYOUT.pack(number, number.to_bytes(8, "little"), Kind.RECEIVED, time_ns)
    return frame * 40 + LAYOUT.pack(0, b"", Kind.TICK, time_ns)


def row(number):
    values = number * np.linspace(1, 2, len(SIGNALS))
    values[SIGNALS.index("time_s")] = number / 100
    return values


class Rings:
    """The rings of a run, and what was written to them."""

    def __init__(self, slots=8192):
        self.rows, self.frames = RowWriter(SIGNALS, slots), frame_ring(slots)
        self.events = EventWriter()
        self.records, self.numbers = b"", []

    def feed(self, numbers):
        for number in numbers:
            self.frames.write(tick(number))
            self.rows.write(row(number))
            self.records += tick(number)
            self.numbers.append(number)

    def task(self, file, **more):
        rings = self.rows.name, self.frames.name, self.events.name
        return RunLogTask(*rings, file, HEAD, **{"part_s": 3600.0, **more})

    def close(self):
        for ring in (self.frames, self.rows, self.events):
            ring.close()


@contextmanager
def rings(slots=8192):
    found = Rings(slots)
    try:
        yield found
    finally:
        found.close()


@contextmanager
def a_full_disk():
    """No file may be longer than a part of its first block."""
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (30, before[1]))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)


def records_of(file):
    return np.concatenate(list(FrameLog(file).blocks()))


def test_rows_frames_and_events_are_in_one_file(tmp_path):
    file = tmp_path / "run-a.frames"
    with rings() as run, RunLogWriter(run.task(file)) as log:
        run.feed(range(50))
        run.events.write_event(REFUSED, 50_000_000)
        log.write()
        run.feed(range(50, 90))
        run.events.write_event(ALARM, 50_000_000)
        log.write()
        assert log.report == RunLogReport(rows=90, lost=0, records_lost=0, parts=1)
        assert not log.ended
        run.close()
        assert log.ended
    assert records_of(file).tobytes() == run.records
    found = read_run_log(file)
    assert (found.about, found.columns) == (HEAD["about"], SIGNALS)
    np.testing.assert_array_equal(found.rows, [row(number) for number in run.numbers])
    np.testing.assert_array_equal(found.signals["time_s"], np.arange(90) / 100)
    assert [event.time_ns for event in found.events] == [20_000_000, 40_000_000]
    assert [found.events[0].reasons, found.events[1].received] == [("größer",), "a word"]
    assert {path.name for path in tmp_path.iterdir()} == {file.name}


def test_a_log_goes_on_in_the_next_part_within_the_bound_of_its_folder(tmp_path):
    file, old = tmp_path / "run-b.frames", tmp_path / "run-a.frames"
    old.write_bytes(bytes(100_000))
    os.utime(old, (1, 1))
    with rings() as run, RunLogWriter(run.task(file, part_s=0.5, keep_bytes=110_000)) as log:
        for number in range(120):
            run.feed([number])
            log.write()
        assert log.report.parts == 3
        assert not old.exists()  # there was room for it, until the second part
    assert records_of(file).tobytes() == run.records  # all parts
    parts = [read_run_log(part_of(file, number)).rows for number in (1, 2, 3)]
    assert [len(part) for part in parts] == [51, 51, 18]
    np.testing.assert_array_equal(np.concatenate(parts), [row(n) for n in run.numbers])


def test_what_came_too_fast_is_counted_where_it_is_missing(tmp_path):
    file = tmp_path / "a.frames"
    with rings(64) as run, RunLogWriter(run.task(file)) as log:
        run.feed(range(10))
        log.write()
        run.feed(range(10, 110))  # two slots each
        log.write()
        run.feed(range(110, 170))
        log.write()
    records = records_of(file)
    first, second = np.flatnonzero(records["kind"] == Kind.LOST)
    assert records["number"][first] == (2 * 100 - 64) * IN_A_SLOT
    assert records["number"][second] == (2 * 60 - 64) * IN_A_SLOT
    assert log.report.records_lost == records["number"][[first, second]].sum()
    assert log.report.lost == 100 - 64
    assert records["time_ns"][first - 1] == 9 * TICK_NS
    assert records["time_ns"][first + 1] == (10 + 68) * TICK_NS
    assert records["time_ns"][second - 1] == 109 * TICK_NS


def test_a_disk_that_is_full_for_a_while_costs_nothing(tmp_path):
    file = tmp_path / "a.frames"
    with rings() as run, RunLogWriter(run.task(file, part_s=0.2)) as log:
        for number in range(60):
            run.feed([number])
            if number % 3 == 0:
                log.write()
                continue
            with a_full_disk(), pytest.raises(OSError, match="File too large"):
                log.write()
        log.write()
        parts = log.report.parts
        assert log.report == RunLogReport(rows=60, lost=0, records_lost=0, parts=parts)
    assert parts > 1
    assert records_of(file).tobytes() == run.records
    found = [read_run_log(part_of(file, 1 + part)).rows for part in range(parts)]
    np.testing.assert_array_equal(np.concatenate(found), [row(n) for n in run.numbers])


@pytest.mark.slow
def test_a_killed_recorder_leaves_all_but_the_last_second(tmp_path):
    file = tmp_path / "run-a.frames"
    with rings() as run:
        recorder = Beside("the recorder", record, run.task(file))
        begin_s = time.monotonic()
        for number in count():
            run.feed([number])
            time.sleep(0.01)
            if time.monotonic() - begin_s > 2.0:
                break
        os.kill(recorder.pid, signal.SIGKILL)
        assert recorder.stop(print) == {}
        assert recorder.error == "the recorder ended with code -9"
    left = records_of(file)
    assert run.records.startswith(left.tobytes())
    assert left["time_ns"][-1] > (number - 150) * TICK_NS  # half a second more for the machine
    assert read_run_log(file).rows[-1, 0] > (number - 150) / 100


@pytest.mark.slow
def test_a_recorder_that_hangs_is_named_while_it_is_waited_for(tmp_path, monkeypatch):
    monkeypatch.setattr(beside, "END_S", 1.5)
    said = []
    with rings() as run:
        recorder = Beside("the recorder", record, run.task(tmp_path / "a.frames"))
        os.kill(recorder.pid, signal.SIGSTOP)
    assert recorder.stop(said.append) == {}
    assert said == ["waiting up to 1.5 s for the recorder to end"]
    assert recorder.error == "the recorder did not end and was killed"


@pytest.mark.slow
def test_the_recorder_ends_with_its_rings_or_their_writer_and_says_what_it_wrote(tmp_path):
    with rings() as run:
        run.feed(range(20))  # before the recorder is there
        recorder = Beside("the recorder", record, run.task(tmp_path / "a.frames"))
        os.kill(recorder.pid, signal.SIGTERM)
        run.feed(range(20, 30))
    report = RunLogReport(rows=30, lost=0, records_lost=0, parts=1)
    said = {name: getattr(report, name) for name in ("rows", "lost", "records_lost", "parts")}
    assert recorder.stop(print) == recorder.stop(print) == said | {"error": None}
    assert recorder.error == ""
    assert records_of(tmp_path / "a.frames").tobytes() == run.records


class Told:
    """The other end of a connection."""

    def __init__(self):
        self.said = []

    def send_bytes(self, content):
        self.said.append(content)


def test_a_failure_is_said_once_and_at_the_end(tmp_path, monkeypatch, capfd):
    monkeypatch.setattr(recording, "ready", lambda _told: None)
    monkeypatch.setattr(time, "sleep", lambda _s: run.rows.close() if tries == 3 else None)
    tries, told = 0, Told()

    def full(_log):
        nonlocal tries
        tries += 1
        raise OSError(28, "No space left on device", "a.frames")

    monkeypatch.setattr(RunLogWriter, "write", full)
    with rings() as run:
        record(run.task(tmp_path / "a.frames"), told)
    assert tries == 4
    assert json.loads(told.said[-1])["error"] == "[Errno 28] No space left on device: 'a.frames'"
    said = capfd.readouterr().err
    assert said.count("recording failed: [Errno 28] No space left") == 1


def test_the_recorder_of_a_run_that_was_killed_ends_without_a_word(tmp_path, monkeypatch):
    monkeypatch.setattr(recording, "ready", lambda _told: None)
    monkeypatch.setattr(time, "sleep", lambda _s: run.rows.close())
    heard, told = Pipe(duplex=False)
    heard.close()
    with rings() as run, told:
        run.feed(range(3))
        record(run.task(tmp_path / "run.frames"), told)
    assert len(read_run_log(tmp_path / "run.frames").rows) == 3


@pytest.mark.slow
def test_a_recorder_that_can_not_begin_does_not_start(tmp_path):
    with rings() as run:
        nowhere = tmp_path / "no-such-folder" / "run.frames"
        with pytest.raises(OSError, match=r"did not start: .*no-such-folder"):
            Beside("the recorder", record, run.task(nowhere))
        task = RunLogTask("utank-no-such-ring", run.frames.name, None, nowhere, HEAD, 1.0)
    with pytest.raises(RingError, match="no ring"):
        RunLogWriter(task)


def test_a_log_cut_anywhere_gives_what_is_before_the_cut(tmp_path):
    file = tmp_path / "a.frames"
    with rings() as run, RunLogWriter(run.task(file)) as log:
        for number in range(40):
            run.feed([number])
            log.write()
    content = file.read_bytes()
    counts = []
    for share in (0.5, 0.8, 0.99):
        file.write_bytes(content[: int(share * len(content))])
        notes = []
        found = read_run_log(file, notes.append)
        np.testing.assert_array_equal(found.rows, [row(n) for n in range(len(found.rows))])
        assert ["is cut at byte" in note for note in notes] == [True]
        counts.append(len(found.rows))
    assert 10 < counts[0] < counts[1] < counts[2] < 40


@pytest.mark.parametrize(
    ("blocks", "said"),
    [
        ([], "holds no telemetry"),
        ([(ROWS, b"\x01\x00\x00\x00" + bytes(8))], "are not 1 rows of 2 numbers"),
        ([(ROWS, b"\x01")], "damaged"),
        ([(EVENTS, b"{")], "damaged"),
        ([(EVENTS, b'[{"code": "none"}]')], "damaged"),
        ([(EVENTS, b"3")], "damaged"),
    ],
)
def test_a_hostile_log_is_refused_with_its_name(tmp_path, blocks, said):
    file = tmp_path / "a.frames"
    with FrameLogWriter(file, {"about": {}, "columns": ["time_s", "x"]}) as log:
        for block in blocks:
            log.append(*block)
    with pytest.raises(FrameLogError, match=rf"a\.frames: .*{said}"):
        read_run_log(file)
    with FrameLogWriter(file, {"about": None, "columns": 3}):
        pass
    with pytest.raises(FrameLogError, match=r"a\.frames: "):
        read_run_log(file)
