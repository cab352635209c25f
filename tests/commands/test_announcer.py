"""What retuning does is told while it happens, by a process that outlives the loop's."""

import json
import os
import subprocess
import sys
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import pytest

from utank_hil.canbus import AlarmState, Fault, Mode, RetuningState
from utank_hil.canbus.events import AlarmEvent, ModelSummary, RetuningEvent
from utank_hil.commands import announcer as module
from utank_hil.commands.announcer import Announcer
from utank_hil.commands.identified import IdentifiedShips, read_controller
from utank_hil.commands.lines import Lines
from utank_hil.configuration import ControllerConfig, load_config
from utank_hil.telemetry.events import EventReader
from utank_hil.telemetry.ring import RingError

pytestmark = pytest.mark.slow

CONFIG = Path("configs/controllers/adaptive_dpc.yaml")
FOUND = ModelSummary(9.0, 0.01, 1.8e9, 8.8e8, 5e7, 0.12, 0.99, 1.4, 0.3)
SECOND_NS = 1_000_000_000
TRIAL = RetuningEvent(9 * SECOND_NS, RetuningState.TRIAL, ("roll period 9.00 s",), FOUND)
RETUNED = RetuningEvent(30 * SECOND_NS, RetuningState.RETUNED, (), FOUND)
REFUSED = RetuningEvent(40 * SECOND_NS, RetuningState.REFUSED, ("too [short]", "no pulses"))


def ships(folder: Path) -> IdentifiedShips:
    vessel = load_config(CONFIG, ControllerConfig).vessel
    return IdentifiedShips(folder, vessel, read_controller(CONFIG))


def wait_for(condition: Callable[[], bool], seconds: float = 30.0) -> None:
    deadline = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < deadline
        time.sleep(0.05)


def test_events_are_told_as_they_happen_and_the_ship_is_kept_when_she_is_retuned_for(
    tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    said = ""

    def told(text: str) -> bool:
        nonlocal said
        said += capfd.readouterr().err
        return text in said

    announcer = Announcer(ships(tmp_path))
    announcer.write(TRIAL, 2 * SECOND_NS)
    wait_for(lambda: told("7.0 s retuning TRIAL: roll period 9.00 s\n"))
    assert list(tmp_path.iterdir()) == []
    announcer.write(RETUNED, 2 * SECOND_NS)
    announcer.write(REFUSED, 2 * SECOND_NS)
    announcer.stop()
    announcer.stop()  # twice is as good as once
    assert announcer.error is None
    assert told("38.0 s retuning REFUSED: too [short]; no pulses\n")
    (config,) = tmp_path.glob("identified_controller-*.yaml")
    assert config.name in said
    assert load_config(config, ControllerConfig).vessel.ship.inertia_kg_m2 == 1.8e9


@pytest.mark.evidence
def test_events_that_were_too_many_are_counted(capfd: pytest.CaptureFixture[str]) -> None:
    announcer = Announcer()
    for _ in range(500):
        announcer.write(REFUSED, 0)
    announcer.stop()
    said = capfd.readouterr().err
    assert said.count("retuning REFUSED") < 500
    assert f"{500 - said.count('retuning REFUSED')} events were lost" in said


@pytest.mark.evidence
def test_without_a_folder_it_tells_and_writes_nothing(
    tmp_path: Path, capfd: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    announcer = Announcer()
    announcer.write(RETUNED, 0)
    announcer.stop()
    assert "retuning RETUNED" in capfd.readouterr().err
    assert list(tmp_path.iterdir()) == []


@pytest.mark.evidence
def test_ship_that_can_not_be_written_is_told_and_the_next_event_too(
    tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "file").write_text("mine")
    announcer = Announcer(ships(tmp_path / "file"))
    announcer.write(RETUNED, 0)
    announcer.write(REFUSED, 0)
    announcer.stop()
    said = capfd.readouterr().err
    assert "could not be written" in said
    assert said.index("could not be written") < said.index("retuning REFUSED")


def test_controller_that_is_killed_has_its_last_reasons_told_and_its_ship_kept(
    tmp_path: Path,
) -> None:
    program = tmp_path / "program.py"
    program.write_text(
        f"""
import os, signal, sys
sys.path.insert(0, {str(Path(__file__).parent)!r})
from pathlib import Path
from test_announcer import REFUSED, RETUNED, Announcer, ships

if __name__ == "__main__":
    announcer = Announcer(ships(Path({str(tmp_path / "out")!r})))
    announcer.write(RETUNED, 0)
    announcer.write(REFUSED, 0)
    os.kill(os.getpid(), signal.SIGKILL)
"""
    )
    result = subprocess.run(
        [sys.executable, str(program)], capture_output=True, text=True, check=False, timeout=60
    )  # ends when the announcer has: it holds the other end of standard error
    assert result.returncode == -9
    assert "retuning REFUSED: too [short]; no pulses" in result.stderr
    assert len(list((tmp_path / "out").glob("identified_vessel-*.yaml"))) == 1


def test_broken_pipe_keeps_no_ship_from_being_kept(tmp_path: Path) -> None:
    reading, writing = os.pipe()
    saved = os.dup(2)
    os.dup2(writing, 2)
    try:
        announcer = Announcer(ships(tmp_path))
        os.close(writing)
    finally:
        os.dup2(saved, 2)
        os.close(saved)
    os.close(reading)  # as `run ... 2>&1 | tee log` when tee is gone
    announcer.write(TRIAL, 0)
    announcer.write(RETUNED, 0)
    announcer.stop()
    assert announcer.error is None
    assert len(list(tmp_path.glob("identified_vessel-*.yaml"))) == 1


def test_a_terminal_that_is_held_up_keeps_no_event_from_the_log(tmp_path: Path) -> None:
    reading, writing = os.pipe()
    os.set_blocking(writing, False)
    while True:  # as after Ctrl-S, or with a dead ssh: nobody reads
        try:
            os.write(writing, bytes(4096))
        except BlockingIOError:
            break
    os.set_blocking(writing, True)
    saved = os.dup(2)
    os.dup2(writing, 2)
    try:
        announcer = Announcer(log=tmp_path / "events.jsonl")
    finally:
        os.dup2(saved, 2)
        os.close(saved)
        os.close(writing)
    for _ in range(5):
        announcer.write(REFUSED, 0)

    def lines() -> int:
        return (tmp_path / "events.jsonl").read_text().count('"REFUSED"')

    wait_for(lambda: lines() == 5)
    announcer.stop()
    os.close(reading)
    assert announcer.error is None


def test_events_are_logged_and_alarms_are_left_to_the_run_to_print(
    tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    log = tmp_path / "log.jsonl"
    announcer = Announcer(log=log)
    alarm = AlarmEvent(3 * SECOND_NS, Fault.LEVEL_LIMIT, AlarmState.NORMAL, Mode.STANDBY)
    announcer.write(alarm, 2 * SECOND_NS)
    announcer.write(REFUSED, 2 * SECOND_NS)
    announcer.stop()
    assert announcer.error is None
    lines = [json.loads(line) for line in log.read_text().splitlines()]
    assert [(line["event"], line["monotonic_ns"]) for line in lines] == [
        ("alarm", 3 * SECOND_NS),
        ("retuning", 40 * SECOND_NS),
    ]
    said = capfd.readouterr().err
    assert "LEVEL_LIMIT" not in said
    assert "too [short]" in said


@pytest.mark.parametrize(
    "log",
    [
        pytest.param(Path("missing/log.jsonl"), id="no folder", marks=pytest.mark.evidence),
        pytest.param(Path("/dev/full"), id="full"),
    ],
)
def test_a_log_that_can_not_be_written_is_said_and_the_rest_goes_on(
    log: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    announcer = Announcer(log=log)
    announcer.write(REFUSED, 0)
    announcer.stop()
    assert announcer.error is None
    said = capfd.readouterr().err
    assert "log" in said
    assert "too [short]" in said


def test_a_ship_that_no_file_may_hold_is_told_and_leaves_no_file(
    tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    nonsense = replace(RETUNED, found=replace(FOUND, inertia_kg_m2=-1.0))
    lines = Lines()
    module._print(nonsense, ships(tmp_path), lines)
    lines.close()
    said = capfd.readouterr().err
    assert "could not be written" in said
    assert "inertia_kg_m2" in said
    assert list(tmp_path.iterdir()) == []


def test_process_that_can_not_be_started_leaves_the_events_to_the_recorder(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    def full(_self: object) -> None:
        raise OSError(11, "no more processes")

    monkeypatch.setattr("multiprocessing.context.SpawnProcess.start", full)
    announcer = Announcer()
    assert announcer.error is not None
    assert "no more processes" in announcer.error
    assert announcer.ring is not None
    with EventReader(announcer.ring) as reader:
        announcer.write(TRIAL, 0)
        assert [event.state for event in reader.read_events()] == [RetuningState.TRIAL]
    announcer.stop()


def test_process_that_dies_at_its_start_is_an_error_at_once(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(module, "announce", os.getpid)  # takes no arguments
    announcer = Announcer()
    assert announcer.error is not None
    assert "did not start" in announcer.error
    reason = announcer.error
    announcer.write(TRIAL, 0)
    announcer.stop()
    assert announcer.error == reason


def test_process_that_died_is_an_error_and_nothing_waits_for_it() -> None:
    announcer = Announcer()
    assert announcer.failure() == ""
    announcer._process._process.kill()
    announcer._process._process.join()
    assert "ended with code -9" in announcer.failure()
    assert announcer.failure() == ""  # once
    announcer.write(TRIAL, 0)
    announcer.stop()
    assert announcer.error is not None
    assert "ended with code -9" in announcer.error


def test_no_room_for_events_is_an_error_and_writing_does_nothing(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    def full() -> None:
        raise RingError("no room for 500000 bytes in /dev/shm: it is full")

    monkeypatch.setattr(module, "EventWriter", full)
    announcer = Announcer()
    announcer.write(TRIAL, 0)
    announcer.stop()
    assert announcer.ring is None
    assert announcer.error is not None
    assert "no room" in announcer.error
