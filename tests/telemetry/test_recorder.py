"""The recorder process: nothing lost, nothing waited for, readable however it ends."""

import gc
import json
import os
import random
import resource
import shutil
import signal
import subprocess
import sys
import time
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest
from rerun.chunk import RrdReader

from utank_hil.canbus import Mode, RetuningState
from utank_hil.canbus.events import RetuningEvent
from utank_hil.nodes.signals import SIGNALS
from utank_hil.telemetry.events import EventWriter
from utank_hil.telemetry.frame_log import LAYOUT, FrameLog, Kind, frame_ring
from utank_hil.telemetry.live import RecordingPart
from utank_hil.telemetry.recorder import record_part
from utank_hil.telemetry.recorder_process import (
    RecorderError,
    RecorderProcess,
    RecorderReport,
    RecorderState,
    RecordingTask,
)
from utank_hil.telemetry.recording_reader import read_recording
from utank_hil.telemetry.ring import RowWriter

pytestmark = pytest.mark.slow


def table(rows):
    """Rows of 10 ms that tell their number in every column."""
    number = np.arange(rows)
    values = number[:, None] * np.linspace(1, 2, len(SIGNALS))
    values[:, SIGNALS.index("time_s")] = number / 100
    values[:, SIGNALS.index("mode")] = np.minimum(number // 100, 4)
    values[:, SIGNALS.index("fault")] = 0
    return values


def feed(ring, rows):
    for row in rows:
        ring.write(row)


def wait_for(condition, seconds=20.0):
    deadline = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < deadline
        time.sleep(0.02)


def recorded(file):
    run = read_recording(file)["live"]
    return np.stack([run[column] for column in SIGNALS], axis=1)


@dataclass(frozen=True)
class Line:
    time_ns: int
    level: str
    text: str


def text_log(file):
    """Lines of the text log, in the order of their times; those without one at the end."""
    lines = []
    for chunk in RrdReader(file).stream().filter(components=["TextLog:text", "TextLog:level"]):
        batch = chunk.to_record_batch()
        timed = "time" in batch.schema.names
        times = batch.column("time").to_numpy().astype(np.int64) if timed else [1 << 62]
        levels, texts = (batch.column(f"TextLog:{part}").to_pylist() for part in ("level", "text"))
        for time_ns, (level,), (text,) in zip(times, levels, texts, strict=True):
            lines.append(Line(int(time_ns), level, text))
    return sorted(lines, key=lambda line: line.time_ns)


def any_recorded(file):
    try:
        return len(recorded(file)) > 0
    except ValueError:
        return False


def test_every_row_reaches_the_file_and_the_footer_is_written(tmp_path):
    rows = table(500)
    file = tmp_path / "run.rrd"
    with RowWriter(SIGNALS) as ring:
        feed(ring, rows[:100])  # before the recorder is there
        recorder = RecorderProcess(RecordingTask(ring.name, str(file)))
        feed(ring, rows[100:])
    report = recorder.stop()
    assert report == RecorderReport(rows=500, lost=0, parts=1)
    assert recorder.stop() is report
    np.testing.assert_allclose(recorded(file), rows, rtol=4e-16)
    RrdReader(file).store()  # needs the footer
    assert list(tmp_path.iterdir()) == [file]


@pytest.mark.evidence
def test_recorder_ends_by_itself_when_the_ring_is_closed(tmp_path):
    with RowWriter(SIGNALS) as ring:
        recorder = RecorderProcess(RecordingTask(ring.name, str(tmp_path / "run.rrd")))
        feed(ring, table(10))
    wait_for(lambda: recorder._process.poll() == 0)
    assert recorder.stop().rows == 10


@pytest.mark.evidence
def test_killed_recorder_leaves_all_but_the_last_second(tmp_path):
    file = tmp_path / "run.rrd"
    rows = table(200)
    with RowWriter(SIGNALS) as ring:
        recorder = RecorderProcess(RecordingTask(ring.name, str(file)))
        feed(ring, rows)
        time.sleep(1.0)
        recorder._process.kill()
        with pytest.raises(RecorderError, match="exit code -9"):
            recorder.stop()
    np.testing.assert_allclose(recorded(file), rows, rtol=4e-16)


@pytest.fixture
def disk(monkeypatch):
    """Files by name, as they were brought to the disk."""
    files: dict[str, bytes] = {}

    def fsync(descriptor):
        file = Path(os.readlink(f"/proc/self/fd/{descriptor}"))
        files[file.name] = file.read_bytes()

    monkeypatch.setattr(os, "fsync", fsync)
    return files


def test_a_power_cut_leaves_all_but_the_half_second_of_the_last_batch(tmp_path, disk, monkeypatch):
    """What is left is what was brought to the disk; the recorder's sleep is the clock."""
    cuts: list[tuple[int, dict[str, bytes]]] = []
    rows, written = table(2000), 0

    def sleep(_, seconds):
        nonlocal written
        for number in range(written, written + round(100 * seconds)):
            ring.write(rows[number])
            frames.write(LAYOUT.pack(0, b"", Kind.TICK, 10_000_000 * number))
            written += 1
        cuts.append((written, dict(disk)))
        return None if written < 200 else signal.SIGTERM

    def left(kept):
        for name, content in kept.items():
            (tmp_path / "left" / name).write_bytes(content)
        records = sum(map(len, FrameLog(tmp_path / "left" / "run.frames").blocks()))
        return len(recorded(tmp_path / "left" / "run.rrd")) if "run.rrd" in kept else 0, records

    monkeypatch.setattr(signal, "sigtimedwait", sleep)
    (tmp_path / "left").mkdir()
    with RowWriter(SIGNALS) as ring, frame_ring(8192) as frames:
        task = RecordingTask(ring.name, str(tmp_path / "run.rrd"), frames=frames.name)
        assert not record_part(RecorderState(task))
    for now, kept in cuts:
        assert now - min(left(kept)) <= 50
    assert left(disk) == (written, written)


def test_a_power_cut_leaves_all_of_a_file_that_was_finished(tmp_path, disk):
    with RecordingPart(tmp_path / "run.rrd", SIGNALS) as part:
        part.write(table(300))
    (tmp_path / "left.rrd").write_bytes(disk["run.rrd"])
    np.testing.assert_allclose(recorded(tmp_path / "left.rrd"), table(300), rtol=4e-16)


def test_it_gives_way_to_the_loop_and_is_out_of_reach_of_ctrl_c(tmp_path):
    with (
        RowWriter(SIGNALS) as ring,
        RecorderProcess(RecordingTask(ring.name, str(tmp_path / "run.rrd"))) as recorder,
    ):
        own = os.getpriority(os.PRIO_PROCESS, 0)
        assert os.getpriority(os.PRIO_PROCESS, recorder.pid) == min(own + 5, 19)
        assert os.getsid(recorder.pid) == recorder.pid


def open_files():
    gc.collect()
    return len(os.listdir("/proc/self/fd"))


@pytest.mark.evidence
@pytest.mark.parametrize(
    ("kills", "lost_s"),
    [(3, 5.0), pytest.param(200, 1.0, marks=[pytest.mark.evidence, pytest.mark.timeout(3600)])],
)
def test_killed_at_any_instant_it_leaves_what_can_be_read(kills, lost_s, tmp_path):
    draw, rows = random.Random(1), table(100_000)
    missing_s, descriptors = [], []
    for number in range(kills):
        file = tmp_path / f"{number}.rrd"
        started = number % 3 > 0  # else it may not even have begun to read
        with RowWriter(SIGNALS) as ring:
            recorder = RecorderProcess(RecordingTask(ring.name, str(file)))
            times_s: list[float] = []
            while started and not any_recorded(file):
                write_next(ring, rows, times_s)
            end_s = time.monotonic() + draw.uniform(0, 1)
            while time.monotonic() < end_s:
                write_next(ring, rows, times_s)
            recorder._process.kill()
            killed_s = time.monotonic()
            for _ in range(20):  # nobody is waited for
                write_next(ring, rows, times_s)
            with pytest.raises(RecorderError, match="exit code -9"):
                recorder.stop()
        kept = recorded(file) if any_recorded(file) else rows[:0]
        np.testing.assert_allclose(kept, rows[: len(kept)], rtol=4e-16)
        if started:
            assert len(kept)
            missing_s.append(killed_s - times_s[len(kept) - 1])
        file.unlink(missing_ok=True)
        descriptors.append(open_files())
    print(f"{kills} kills; lost at most {max(missing_s):.2f} s")
    assert max(missing_s) <= lost_s
    wait_for(lambda: open_files() <= descriptors[0])  # some are closed a little later


def write_next(ring, rows, times_s):
    ring.write(rows[len(times_s)])
    times_s.append(time.monotonic())
    time.sleep(0.002)


def test_a_stopped_recorder_costs_rows_counts_them_and_holds_up_nobody(tmp_path):
    file = tmp_path / "run.rrd"
    rows = table(300)
    with RowWriter(SIGNALS, slots=64) as ring:
        recorder = RecorderProcess(RecordingTask(ring.name, str(file)))
        os.kill(recorder._process.pid, signal.SIGSTOP)
        feed(ring, rows)
        os.kill(recorder._process.pid, signal.SIGCONT)
    report = recorder.stop()
    assert report == RecorderReport(rows=64, lost=236, parts=1)
    np.testing.assert_allclose(recorded(file), rows[236:], rtol=4e-16)
    states = [Mode(number).name for number in sorted(set(rows[236:, SIGNALS.index("mode")]))]
    assert [line.text for line in text_log(file)] == [
        *states,
        "236 rows lost: the recorder was too slow",
    ]


@pytest.mark.evidence
def test_lost_events_are_noted_in_the_recording(tmp_path):
    file = tmp_path / "run.rrd"
    with EventWriter() as events, RowWriter(SIGNALS) as ring:
        recorder = RecorderProcess(RecordingTask(ring.name, str(file), events=events.name))
        os.kill(recorder._process.pid, signal.SIGSTOP)
        for number in range(1000):
            events.write_event(RetuningEvent(number, RetuningState.IDENTIFY, ("ordered",)), 0)
        feed(ring, table(2))
        os.kill(recorder._process.pid, signal.SIGCONT)
    recorder.stop()
    texts = [line.text for line in text_log(file)]
    (lost,) = (int(text.split()[0]) for text in texts if "events lost" in text)
    assert lost + sum("ordered" in text for text in texts) == 1000 > lost > 0


def test_events_are_recorded_with_their_time_and_reasons(tmp_path):
    file = tmp_path / "run.rrd"
    began = RetuningEvent(5_000_000_000, RetuningState.IDENTIFY, ("ordered by the operator",))
    refused = RetuningEvent(7_500_000_000, RetuningState.REFUSED, ("too short", "or too long"))
    with EventWriter() as events, RowWriter(SIGNALS) as ring:
        events.write_event(began, 4_000_000_000)  # before the recorder is there
        recorder = RecorderProcess(RecordingTask(ring.name, str(file), events=events.name))
        feed(ring, table(100))
        events.write_event(refused, 4_000_000_000)
    assert recorder.stop() == RecorderReport(rows=100, lost=0, parts=1)
    assert [line for line in text_log(file) if "retuning" in line.text] == [
        Line(1_000_000_000, "INFO", "retuning IDENTIFY: ordered by the operator"),
        Line(3_500_000_000, "WARN", "retuning REFUSED: too short; or too long"),
    ]


def test_a_recorder_ends_with_a_killed_controller_and_keeps_its_last_words(tmp_path):
    file = tmp_path / "run.rrd"
    code = f"""
import os, signal, sys
import numpy as np
from utank_hil.canbus import RetuningState
from utank_hil.canbus.events import RetuningEvent
from utank_hil.telemetry.events import EventWriter
from utank_hil.telemetry.ring import RowWriter
ring, events = RowWriter({SIGNALS!r}), EventWriter()
print(ring.name, events.name, flush=True)
sys.stdin.readline()
ring.write(np.zeros({len(SIGNALS)}))
events.write_event(RetuningEvent(0, RetuningState.REFUSED, ("why it was",)), 0)
os.kill(os.getpid(), signal.SIGKILL)
"""
    writer = subprocess.Popen(
        [sys.executable, "-c", code],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
        text=True,
    )
    ring, events = writer.stdout.readline().split()
    recorder = RecorderProcess(RecordingTask(ring, str(file), events=events))
    writer.communicate("\n")
    wait_for(lambda: recorder._process.poll() == 0)
    assert recorder.stop() == RecorderReport(rows=1, lost=0, parts=1)
    assert "retuning REFUSED: why it was" in [line.text for line in text_log(file)]


@pytest.mark.evidence("1", "15")
@pytest.mark.parametrize("stop", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
def test_it_ends_on_a_signal_with_all_rows(tmp_path, stop):
    file = tmp_path / "run.rrd"
    command = [sys.executable, "-W", "error", "-m", "utank_hil.telemetry.recorder"]
    with RowWriter(SIGNALS) as ring:
        state = RecorderState(RecordingTask(ring.name, str(file))).as_input()
        process = subprocess.Popen(command, stdin=state, stdout=subprocess.PIPE, text=True)
        process.stdout.readline()
        feed(ring, table(7))
        process.send_signal(stop)
        output, _ = process.communicate(timeout=20)
    assert process.returncode == 0
    assert json.loads(output) == {"rows": 7, "lost": 0, "parts": 1, "records_lost": 0}
    assert len(recorded(file)) == 7


@pytest.mark.evidence
def test_recorder_whose_starter_is_gone_ends_without_a_complaint(tmp_path, capfd):
    file = tmp_path / "run.rrd"
    with RowWriter(SIGNALS) as ring:
        recorder = RecorderProcess(RecordingTask(ring.name, str(file)))
        recorder._output.close()  # as if this process were dead
        feed(ring, table(5))
    assert recorder._process.wait(20) == 0
    assert capfd.readouterr().err == ""
    RrdReader(file).store()  # needs the footer


STRAY = """
import os, sys
os.write(1, b'{"ready": 1}\\n' + bytes.fromhex(sys.argv[1]))
"""


@pytest.mark.parametrize("end", ["", "; os._exit(3)"], ids=["ended well", "failed"])
@pytest.mark.parametrize(
    "output",
    [
        b"thread panicked\n",
        b'{"rows": 7, "lo',
        b"\xff\n",
        b"[7]\n",
        b'{"rows": "x"}\n',
        b'{"y": 1}\n',
    ],
)
def test_what_a_dead_recorder_left_on_its_output_ends_no_controller(
    output, end, tmp_path, monkeypatch
):
    """The loop asks it why it has ended."""
    popen = subprocess.Popen

    def stray(command, **options):
        code = STRAY + end.lstrip("; ")
        return popen([sys.executable, "-c", code, output.hex()], **options)

    monkeypatch.setattr(subprocess, "Popen", stray)
    with RowWriter(SIGNALS) as ring:
        recorder = RecorderProcess(RecordingTask(ring.name, str(tmp_path / "run.rrd")))
        wait_for(lambda: recorder.has_ended)
        with pytest.raises(RecorderError, match="exit code 3" if end else "how it went"):
            recorder.stop()


@pytest.mark.timeout(20)
def test_a_pipe_that_a_dead_recorders_child_holds_open_holds_nobody_up(tmp_path, monkeypatch):
    popen = subprocess.Popen
    code = """
import os, time
os.write(1, b'{"ready": 1}\\n')
if os.fork() == 0:
    time.sleep(60)
"""
    monkeypatch.setattr(
        subprocess,
        "Popen",
        lambda command, **options: popen([sys.executable, "-c", code], **options),
    )
    with RowWriter(SIGNALS) as ring:
        recorder = RecorderProcess(RecordingTask(ring.name, str(tmp_path / "run.rrd")))
        try:
            wait_for(lambda: recorder.has_ended)
            with pytest.raises(RecorderError, match="how it went"):
                recorder.stop()
        finally:
            os.killpg(recorder.pid, signal.SIGKILL)


def test_reason_of_a_failure_is_told_where_standard_error_takes_nothing(tmp_path):
    state = RecorderState(RecordingTask("utank-none", str(tmp_path / "run.rrd"))).as_input()
    command = [sys.executable, "-m", "utank_hil.telemetry.recorder"]
    with open("/dev/full", "w") as full:
        ended = subprocess.run(command, stdin=state, stdout=subprocess.PIPE, stderr=full)
    assert ended.returncode == 1
    assert "is its writer running" in json.loads(ended.stdout)["error"]


@pytest.mark.evidence
def test_a_full_disk_ends_the_recorder_and_leaves_what_was_written(tmp_path):
    file = tmp_path / "run.rrd"
    limit = 400_000  # the layout takes most of it
    command = [sys.executable, "-X", "dev", "-m", "utank_hil.telemetry.recorder"]
    with RowWriter(SIGNALS) as ring:
        process = subprocess.Popen(
            ["prlimit", f"--fsize={limit}", *command],
            stdin=RecorderState(RecordingTask(ring.name, str(file))).as_input(),
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
        )
        process.stdout.readline()
        feed(ring, table(100))
        time.sleep(1.0)
        feed(ring, table(8000))
    try:
        _, complaint = process.communicate(timeout=30)
    finally:
        process.kill()
    assert process.returncode == 1
    assert f"recording {file} failed" in complaint
    assert file.stat().st_size <= limit
    np.testing.assert_allclose(recorded(file)[:100], table(100), rtol=4e-16)


@pytest.mark.evidence("3000")
@pytest.mark.parametrize("rows", [300, 3000])
def test_file_that_lacks_its_end_or_its_rows_is_a_failure_with_its_reason(tmp_path, rows):
    """As on a full disk: with few rows only the footer does not fit, and Rerun says nothing."""
    file = tmp_path / "run.rrd"
    with RowWriter(SIGNALS) as ring:
        recorder = RecorderProcess(RecordingTask(ring.name, str(file)))
        feed(ring, table(100))
        wait_for(lambda: any_recorded(file))
        pid = recorder._process.pid
        subprocess.run(["prlimit", f"--pid={pid}", "--fsize=400000"], check=True)
        feed(ring, table(rows)[100:])
    with pytest.raises(RecorderError, match="the recorder failed: ") as caught:
        recorder.stop()
    with pytest.raises(RecorderError, match="the recorder failed: "):
        recorder.close()
    assert "exit code" not in str(caught.value)
    assert len(recorded(file)) >= 100
    if rows == 300:
        assert "its 300 rows are written" in str(caught.value)
        assert len(recorded(file)) == 300


@pytest.mark.evidence
def test_where_it_may_go_on_in_another_file_it_does_so_when_there_is_room_again(tmp_path, capfd):
    file = tmp_path / "run-a.rrd"

    def limit(words):
        subprocess.run(["prlimit", f"--pid={recorder.pid}", f"--fsize={words}"], check=True)

    def failed():
        complaint.append(capfd.readouterr().err)
        return "tried again every 10 s" in "".join(complaint)

    complaint: list[str] = []
    with RowWriter(SIGNALS) as ring:
        recorder = RecorderProcess(RecordingTask(ring.name, str(file), part_s=3600.0))
        feed(ring, table(100))
        wait_for(lambda: any_recorded(file))
        limit("400000:unlimited")
        feed(ring, table(700)[100:])
        wait_for(failed)
        limit("unlimited")
        wait_for(lambda: any_recorded(tmp_path / "run-a-part002.rrd"))
        feed(ring, table(750)[700:])
    report = recorder.stop()
    assert (report.rows, report.lost, report.parts) == (750, 0, 2)
    assert "".join(complaint).count("failed") == 1
    assert file.stat().st_size <= 400_000  # nothing was written behind what is missing
    np.testing.assert_allclose(recorded(file)[:100], table(100), rtol=4e-16)
    later = recorded(tmp_path / "run-a-part002.rrd")
    np.testing.assert_allclose(later, table(750)[-len(later) :], rtol=4e-16)
    assert len(later) >= 600


@pytest.mark.evidence
def test_where_nobody_writes_any_more_no_further_file_is_tried(tmp_path, capfd):
    """Else it would go on for ever: a folder that is gone does not come back."""
    folder = tmp_path / "log"
    folder.mkdir()
    with RowWriter(SIGNALS) as ring:
        recorder = RecorderProcess(
            RecordingTask(ring.name, str(folder / "run-a.rrd"), part_s=3600.0)
        )
        feed(ring, table(100))
        wait_for(lambda: any_recorded(folder / "run-a.rrd"))
        subprocess.run(["prlimit", f"--pid={recorder.pid}", "--fsize=400000:unlimited"], check=True)
        feed(ring, table(700)[100:])
        wait_for(lambda: "tried again" in capfd.readouterr().err)
        shutil.rmtree(folder)
    wait_for(lambda: recorder.has_ended, seconds=30.0)
    with pytest.raises(RecorderError, match="the recorder failed"):
        recorder.stop()


def test_failures_to_start_are_reported(tmp_path, capfd):
    with pytest.raises(RecorderError, match=r"did not start: .* is its writer running"):
        RecorderProcess(RecordingTask("utank-no-such-ring", str(tmp_path / "run.rrd")))
    assert "is its writer running" in capfd.readouterr().err
    with RowWriter(SIGNALS) as ring, pytest.raises(RecorderError, match="no-such-folder"):
        RecorderProcess(RecordingTask(ring.name, str(tmp_path / "no-such-folder" / "run.rrd")))
    assert "no-such-folder" in capfd.readouterr().err
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    try:
        resource.setrlimit(resource.RLIMIT_FSIZE, (100_000, before[1]))  # the child has it too
        with (
            RowWriter(["time_s"], slots=2) as ring,
            pytest.raises(RecorderError, match=r"did not start: .*File too large"),
        ):
            RecorderProcess(RecordingTask(ring.name, str(tmp_path / "run.rrd")))
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)
