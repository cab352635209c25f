"""Controller and ship killed at random instants, signals, and an interface that flaps.

Twenty kills each take half an hour in the emulated kernel, most of it programs that start. So this
is evidence; `make test` kills one controller (`test_two_processes.py`) and takes the interface down
once (`test_port.py`).
"""

import random
import signal
import subprocess
import time
from contextlib import closing, contextmanager
from itertools import pairwise
from pathlib import Path

import pytest
from busy_machine import first_that_can_be_judged
from two_processes import (
    BIN,
    CHANNEL,
    CONFIGS,
    Candump,
    link_down,
    patient_controller,
    run_controller,
    run_ship,
    watched,
)

from utank_hil.canbus import DriveState, Fault, Mode
from utank_hil.console.exit_codes import ExitCode
from utank_hil.telemetry.run_log import read_run_log

pytestmark = [pytest.mark.socketcan, pytest.mark.evidence, pytest.mark.timeout(7200)]

KILLS = 20
FLAPS = 100
RESETS = 20
JUDGED_AGAIN_S = 12.0
"""After a gap until the tank's equation judges again. Three roll periods without end ACTIVE."""
STORM = Path("configs/scenarios/storm.yaml")
PRESSURE_PA = 10e3
ZERO_WITHIN_S = 0.25


class Panel:
    """`utank-hil panel` with actions piped in."""

    def __init__(self):
        self._process = subprocess.Popen(
            [BIN / "utank-hil", "panel", CONFIGS / "ships/thesis_first.yaml", "--bus", CHANNEL],
            stdin=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True,
        )  # fmt: skip

    def press(self, *actions):
        for action in actions:
            self._process.stdin.write(f"{action}\n")
            self._process.stdin.flush()
            time.sleep(0.7)  # longer than a button stays pressed

    def close(self):
        self._process.stdin.close()
        self._process.kill()
        self._process.wait(30)


@contextmanager
def operated():
    """Someone who watches, and a panel."""
    with closing(Panel()) as panel, watched() as watcher:
        yield watcher, panel


@contextmanager
def logged(folder):
    """The same, and a log."""
    with closing(Candump(folder)) as candump, operated() as (watcher, panel):
        yield candump, watcher, panel


def ship(folder, seed=1):
    folder.mkdir(exist_ok=True)
    return run_ship(folder, STORM, "--without", "panel", "--seed", seed, duration_s=7200)


def controller(folder):
    folder.mkdir(exist_ok=True)
    return run_controller(folder, patient_controller(folder, 100.0), "--out", folder / "out")


def arm(watcher, panel):
    """Ask for pressure as an operator does, and wait for it; before that there was none."""
    watcher.wait(lambda w: w.mode in (Mode.STANDBY, Mode.FAULT))
    panel.press("standby")
    for _ in range(RESETS):  # one is refused while frames are missed since a program starts
        panel.press("reset")
        watcher.forget()  # what it was before the reset
        watcher.wait(lambda w: w.mode is not None)
        if watcher.mode is Mode.STANDBY:
            break
    watcher.wait(lambda w: w.mode is Mode.STANDBY)
    panel.press("arm")
    watcher.forget()
    watcher.wait_in_charge(PRESSURE_PA)


def pauses(log, name):
    """Ends and beginnings of a message's stream around each pause of over a second."""
    times = [frame.time_s for frame in log if frame.name == name]
    return [(a, b) for a, b in pairwise(times) if b - a > 1.0]


def kill_controllers(folder):
    draw = random.Random(1)
    with logged(folder) as (candump, watcher, panel), ship(folder / "ship"):
        watcher.wait(lambda w: w.drive is not None)
        for number in range(KILLS):
            with controller(folder / str(number)) as running_one:
                arm(watcher, panel)
                watcher.watch(draw.uniform(0, 2))
                running_one.signal(signal.SIGKILL)
                watcher.forget()
                watcher.watch(1.5)
            assert watcher.drive.state is DriveState.FAULT
            (file,) = (folder / str(number) / "out").glob("run-*.frames")
            recording = read_run_log(file).signals
            assert recording["mode"][-1] == Mode.ACTIVE
            file.unlink()
        # the last one restarts: it waits for the operator, who holds the arm bit
        with controller(folder / "last"):
            watcher.wait(lambda w: w.statuses >= 30)
            assert watcher.mode is Mode.STANDBY
        return candump.stop("PUMP_CMD", "DRIVE_STATUS_1", "SENSOR_PUMP", "CTRL_STATUS")


def test_a_controller_killed_at_any_instant_leaves_the_pump_at_zero(tmp_path):
    log = first_that_can_be_judged(kill_controllers, tmp_path)
    killed = pauses(log, "PUMP_CMD")
    assert len(killed) == KILLS
    states = [(f.time_s, f.signals["state"]) for f in log if f.name == "DRIVE_STATUS_1"]
    pressures = [(f.time_s, f.signals["pressure_pa"]) for f in log if f.name == "SENSOR_PUMP"]
    modes = [(f.time_s, f.signals["mode"]) for f in log if f.name == "CTRL_STATUS"]
    waits_s = []
    for last_s, again_s in killed:
        off_s = next(t for t, s in states if t > last_s and s != DriveState.OPERATION_ENABLED)
        waits_s.append(off_s - last_s)
        # a pump that is off turns with the water, and presses a little
        assert abs(next(p for t, p in pressures if t > last_s + 0.5)) < 2.5e3
        assert next(mode for t, mode in modes if t >= again_s - 0.2) in (Mode.INIT, Mode.STANDBY)
    print(f"{KILLS} kills: drive off after {1e3 * max(waits_s):.0f} ms at most")
    assert max(waits_s) <= ZERO_WITHIN_S


def kill_ships(folder):
    draw = random.Random(2)
    with logged(folder) as (candump, watcher, panel), controller(folder / "controller") as one:
        for number in range(KILLS):
            # a seed of its own: the same samples once more are a replay, which is found
            with ship(folder / f"ship{number}", number) as running_one:
                watcher.wait(lambda w: w.drive is not None)
                watcher.watch(JUDGED_AGAIN_S)
                arm(watcher, panel)
                watcher.watch(draw.uniform(0, 2))
                running_one.signal(signal.SIGKILL)
                watcher.forget()
                watcher.wait(lambda w: w.mode is Mode.FAULT)
                watcher.watch(1.5)
                watcher.forget()
        report, _ = one.end(ExitCode.FAULT)
        assert report["mode"] == "FAULT"
        return candump.stop("PUMP_CMD", "SENSOR_MOTION")


def test_a_ship_killed_at_any_instant_hears_no_pressure_any_more(tmp_path):
    log = first_that_can_be_judged(kill_ships, tmp_path)
    killed = pauses(log, "SENSOR_MOTION")
    assert len(killed) == KILLS - 1
    commands = [(f.time_s, f.signals["pressure_pa"]) for f in log if f.name == "PUMP_CMD"]
    for last_s, again_s in killed:
        # half a second of patience, and the ramp of 200 ms, of `patient_controller`
        pressed = [t for t, p in commands if last_s < t < again_s and p != 0.0]
        assert not pressed or max(pressed) - last_s <= 0.5 + ZERO_WITHIN_S


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGHUP])
def test_a_signal_under_pressure_ends_with_the_pump_at_zero(number, tmp_path):
    def signalled(folder):
        with logged(folder) as (candump, watcher, panel), ship(folder / "ship"):
            watcher.wait(lambda w: w.drive is not None)
            with controller(folder / "controller") as one:
                arm(watcher, panel)
                one.signal(number)
                one.end(interrupt=False)
            return candump.stop("PUMP_CMD")

    log = first_that_can_be_judged(signalled, tmp_path)
    assert max(abs(frame.signals["pressure_pa"]) for frame in log) >= PRESSURE_PA
    assert log[-1].signals["pressure_pa"] == 0.0


def test_a_hundred_flaps_of_the_interface_are_survived_without_arming(tmp_path):
    def flap(folder):
        draw = random.Random(3)
        with (
            operated() as (watcher, panel),
            ship(folder / "ship") as ship_program,
            controller(folder / "controller") as one,
        ):
            watcher.wait(lambda w: w.drive is not None)
            arm(watcher, panel)
            for _ in range(FLAPS):
                with link_down():
                    time.sleep(draw.uniform(0, 0.1))
                watcher.watch(draw.uniform(0.02, 0.2))
            watcher.forget()
            watcher.wait(lambda w: w.statuses >= 20)
            assert (watcher.mode, watcher.status.fault) == (Mode.FAULT, Fault.BUS_LOST)
            assert ship_program.code is None
            arm(watcher, panel)  # and it works again when the operator says so
            one.end(ExitCode.OK, ExitCode.BUS_LOST)

    first_that_can_be_judged(flap, tmp_path)
