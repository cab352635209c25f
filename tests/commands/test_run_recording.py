"""A run's recording: named by its time, and never a reason not to control."""

import errno
import json
import os
import re
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path
from types import SimpleNamespace
from typing import cast

import numpy as np
import pytest
from ports import QuietBus
from typer.testing import CliRunner

from utank_hil.canbus import Fault, Mode
from utank_hil.cli import app
from utank_hil.commands import recording as module
from utank_hil.commands import run as command
from utank_hil.commands.recording import RecordingSummary, RunRecording
from utank_hil.nodes.controller import ControllerNode
from utank_hil.nodes.signals import SIGNALS
from utank_hil.runners import LoopStatistics
from utank_hil.telemetry.ring import RowReader
from utank_hil.telemetry.run_log import RunLogTask, read_run_log

SHM = Path("/dev/shm")


def rings() -> set[str]:
    return {path.name for path in SHM.glob(f"utank-{os.getpid()}-*")}


def rows(count: int) -> np.ndarray:
    values = np.zeros((count, len(SIGNALS)))
    values[:, SIGNALS.index("time_s")] = np.arange(count) / 100
    return values


def record(folder: Path, count: int) -> RecordingSummary:
    before = rings()
    recording = RunRecording(folder)
    for row in rows(count):
        recording.write(row)
    recording.stop()
    recording.stop()  # twice is as good as once
    assert rings() <= before
    return recording.summary


class Instant:
    """A recorder that leaves a file and takes no time."""

    error = ""

    def __init__(self, _what: str, _main: object, task: RunLogTask) -> None:
        task.file.write_text(task.rows)

    def failure(self) -> str:
        return ""

    def stop(self, _say: object) -> dict[str, int]:
        return {"rows": 5, "lost": 2}


@pytest.mark.slow
def test_every_row_is_in_a_file_named_by_the_time(tmp_path: Path) -> None:
    summary = record(tmp_path / "new" / "folder", 33)
    assert summary.file is not None
    assert re.fullmatch(r"run-\d{8}T\d{6}Z\.frames", Path(summary.file).name)
    assert (summary.rows, summary.lost, summary.error) == (33, 0, None)
    assert len(read_run_log(Path(summary.file)).rows) == 33


def test_no_recording_is_overwritten_however_soon_the_next_run_comes(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(module, "Beside", Instant)
    files = {record(tmp_path, 1).file for _ in range(20)}
    assert len(files) == 20
    assert {str(path) for path in tmp_path.iterdir()} == files
    assert len({path.read_text() for path in tmp_path.iterdir()}) == 20


def test_lost_rows_are_told(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "Beside", Instant)
    summary = record(tmp_path, 1)
    assert (summary.rows, summary.lost, summary.error) == (5, 2, None)


@pytest.mark.parametrize("keep_bytes", [None, 2_500_000])
def test_a_recording_goes_on_in_another_file_each_hour_within_the_bound(
    keep_bytes: int | None, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    given: list[object] = []

    def recorder(what: str, main: object, task: RunLogTask) -> Instant:
        given.append((task.part_s, task.keep_bytes))
        return Instant(what, main, task)

    monkeypatch.setattr(module, "Beside", recorder)
    RunRecording(tmp_path, keep_bytes=keep_bytes).stop()
    assert given == [(3600.0, keep_bytes)]


@pytest.mark.slow
@pytest.mark.parametrize(("words", "keep_bytes"), [((), None), (("--keep", "2.5"), 2_500_000)])
def test_run_hands_on_the_bound_of_its_recordings(
    words: tuple[str, ...], keep_bytes: int | None, monkeypatch: pytest.MonkeyPatch
) -> None:
    given: list[object] = []

    def refuse(*_: object, **named: object) -> None:
        given.append(named["keep_bytes"])
        raise OSError(errno.EMFILE, "Too many open files")

    monkeypatch.setattr("utank_hil.canbus.socketcan.SocketCanPort", QuietBus)
    monkeypatch.setattr(command, "RunRecording", refuse)
    CliRunner().invoke(app, ["run", "configs/controllers/gpc.yaml", "--bus", "any0", *words])
    assert given == [keep_bytes]


@pytest.mark.parametrize("place", ["file", "/proc/nowhere"])
def test_folder_that_can_not_be_is_told_and_the_run_goes_on(tmp_path: Path, place: str) -> None:
    (tmp_path / "file").write_text("mine")
    folder = tmp_path / place
    summary = record(folder, 10)
    assert summary.file is None
    assert summary.rows is None
    assert summary.error is not None
    assert str(folder) in summary.error
    assert (tmp_path / "file").read_text() == "mine"


def test_recorder_that_does_not_start_is_told_and_leaves_no_ring_behind(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    # a folder that is gone when the recorder comes to it, as a disk may be
    folder = tmp_path / "gone"

    def unplugged(what: str, _main: object, _task: RunLogTask) -> Instant:
        shutil.rmtree(folder)
        raise OSError(f"{what} did not start: no such folder")

    monkeypatch.setattr(module, "Beside", unplugged)
    summary = record(folder, 10)
    assert summary.file is None
    assert summary.error is not None
    assert "did not start" in summary.error


def test_without_a_recorder_viewers_still_see_the_run(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def full(what: str, _main: object, _task: RunLogTask) -> Instant:
        raise OSError(f"{what} did not start: no room")

    monkeypatch.setattr(module, "Beside", full)
    before = rings()
    recording = RunRecording(tmp_path, head={"about": {}})
    assert not recording.keeps_records
    (ring,) = rings() - before
    with RowReader(ring) as viewer:
        recording.write(rows(1)[0])
        assert viewer.columns == SIGNALS
        assert len(viewer.read_rows()) == 1
    recording.stop()
    assert rings() <= before


def test_recorder_that_fails_on_the_way_is_told_with_its_file(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    class Failing(Instant):
        error = "the recorder ended with code 1"

        def stop(self, _say: object) -> dict[str, int]:
            return {}

    monkeypatch.setattr(module, "Beside", Failing)
    summary = record(tmp_path, 10)
    assert summary.file is not None
    assert summary.error == "the recorder ended with code 1"
    assert summary.rows is None


@pytest.mark.slow
def test_recorder_that_is_killed_is_told_once_while_the_run_goes_on(tmp_path: Path) -> None:
    recording = RunRecording(tmp_path)
    assert recording._recorder.pid is not None
    assert recording.failure() == ""
    os.kill(recording._recorder.pid, signal.SIGTERM)  # as a service manager does: no end
    time.sleep(0.2)
    assert recording.failure() == ""
    os.kill(recording._recorder.pid, signal.SIGKILL)
    recording._recorder._process.join()
    words = "the recorder ended with code -9"
    assert [recording.failure() for _ in range(3)] == [words, "", ""]
    for row in rows(10):
        recording.write(row)
    recording.stop()
    assert recording.summary.error == words


@pytest.mark.evidence
def test_run_says_within_a_second_that_nothing_is_recorded_or_logged_any_longer(
    tmp_path: Path,
) -> None:
    program = (
        "import ports, utank_hil.canbus.socketcan\n"
        "utank_hil.canbus.socketcan.SocketCanPort = ports.QuietBus\n"
        "from utank_hil.cli import main; main()"
    )
    gpc = "configs/controllers/gpc.yaml"
    words = ["run", gpc, "--bus", "any0", "--duration", "60", "--out", str(tmp_path), "--json"]
    with subprocess.Popen(
        [sys.executable, "-c", program, *words],
        env=os.environ | {"PYTHONPATH": str(Path(__file__).parent)},
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    ) as run:
        assert run.stderr is not None
        told: list[str] = []
        for line in run.stderr:
            told.append(line)
            if "Ctrl-C ends it" in line:
                logs, records = children_of(run.pid)
                os.kill(records, signal.SIGKILL)
            if "not recorded" in line:
                os.kill(logs, signal.SIGKILL)
            if "not logged" in line:
                break
        run.send_signal(signal.SIGINT)
        output = run.communicate()[0]
    lost = "the process that logs events ended with code -9"
    assert told[-2] == "not recorded any longer: the recorder ended with code -9\n"
    assert told[-1] == f"events are not logged any longer: {lost}\n"
    report = json.loads(output)
    assert report["recording"]["error"] == "the recorder ended with code -9"
    assert report["log_error"] == lost


def children_of(run: int) -> list[int]:
    """The processes beside the loop, in the order in which they were started."""
    children = Path(f"/proc/{run}/task/{run}/children").read_text().split()
    spawned = b"multiprocessing.spawn"
    return sorted(
        int(child) for child in children if spawned in Path(f"/proc/{child}/cmdline").read_bytes()
    )


@pytest.mark.parametrize("rows", [0, 3])
def test_a_run_that_ended_before_its_first_tick_waits_for_nothing(rows: int, capsys) -> None:
    law = SimpleNamespace(events=(), error="", fallbacks=0)
    node = SimpleNamespace(mode=Mode.INIT, fault=Fault.NONE, law=law)
    summary = RecordingSummary(file="log/run.frames", rows=rows)
    command._print_summary("mine", cast(ControllerNode, node), LoopStatistics(), summary)
    said = capsys.readouterr().out
    assert "ended in INIT\n" in said
    assert ("utank-hil report" in said) is (rows > 0)
