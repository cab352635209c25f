"""``utank-hil commission`` on vcan0: refused before, led through, and armed with its record."""

import json
from contextlib import closing

import pytest
import yaml
from busy_machine import first_that_can_be_judged
from two_processes import (
    CHANNEL,
    CONFIGS,
    Program,
    patient_controller,
    run_controller,
    run_ship,
    watched,
)

from utank_hil.canbus import Fault, Mode
from utank_hil.console.exit_codes import ExitCode

pytestmark = [pytest.mark.socketcan, pytest.mark.evidence, pytest.mark.timeout(900)]


def still_water(folder, controller, arm_s):
    """The first ship at the quay, with an operator who arms at a time."""
    path = folder / "quay.yaml"
    content = {
        "name": "quay",
        "vessel": str(CONFIGS / "ships" / "thesis_first.yaml"),
        "sea": {"kind": "regular", "amplitude_m": 0.0, "period_s": 10.0},
        "controllers": {"any": str(controller)},
        "operator": [{"time_s": arm_s, "action": "arm"}],
        "duration_s": 600,
        "settle_s": 0,
    }
    path.write_text(yaml.safe_dump(content), encoding="utf-8")
    return path


def run_until(folder, controller, record, mode, fault):
    """Have an operator arm under `run`, until mode and fault are there; what it said."""
    with (
        watched() as watcher,
        run_ship(folder, still_water(folder, controller, 1.0)),
        run_controller(folder, controller, "--record", record) as run,
    ):
        watcher.wait(
            lambda w: w.status is not None and (w.status.mode, w.status.fault) == (mode, fault)
        )
        return run.end()[1]


def commission(folder, controller, record):
    words = ("utank-hil", "commission", controller, "--bus", CHANNEL, "--json")
    with (
        watched() as watcher,
        run_ship(folder, still_water(folder, controller, 24.0)),
        closing(Program(folder, *words, "--record", record)) as program,
    ):
        watcher.wait(lambda w: program.code is not None, timeout_s=400.0)
        made, _ = program.end(ExitCode.OK, ExitCode.REFUSED, interrupt=False)
        failed = [each for each in made["checks"] if each["verdict"] != "pass"]
        assert made["passed"], (made["ended"], failed)
        return made


def story(folder):
    controller, record = patient_controller(folder, 100.0), folder / "record.json"
    said = run_until(folder, controller, record, Mode.STANDBY, Fault.NOT_COMMISSIONED)
    assert "there is no record of a commissioning" in said
    assert "NOT_COMMISSIONED: No commissioning was passed" in said
    made = commission(folder, controller, record)
    assert "refused" not in run_until(folder, controller, record, Mode.ACTIVE, Fault.NONE)
    return made


def test_a_controller_arms_once_it_was_commissioned(tmp_path_factory):
    folder = tmp_path_factory.mktemp("quay")
    made = first_that_can_be_judged(story, folder)
    assert made["passed"] is True
    assert len(made["checks"]) == 17
    print(json.dumps({each["name"]: each["measured"] for each in made["checks"]}))
