"""A semi-active tank on vcan0: the valve follows, and goes to its fail position with its master."""

import signal
from contextlib import closing

import pytest
from busy_machine import first_that_can_be_judged
from two_processes import (
    CONFIGS,
    Candump,
    Logged,
    patient_controller,
    run_controller,
    run_ship,
    watched,
)

from utank_hil.canbus import Mode, ValveControl, ValveFault, ValveState

pytestmark = [pytest.mark.socketcan, pytest.mark.evidence, pytest.mark.timeout(900)]

TIMEOUT_S = 0.1


def kill_the_controller(folder):
    """Arm the on-off law, let it work, kill it; the log."""
    config = patient_controller(folder, 1e3 * TIMEOUT_S, "valve_on_off", "thesis_first_valve")
    scenario = CONFIGS / "scenarios" / "semi_active.yaml"
    with (
        closing(Candump(folder)) as candump,
        watched() as watcher,
        run_ship(folder, scenario) as ship,
        run_controller(folder, config) as controller,
    ):
        watcher.wait_in_charge()
        watcher.watch(15.0)
        assert watcher.mode is Mode.ACTIVE
        controller.signal(signal.SIGKILL)
        watcher.watch(2.0)
        report, notes = ship.end()
    assert "emulated: sensors, drive, valve, panel" in notes
    assert report["refused_commands"] == 0
    return candump


def test_the_valve_follows_and_a_killed_controller_leaves_it_at_its_fail_position(tmp_path):
    candump = first_that_can_be_judged(kill_the_controller, tmp_path)
    log = candump.stop("VALVE_CMD", "VALVE_STATUS")
    told = [frame for frame in log if frame.name == "VALVE_CMD"]
    said = [frame for frame in log if frame.name == "VALVE_STATUS"]
    assert {frame.signals["control"] for frame in told} == {
        ValveControl.FAIL_POSITION, ValveControl.FOLLOW,
    }  # fmt: skip
    following = [frame for frame in said if frame.signals["state"] == ValveState.FOLLOWING]
    openings = [frame.signals["opening"] for frame in following]
    assert (min(openings), max(openings)) == (0.0, 1.0)
    tripped = next(frame for frame in said if frame.signals["state"] == ValveState.FAULT)
    assert tripped.signals["fault"] == ValveFault.COMMAND_TIMEOUT
    assert TIMEOUT_S < tripped.time_s - told[-1].time_s < TIMEOUT_S + 0.1
    last: Logged = said[-1]
    assert (last.signals["opening"], last.signals["state"]) == (1.0, ValveState.FAULT)
