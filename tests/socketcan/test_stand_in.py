"""The commands of docs/how-to/hardware.md on vcan0: hardware in the place of the sensors."""

import re
import shlex
import signal
import subprocess
import sys
from contextlib import closing
from pathlib import Path

import pytest
from busy_machine import first_that_can_be_judged
from two_processes import CHANNEL, Candump, Program, patient_controller, watched

from utank_hil.canbus import Mode

pytestmark = [pytest.mark.evidence, pytest.mark.socketcan, pytest.mark.timeout(900)]

PAGE = Path("docs/how-to/hardware.md")
PRESSURE_PA = 2e3


def commands(folder):
    """The three commands of the page by program, for a machine that is busy."""
    block = re.search(r"^```sh\n(.*?)^```$", PAGE.read_text(), re.M | re.S)
    assert block
    found = {words[0]: words for words in map(shlex.split, block[1].splitlines())}
    run = found["utank-hil"]
    assert run[2] == "configs/controllers/gpc.yaml"
    run[2] = str(patient_controller(folder, 100.0))
    for words in found.values():
        assert words[words.index("--bus") + 1] == CHANNEL
    return found


def arm_with_stand_in(folder):
    """Until the pump works; the ship's report and the log."""
    said = commands(folder)
    with closing(Candump(folder)) as candump:
        sensors = subprocess.Popen([sys.executable, *said["python"][1:]])
        try:
            with (
                watched() as watcher,
                closing(
                    Program(folder, *said["firmware-sim"], "--duration", 1200, "--json")
                ) as ship,
                closing(Program(folder, *said["utank-hil"], "--json")) as controller,
            ):
                watcher.wait_in_charge(PRESSURE_PA)
                watcher.watch(1.0)
                assert watcher.mode is Mode.ACTIVE
                assert sensors.poll() is None
                controller.end()
                report, notes = ship.end()
            assert "emulated: drive, panel" in notes
        finally:
            sensors.send_signal(signal.SIGINT)
            assert sensors.wait(60) == 0
    return report, candump


def test_controller_works_with_sensors_that_know_nothing_of_this_repository(tmp_path):
    report, candump = first_that_can_be_judged(arm_with_stand_in, tmp_path)
    log = candump.stop("SENSOR_MOTION", "HEARTBEAT_SENSORS", "PUMP_CMD", "ADDRESS_CLAIM_SENSORS")
    rolls = [frame.signals["roll_rad"] for frame in log if frame.name == "SENSOR_MOTION"]
    # the stand-in's ship, of one degree, and no emulated sensor's in the storm
    assert 0.015 < max(map(abs, rolls)) < 0.018
    # the stand-in's, which comes before all else of it, and no emulated sensor's
    own = [frame.name for frame in log if frame.name != "PUMP_CMD"]
    assert own[0] == "ADDRESS_CLAIM_SENSORS"
    assert own.count("ADDRESS_CLAIM_SENSORS") == 1
    commands = [frame.signals["pressure_pa"] for frame in log if frame.name == "PUMP_CMD"]
    assert max(map(abs, commands)) > PRESSURE_PA
    pump = report["pump"]
    assert isinstance(pump, dict)
    assert pump["pressure_peak_pa"] > PRESSURE_PA
    assert report["refused_commands"] == 0
    assert report["reported_pressure_share"] is None
