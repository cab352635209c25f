"""The deployed controller and the ship's side in two processes on a real SocketCAN interface."""

import signal
import time
from contextlib import closing
from dataclasses import dataclass, field
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from busy_machine import first_that_can_be_judged
from two_processes import (
    Candump,
    Logged,
    link_down,
    patient_controller,
    run_controller,
    run_ship,
    watched,
)

from utank_hil.canbus import ControlWord, DriveState, Fault, Mode
from utank_hil.console.exit_codes import ExitCode
from utank_hil.safety.faults import fault_text
from utank_hil.telemetry.run_log import read_run_log

pytestmark = [pytest.mark.socketcan, pytest.mark.timeout(900)]

STORM = Path("configs/scenarios/storm.yaml")
TIMEOUT_S = 0.05
COMMAND_S = 0.02  # from one pump command to the next


def controller_into(folder, out):
    return run_controller(folder, patient_controller(folder), "--out", out)


def only_recording(folder):
    """The recording of the one run that was recorded there."""
    (file,) = folder.glob("run-*.frames")
    return file


@dataclass
class Story:
    """What happened on the bus, and what the programs left behind."""

    log: list[Logged] = field(default_factory=list)
    recordings: list[dict[str, np.ndarray]] = field(default_factory=list)
    reports: list[dict[str, object]] = field(default_factory=list)
    statuses_after_restart: int = 0
    killed_states: set[DriveState | None] = field(default_factory=set)

    def of(self, name):
        return [frame for frame in self.log if frame.name == name]


@pytest.fixture(scope="module")
def story(tmp_path_factory):
    return first_that_can_be_judged(tell_story, tmp_path_factory.mktemp("story"))


def tell_story(folder):
    """Arm, drive for a while, kill the controller, restart it, end both."""
    told = Story()
    again = folder / "again"
    again.mkdir()
    with closing(Candump(folder)) as candump:
        with watched() as watcher, run_ship(folder, STORM) as ship:
            watcher.wait(lambda w: w.drive is not None)
            with controller_into(folder, folder / "first") as controller:
                watcher.wait_in_charge(15e3)
                controller.signal(signal.SIGKILL)
            watcher.forget()
            watcher.watch(1.0)
            told.killed_states = {watcher.drive.state}
            with controller_into(again, folder / "second") as controller:
                watcher.wait(lambda w: w.statuses >= 50)  # five seconds of it
                told.statuses_after_restart = watcher.statuses
                told.reports.append(controller.end()[0])
            told.reports.append(ship.end()[0])
        told.log = candump.stop()
    for name in ("first", "second"):
        told.recordings.append(read_run_log(only_recording(folder / name)).signals)
    return told


def test_every_frame_decodes_with_the_dbc_to_values_within_its_ranges(story):
    names = {frame.name for frame in story.log}
    assert names >= {
        "PUMP_CMD", "DRIVE_STATUS_1", "DRIVE_STATUS_2", "SENSOR_MOTION", "SENSOR_TANK",
        "SENSOR_PUMP", "CTRL_STATUS", "OPERATOR_CMD", "HEARTBEAT_CONTROLLER", "HEARTBEAT_DRIVE",
        "HEARTBEAT_SENSORS", "HEARTBEAT_OPERATOR", "ADDRESS_CLAIM_CONTROLLER",
    }  # fmt: skip
    assert len(story.of("SENSOR_MOTION")) > 1500
    for frame in story.of("SENSOR_MOTION"):
        assert abs(frame.signals["roll_rad"]) < 0.2
        assert abs(frame.signals["roll_rate_rad_s"]) < 0.2
        assert frame.signals["quality"] == 0
    for frame in story.of("SENSOR_TANK"):
        assert abs(frame.signals["starboard_level_m"] + frame.signals["port_level_m"]) < 0.1
    for frame in story.of("PUMP_CMD"):
        assert abs(frame.signals["pressure_pa"]) <= 50e3
        assert frame.signals["timeout_s"] == TIMEOUT_S
        assert frame.signals["control_word"] in set(ControlWord)
    # the roll of one ship, not of many: it moves by its own rate
    rolls = np.array([[f.time_s, f.signals["roll_rad"]] for f in story.of("SENSOR_MOTION")])
    steps_s, steps_rad = np.diff(rolls, axis=0).T  # a busy machine leaves gaps
    assert (np.abs(steps_rad) < 0.03 + 0.2 * (steps_s - 0.01).clip(0.0)).all()


def test_pressure_flows_once_the_controller_is_in_charge(story):
    modes = [frame.signals["mode"] for frame in story.of("CTRL_STATUS")]
    assert Mode.ACTIVE in modes
    assert max(abs(frame.signals["pressure_pa"]) for frame in story.of("PUMP_CMD")) > 15e3
    assert max(abs(frame.signals["pressure_pa"]) for frame in story.of("SENSOR_PUMP")) > 15e3
    armed_s = next(f.time_s for f in story.of("OPERATOR_CMD") if f.signals["arm"])
    for frame in story.of("PUMP_CMD"):
        if frame.time_s < armed_s:
            assert frame.signals["pressure_pa"] == 0.0


def restart_s(story):
    """When the second controller first spoke, after the longest pause between two commands."""
    assert len(story.of("ADDRESS_CLAIM_CONTROLLER")) == 2
    times = [frame.time_s for frame in story.of("PUMP_CMD")]
    pause_s, second_s = max((later - earlier, later) for earlier, later in pairwise(times))
    assert pause_s > 1.0
    return second_s


def test_commands_on_the_bus_are_those_in_the_controllers_telemetry(story):
    commands = [f for f in story.of("PUMP_CMD") if f.time_s < restart_s(story)]
    on_bus = np.array([frame.signals["pressure_pa"] for frame in commands])
    # a command leaves at every second tick, and every fifth has a row: those of even ticks agree
    recording = story.recordings[0]
    even = np.round(100 * recording["time_s"]) % 2 == 0
    shown = recording["pressure_command_pa"][even]
    assert len(shown) > 40
    place = -1
    for pressure_pa in shown:
        same = np.abs(on_bus[place + 1 :] - pressure_pa) <= 4.0 + 1e-6
        assert same.any(), f"{pressure_pa} Pa never left after command {place}"
        place += 1 + int(np.argmax(same))
    # as many as left in that time: rows that the recorder missed are gaps in both
    times_s = recording["time_s"][even]
    left = (times_s[-1] - times_s[0]) / COMMAND_S
    assert 0.95 * left - 5 < place < left + 5


def test_killed_controllers_drive_is_at_zero_within_100_ms_of_its_last_command(story):
    last_s = max(f.time_s for f in story.of("PUMP_CMD") if f.time_s < restart_s(story))
    states = [(f.time_s, f.signals["state"]) for f in story.of("DRIVE_STATUS_1")]
    before = [state for time_s, state in states if time_s <= last_s]
    assert before[-1] == DriveState.OPERATION_ENABLED
    off_s = next(t for t, state in states if t > last_s and state != DriveState.OPERATION_ENABLED)
    print(f"drive off {1e3 * (off_s - last_s):.1f} ms after the last command")
    # were the drive's process held up by the machine, its 10 ms messages would be too
    ticks = [f.time_s for f in story.of("SENSOR_MOTION") if last_s - 0.1 <= f.time_s <= off_s]
    held_up_s = max(later - earlier for earlier, later in pairwise(ticks)) - 0.01
    print(f"ship's process held up by {1e3 * held_up_s:.1f} ms meanwhile")
    assert TIMEOUT_S - 0.01 < off_s - last_s <= 0.1 + max(held_up_s - 0.02, 0.0)
    after = {state for time_s, state in states if time_s >= off_s}
    assert after == {DriveState.FAULT_REACTION_ACTIVE, DriveState.FAULT}
    assert story.killed_states == {DriveState.FAULT}
    pressures = [(f.time_s - off_s, f.signals["pressure_pa"]) for f in story.of("SENSOR_PUMP")]
    at_trip = next(abs(p) for t, p in pressures if t >= 0)
    left = {wait_s: next(abs(p) for t, p in pressures if t >= wait_s) for wait_s in (0.1, 0.2, 0.5)}
    print("pressure at the trip", at_trip, "and after", left)
    # the motor brakes; the ship's process may be held up here, too
    assert left[0.2] < max(0.1 * at_trip, 2.5e3)
    assert left[0.5] < 2.5e3


def test_restarted_controller_waits_in_standby_for_the_operator(story):
    since_s = restart_s(story)
    assert story.of("OPERATOR_CMD")[-1].signals["arm"]  # the panel still holds it
    modes = {f.signals["mode"] for f in story.of("CTRL_STATUS") if f.time_s >= since_s}
    assert story.statuses_after_restart >= 50
    assert Mode.STANDBY in modes
    assert modes <= {Mode.INIT, Mode.STANDBY}
    commands = [f.signals for f in story.of("PUMP_CMD") if f.time_s >= since_s]
    assert {signals["pressure_pa"] for signals in commands} == {0.0}
    enabling = {ControlWord.SWITCH_ON, ControlWord.ENABLE_OPERATION, ControlWord.FAULT_RESET}
    assert not {signals["control_word"] for signals in commands} & enabling


def test_both_end_cleanly_with_the_pump_at_zero_and_readable_recordings(story):
    last = story.of("PUMP_CMD")[-1].signals
    assert last["pressure_pa"] == 0.0
    assert last["control_word"] in (ControlWord.QUICK_STOP, ControlWord.DISABLE_VOLTAGE)
    controller, ship = story.reports
    assert controller["mode"] == "STANDBY"
    assert ship["refused_commands"] == 0
    loop = controller["loop"]
    assert isinstance(loop, dict)
    assert loop["send_errors"] == loop["receive_errors"] == 0
    killed, ended = story.recordings
    assert killed["mode"][-1] == Mode.ACTIVE
    assert ended["mode"][-1] == Mode.STANDBY
    for recording in (killed, ended):
        assert (np.diff(recording["time_s"]) > 0).all()
        assert recording["time_s"][-1] > 3.0


def test_counters_step_by_one_so_nothing_was_lost(story):
    for name in ("SENSOR_MOTION", "SENSOR_TANK", "DRIVE_STATUS_1"):
        counters = [int(frame.signals["counter"]) for frame in story.of(name)]
        assert {(b - a) % 16 for a, b in pairwise(counters)} == {1}


def take_the_link_down(folder):
    """Interface down for half a second under an armed controller; its report and recording."""
    with (
        watched() as watcher,
        run_ship(folder, STORM) as ship,
        controller_into(folder, folder / "out") as controller,
    ):
        watcher.wait_in_charge()
        with link_down():
            time.sleep(0.5)
        watcher.forget()
        watcher.wait(lambda w: w.mode is Mode.FAULT)
        watcher.watch(2.0)  # the link is back, arming is not
        assert (watcher.status.mode, watcher.status.fault) == (Mode.FAULT, Fault.BUS_LOST)
        assert watcher.drive.state is DriveState.FAULT
        report, notes = controller.end(ExitCode.BUS_LOST)
        ship.end()
        assert f"ALARM in FAULT: {fault_text(Fault.BUS_LOST)}" in notes
    return report, only_recording(folder / "out")


@pytest.mark.evidence  # test_port.py takes the link down, too
def test_interface_that_goes_down_under_an_armed_controller_latches_a_fault(tmp_path):
    report, file = first_that_can_be_judged(take_the_link_down, tmp_path)
    assert (report["mode"], report["fault"]) == ("FAULT", "BUS_LOST")
    recording = read_run_log(file).signals
    faulted = recording["mode"] == Mode.FAULT
    assert faulted.any()
    assert (recording["pressure_command_pa"][faulted] == 0.0).all()
