"""A CiA 402 drive that canopen plays, in a process of its own, with commission and run on vcan."""

import re
import subprocess
import sys
import time
from contextlib import closing, contextmanager

import numpy as np
import pytest
import yaml
from busy_machine import first_that_can_be_judged
from two_processes import (
    BIN,
    CHANNEL,
    CONFIGS,
    DBC,
    Candump,
    Program,
    patient_controller,
    run_controller,
    run_ship,
    watched,
)

from tools.vcan_launcher.linux import can_is_usable, create_vcan
from utank_hil.canbus import Fault, Mode
from utank_hil.console.exit_codes import ExitCode

pytestmark = [pytest.mark.socketcan, pytest.mark.evidence, pytest.mark.timeout(3600)]

DRIVE_BUS = "vcan1"
ENABLE = 0x0F
PRESSED_PA = 10e3
NM_PER_UNIT, PA_PER_UNIT = 199.04, 80.0
PASSIVE_S, ACTIVE_S, SETTLED_S = 70.0, 90.0, 35.0
SEA = {"kind": "regular", "amplitude_m": 0.5, "period_s": 12.0}


class Motor:
    """The drive's process, and what it printed."""

    def __init__(self, folder):
        self._log = (folder / "motor.txt").open("a+")
        self._process = subprocess.Popen(
            [sys.executable, "-m", "tests.canopen_motor", DRIVE_BUS, CHANNEL, DBC],
            stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=self._log, text=True,
        )  # fmt: skip
        assert self._process.stdout.readline() == "ready\n", self.errors

    @property
    def errors(self):
        self._log.seek(0)
        return self._log.read()

    def tell(self, words):
        """The time at which it took what goes wrong; `kill` ends it."""
        if words == "kill":
            self._process.kill()
            self._process.wait(30)
            return time.time()
        self._process.stdin.write(f"{words}\n")
        self._process.stdin.flush()
        return float(self._process.stdout.readline().split()[0])

    def close(self):
        if self._process.poll() is None:
            self._process.kill()
            self._process.wait(30)
        for each in (self._process.stdin, self._process.stdout, self._log):
            each.close()


class Panel:
    """`utank-hil panel` with actions piped in."""

    def __init__(self, ship):
        self._process = subprocess.Popen(
            [BIN / "utank-hil", "panel", ship, "--bus", CHANNEL],
            stdin=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True,
        )  # fmt: skip

    def press(self, *actions):
        for action in actions:
            self._process.stdin.write(f"{action}\n")
            self._process.stdin.flush()
            time.sleep(0.7)  # longer than a button stays pressed

    def press_until(self, watcher, mode, action):
        """Press again and again: the panel may be starting, or the controller not be ready."""

        def there(_):
            if watcher.mode is not mode:
                self.press(action)
            return watcher.mode is mode

        watcher.wait(there)

    def close(self):
        self._process.stdin.close()
        self._process.kill()
        self._process.wait(30)


@contextmanager
def drive_log(folder):
    """What is sent on the drive's interface: times, identifiers, contents."""
    path, frames = folder / "drive.log", []
    with path.open("wb") as output:
        dump = subprocess.Popen(["candump", "-L", "-r", "8388608", DRIVE_BUS], stdout=output)
        try:
            yield frames
        finally:
            dump.terminate()
            dump.wait(30)
    for time_s, can_id, data in re.findall(r"\((\S+)\) \S+ (\w+)#(\w*)", path.read_text()):
        frames.append((float(time_s), int(can_id, 16), bytes.fromhex(data)))


def files(folder):
    """Ship, controller and two scenarios, at the quay and at sea."""
    ship = yaml.safe_load((CONFIGS / "ships" / "thesis_first.yaml").read_text())
    ship["devices"] = {"pump": {
        "profile": "cia402", "bus": DRIVE_BUS, "node": 5, "mode": "torque", "heartbeat_ms": 100,
        "pressure_pa_per_unit": PA_PER_UNIT, "speed_rad_s_per_unit": 0.001,
        "identity": [0x11, 0x22, None, 0x44],
    }}  # fmt: skip
    ship["emulated"] = False
    (folder / "ship.yaml").write_text(yaml.safe_dump(ship))
    path = patient_controller(folder, 100.0)
    controller = yaml.safe_load(path.read_text())
    controller["vessel"] = "ship.yaml"
    controller["safety"]["echo_age_ms"] = 300
    path.write_text(yaml.safe_dump(controller))
    for name, sea in (("quay", SEA | {"amplitude_m": 0.0}), ("sea", SEA)):
        content = {
            "name": name, "vessel": "ship.yaml", "sea": sea, "controllers": {"gpc": path.name},
            "operator": [{"time_s": 1000.0, "action": "arm"}], "duration_s": 3600, "settle_s": 0,
        }  # fmt: skip
        (folder / f"{name}.yaml").write_text(yaml.safe_dump(content))
    return path


def commissioned(folder, controller):
    """The record of a passed commissioning, at the quay."""
    words = ("utank-hil", "commission", controller, "--bus", CHANNEL, "--json")
    with (
        watched() as watcher,
        closing(Motor(folder)),
        run_ship(folder, folder / "quay.yaml", "--without", "drive,panel"),
        closing(Panel(folder / "ship.yaml")) as panel,
        closing(Program(folder, *words, "--record", folder / "record.json")) as program,
    ):
        asked = folder / "utank-hil.err"
        watcher.wait(lambda _: program.code is not None or "Arm at the panel" in asked.read_text())
        panel.press("arm")
        watcher.wait(lambda _: program.code is not None, timeout_s=400.0)
        made, _ = program.end(ExitCode.OK, ExitCode.REFUSED, interrupt=False)
        failed = [each for each in made["checks"] if each["verdict"] != "pass"]
        assert made["passed"], (made["ended"], failed)
        print({each["name"]: each["measured"] for each in made["checks"]})
    return folder / "record.json"


def sail(folder):
    """Passive, active, a stop, and the faults one after the other."""
    controller = files(folder)
    record = commissioned(folder, controller)
    told, spans = [], {}
    with (
        closing(Candump(folder)) as candump,
        drive_log(folder) as frames,
        watched() as watcher,
        run_ship(folder, folder / "sea.yaml", "--without", "drive,panel", duration_s=3600) as ship,
        closing(Panel(folder / "ship.yaml")) as panel,
    ):
        motor = Motor(folder)
        try:
            with run_controller(folder, controller, "--record", record) as run:
                watcher.wait(lambda w: w.mode is Mode.STANDBY)
                panel.press_until(watcher, Mode.PASSIVE, "passive")
                watcher.watch(PASSIVE_S)
                assert watcher.mode is Mode.PASSIVE, watcher.status
                spans["passive"] = time.time()
                panel.press_until(watcher, Mode.ACTIVE, "arm")
                begin_s = time.monotonic()
                while time.monotonic() < begin_s + ACTIVE_S:
                    watcher.watch(1.0)
                    assert watcher.mode is Mode.ACTIVE, watcher.status
                spans["active"] = time.time()
                panel.press_until(watcher, Mode.STANDBY, "stop")
                watcher.watch(1.0)
                for words in FOUND:
                    if watcher.mode is Mode.FAULT:
                        panel.press_until(watcher, Mode.STANDBY, "reset")
                    panel.press_until(watcher, Mode.ACTIVE, "arm")
                    watcher.watch(14.0)  # a swing and more
                    assert watcher.mode is Mode.ACTIVE, watcher.status
                    at_s = motor.tell(words)
                    if words.startswith("emcy"):
                        watcher.watch(2.0)
                        assert watcher.mode is Mode.ACTIVE, watcher.status
                    else:
                        watcher.wait(lambda w: w.mode is Mode.FAULT)
                        watcher.watch(1.0)
                    told.append((words, at_s, watcher.status.fault))
                    if words != "kill":
                        motor.tell("well")
                    watcher.watch(2.0)
                _, said = run.end(ExitCode.OK, ExitCode.FAULT)
                ship.end()
        finally:
            motor.close()
    log = candump.stop("SENSOR_MOTION", "CTRL_STATUS")
    return spans, told, frames, log, said


def rolls(log, end_s, seconds):
    rows = [
        each.signals["roll_rad"]
        for each in log
        if each.name == "SENSOR_MOTION" and end_s - seconds <= each.time_s < end_s
    ]
    assert len(rows) > 50 * seconds
    return float(np.std(rows))


FOUND = {
    "deaf": (Fault.DRIVE_SILENT, 0.4),
    "emcy 4210": (Fault.NONE, None), "trip 3210": (Fault.DRIVE_FAULT, 0.1),
    "kill": (Fault.DRIVE_SILENT, 0.6),
}  # fmt: skip
"""Fault, and time in s until no pressure is asked for: ages are 300 ms for the echo, else 500."""


def test_a_drive_in_a_process_of_its_own_reduces_the_roll_and_its_faults_end_at_zero(tmp_path):
    if not can_is_usable(DRIVE_BUS):
        create_vcan(DRIVE_BUS)
    spans, told, frames, log, said = first_that_can_be_judged(sail, tmp_path)
    passive, active = (rolls(log, spans[each], SETTLED_S) for each in ("passive", "active"))
    print(f"roll RMS {active:.4f} rad, passive {passive:.4f} rad")
    assert active < 0.8 * passive
    commands = [(at_s, data[0]) for at_s, can_id, data in frames if can_id == 0x205]
    torques = [
        (at_s, int.from_bytes(data[4:6], "little", signed=True) * PA_PER_UNIT)
        for at_s, can_id, data in frames
        if can_id == 0x285
    ]
    assert max(abs(each) for _, each in torques) > PRESSED_PA
    for words, at_s, fault in told:
        expected, within_s = FOUND[words]
        assert fault is expected, words
        if within_s is None:
            continue
        first_s = next(each for each, _ in commands if each >= at_s)
        stop_s = max(each for each, word in commands if each < at_s + 2 and word == ENABLE)
        after = [each for each in torques if each[0] > stop_s]
        zero_s = next((each for each, pa in after if abs(pa) < 2.5e3), None)
        print(f"{words}: last enabled {stop_s - first_s:.3f} s after it, at zero {zero_s}")
        assert stop_s - first_s <= within_s, words
        if words.startswith("trip"):  # the others have no PDO any more that says so
            assert zero_s is not None
            assert zero_s - stop_s < 0.5
    assert "DEVICE_ERROR" in said
    assert "pump: node 5: emergency 4210h (temperature), register 0x81" in said
