"""A law of one's own on vcan0: it drives the pump, and whatever it does wrong ends at zero."""

from pathlib import Path

import pytest
import yaml
from busy_machine import first_that_can_be_judged
from two_processes import patient_controller, run_controller, run_ship, watched

from utank_hil.canbus import DriveState, Fault, Mode
from utank_hil.console.exit_codes import ExitCode

pytestmark = [pytest.mark.socketcan, pytest.mark.evidence, pytest.mark.timeout(900)]

STORM = Path("configs/scenarios/storm.yaml")
SOURCE = """
import time

import numpy as np

from utank_hil.dynamics.sampling import LinearModel


class Law:
    def __init__(self, flaw, from_pa):
        self.sample_time_s, self.flaw, self.from_pa = 0.1, flaw, from_pa
        none = np.zeros((0, 0)), np.zeros((0, 1)), np.zeros((1, 0))
        self.linear = LinearModel(*none, np.array([[5e4]]), 0.1)
        self.reset()

    def step(self, y, reference=None):
        if self.left_pa > self.from_pa and self.flaw == "raises":
            raise ZeroDivisionError("of our own")
        if self.left_pa > self.from_pa and self.flaw == "sleeps":
            time.sleep(3.0)
        return np.array([5e4 * y[0]])

    def applied(self, u):
        self.left_pa = max(self.left_pa, abs(u[0]))

    def reset(self):
        self.left_pa = 0.0
"""
FROM_PA = 500.0


def controller_of(folder, flaw):
    (folder / "own_flawed_law.py").write_text(SOURCE, encoding="utf-8")
    path = patient_controller(folder, 100.0)
    content = yaml.safe_load(path.read_text(encoding="utf-8"))
    content["law"] = {
        "kind": "python",
        "factory": "own_flawed_law:Law",
        "measured": ["roll_rad"],
        "parameters": {"flaw": flaw, "from_pa": FROM_PA},
    }
    path.write_text(yaml.safe_dump(content), encoding="utf-8")
    return path


def until_it_ends(folder, flaw, monkeypatch):
    """In charge until the law fails; the bus at the end, and the controller's report."""
    config = controller_of(folder, flaw)
    monkeypatch.setenv("PYTHONPATH", str(folder))
    with (
        watched() as watcher,
        run_ship(folder, STORM),
        run_controller(folder, config, "--allow-code") as controller,
    ):
        watcher.wait(lambda w: w.mode is Mode.ACTIVE)
        watcher.wait(lambda w: w.mode is Mode.FAULT)
        watcher.watch(2.0)
        report, _ = controller.end(ExitCode.FAULT)
    return watcher, report


@pytest.mark.parametrize(
    ("flaw", "faults", "error"),
    [
        ("raises", {Fault.INTERNAL}, "ZeroDivisionError: of our own"),
        # the drive stops by its own command timeout while the law sleeps
        ("sleeps", {Fault.OVERRUN, Fault.DRIVE_FAULT, Fault.DRIVE_SILENT}, ""),
    ],
)
def test_a_law_that_fails_ends_at_zero_pressure(flaw, faults, error, tmp_path_factory, monkeypatch):
    folder = tmp_path_factory.mktemp(flaw)
    watcher, report = first_that_can_be_judged(
        lambda at: until_it_ends(at, flaw, monkeypatch), folder
    )
    assert abs(watcher.drive.pressure_pa) < 2e3  # the rotor turns with the water
    assert watcher.drive.state is not DriveState.OPERATION_ENABLED
    assert report["mode"] == "FAULT"
    assert report["fault"] in {fault.name for fault in faults}
    assert report["law_error"] == error
