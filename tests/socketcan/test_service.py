"""The service of deploy/ on a booted systemd: starts, is watched, starts again, never arms."""

import time
from contextlib import closing
from pathlib import Path

import pytest
import yaml
from booted_system import ETC, LOGS, BootedSystem, needed_here
from busy_machine import first_that_can_be_judged
from two_processes import CHANNEL, CONFIGS, link_down, patient_controller, run_ship, watched

from utank_hil.canbus import DriveState, Fault, Mode
from utank_hil.runners.process_priority import PRIORITY

pytestmark = [pytest.mark.socketcan, pytest.mark.evidence, pytest.mark.timeout(1800)]

STORM = Path("configs/scenarios/storm.yaml")
PRESSURE_PA = 10e3
SECCOMP_FILTER = "2"  # of /proc/PID/status
SCHED_FIFO = "1"  # field 41 of /proc/PID/stat


@pytest.fixture
def system():
    needed_here()
    with closing(BootedSystem(CHANNEL)) as booted:
        yield booted


def configure(folder, **changed):
    """Put a controller's file, and its ship's, where the unit looks for them."""
    content = yaml.safe_load(patient_controller(folder, 100.0).read_text())
    (ETC / "ship.yaml").write_bytes((CONFIGS / "ships/thesis_first.yaml").read_bytes())
    content |= {"vessel": "ship.yaml", **changed}
    (ETC / "controller.yaml").write_text(yaml.safe_dump(content))


def is_confined(system):
    """Its process has what the unit leaves it, and real time."""
    pid = system.shown("MainPID")
    lines = system.run("cat", f"/proc/{pid}/status").splitlines()
    status = dict(line.split(":\t", 1) for line in lines)
    assert {status[f"Cap{kind}"] for kind in ("Prm", "Eff", "Bnd", "Amb")} == {"0" * 16}
    assert (status["NoNewPrivs"], status["Seccomp"]) == ("1", SECCOMP_FILTER)
    assert "0" not in status["Uid"].split()
    fields = system.run("cat", f"/proc/{pid}/stat").rpartition(")")[2].split()
    assert (fields[37], fields[38]) == (str(PRIORITY), SCHED_FIFO)


def starts_again_in_standby(system, watcher, starts):
    """By itself; the ship's panel still holds the arm bit, and nothing is armed."""
    system.wait("NRestarts", str(starts))
    system.wait("SubState", "running")
    watcher.forget()
    watcher.wait(lambda w: w.mode is Mode.STANDBY)
    watcher.watch(3.0)
    assert watcher.mode is Mode.STANDBY
    assert watcher.drive.state is not DriveState.OPERATION_ENABLED


def sail(system, folder):
    """A service that hangs under pressure, is killed, loses the interface, and is stopped."""
    configure(folder)
    system.run("systemctl", "stop", "utank-hil")  # of an attempt that could not be judged
    recordings = len(list(LOGS.resolve().glob("run-*.frames")))
    with watched() as watcher, run_ship(folder, STORM):
        watcher.wait(lambda w: w.drive is not None)
        system.run("systemctl", "start", "utank-hil", succeeds=True)  # returns when it is ready
        assert system.shown("SubState") == "running"
        is_confined(system)
        watcher.wait_in_charge(PRESSURE_PA)

        system.run("kill", "-STOP", system.shown("MainPID"))
        watcher.wait(lambda w: w.drive.state is not DriveState.OPERATION_ENABLED, 5.0)
        system.wait("NRestarts", "1", 5.0)
        assert "Failed with result 'watchdog'" in system.journal
        starts_again_in_standby(system, watcher, 1)

        system.run("kill", "-KILL", system.shown("MainPID"))
        starts_again_in_standby(system, watcher, 2)

        pid = system.shown("MainPID")
        with link_down():
            time.sleep(2.0)
        watcher.wait(lambda w: w.mode is Mode.STANDBY)
        assert (system.shown("MainPID"), system.shown("NRestarts")) == (pid, "2")
        assert f" ALARM in INIT: {Fault.BUS_LOST.name}" in system.journal

        begin_s = time.monotonic()
        system.run("systemctl", "stop", "utank-hil", succeeds=True)
        assert time.monotonic() - begin_s < 30.0
        assert system.shown("ActiveState") == "inactive"
        assert len(list(LOGS.resolve().glob("run-*.frames"))) == recordings + 3


def test_the_service_never_leaves_a_pump_alone(system, tmp_path):
    first_that_can_be_judged(lambda folder: sail(system, folder), tmp_path)


def test_a_wrong_configuration_is_not_started_again(system, tmp_path):
    configure(tmp_path, command_timeout_ms=-1)
    system.run("systemctl", "start", "utank-hil")
    system.wait("ActiveState", "failed")
    assert (system.shown("ExecMainStatus"), system.shown("Result")) == ("2", "exit-code")
    time.sleep(3.0)
    assert (system.shown("ActiveState"), system.shown("NRestarts")) == ("failed", "0")
    assert "command_timeout_ms" in system.journal
