"""Sensor and CANopen drive of other makers, each on an interface of its own, in real time."""

import subprocess
from contextlib import ExitStack, closing

import numpy as np
import pytest
import yaml
from busy_machine import first_that_can_be_judged, judged_by, lost
from two_processes import CHANNEL, CONFIGS, Program, patient_controller

from tools.vcan_launcher.linux import can_is_usable, create_vcan
from utank_hil.canbus import Mode
from utank_hil.console.exit_codes import ExitCode
from utank_hil.telemetry.recording_reader import read_recording

pytestmark = [pytest.mark.evidence, pytest.mark.socketcan, pytest.mark.timeout(900)]

DURATION_S = 20.0
ENOUGH_S = 10.0
OTHERS = ("vcan1", "vcan2")


def scenario_file(folder):
    """The storm, with the shipped ship of devices on two more interfaces."""
    ship = yaml.safe_load((CONFIGS / "ships" / "thesis_first_devices.yaml").read_text())
    devices = ship["devices"]
    devices["motion"]["bus"], devices["pump"]["bus"] = OTHERS
    devices["receive_only"] = OTHERS[:1]
    devices["pump"]["heartbeat_ms"] = 100  # a busy machine holds the controller up
    (folder / "ship.yaml").write_text(yaml.safe_dump(ship))
    controller = patient_controller(folder, 100.0)
    content = yaml.safe_load(controller.read_text()) | {"vessel": "ship.yaml"}
    controller.write_text(yaml.safe_dump(content))
    content = yaml.safe_load((CONFIGS / "scenarios" / "storm.yaml").read_text())
    content["vessel"] = "ship.yaml"
    content["sea"]["file"] = str(CONFIGS / "seas" / "ndbc_41010_2019-02_spectral_density.txt")
    content["controllers"] = {"gpc": controller.name}
    content["operator"] = [{"time_s": 0.5, "action": "arm"}]
    content["settle_s"] = 10
    path = folder / "scenario.yaml"
    path.write_text(yaml.safe_dump(content))
    return path


def sail(folder):
    """Identifiers by interface; the controller was in charge from arming to the end."""
    with ExitStack() as stack:
        for name in (CHANNEL, *OTHERS):
            output = stack.enter_context((folder / name).open("wb"))
            dump = subprocess.Popen(["candump", "-L", "-r", "8388608", name], stdout=output)
            stack.callback(dump.wait, 30)
            stack.callback(dump.terminate)
        program = stack.enter_context(closing(Program(
            folder, "utank-hil", "bench", scenario_file(folder), "--realtime", "--bus", CHANNEL,
            "--duration", DURATION_S, "--out", folder, "--json",
        )))  # fmt: skip
        report, _ = program.end(ExitCode.OK, ExitCode.NOT_RANKED, interrupt=False, timeout_s=300.0)
    run = read_recording(folder / "bench.rrd")["gpc"]
    loop = report["runs"][-1]["loop"]
    share = loop["skipped"] / (loop["ticks"] + loop["skipped"])
    with judged_by(lambda: lost(share, loop["lateness"]["max_ns"] * 1e-9)):
        in_charge = run["mode"] == Mode.ACTIVE
        assert in_charge.any()
        rows = run["time_s"][int(np.argmax(in_charge)) :]
        assert in_charge[-len(rows) :].all()
        assert rows[-1] - rows[0] > ENOUGH_S
        assert np.abs(run["pressure_actual_pa"]).max() > 1e3
    return {
        name: {
            line.split()[2].partition("#")[0] for line in (folder / name).read_text().splitlines()
        }
        for name in (CHANNEL, *OTHERS)
    }


def test_devices_on_two_more_interfaces_keep_the_controller_in_charge(tmp_path_factory):
    for name in OTHERS:
        if not can_is_usable(name):
            create_vcan(name)
    heard = first_that_can_be_judged(sail, tmp_path_factory.mktemp("devices"))
    # nothing is forwarded, and the sensor's interface hears nothing but the sensor
    assert heard["vcan1"] == {"102", "120", "122", "130", "132"}
    assert {"000", "080", "185", "205", "285", "585", "605", "705", "77F"} == heard["vcan2"]
    assert all(len(can_id) == 8 for can_id in heard[CHANNEL])
