"""A configuration runs no code that its user did not allow, wherever in it the code is named."""

import json
from pathlib import Path

import pytest
import yaml
from typer.testing import CliRunner

from firmware_sim.campaign.study import load_study
from utank_hil.assembly import build_law
from utank_hil.cli import app
from utank_hil.configuration import ConfigError, ControllerConfig, load_config
from utank_hil.console.exit_codes import ExitCode

CONFIGS = Path("configs").resolve()
SHIP = str(CONFIGS / "ships" / "thesis_first.yaml")
VALVE = str(CONFIGS / "ships" / "thesis_first_valve.yaml")


def a_law(folder):
    """A law of a module that leaves a mark when it is imported."""
    (folder / "mark_of_code.py").write_text(
        "from pathlib import Path\n"
        f"Path({str(folder / 'ran')!r}).touch()\n"
        "import numpy as np\n"
        "class Law:\n"
        "    sample_time_s = 0.1\n"
        "    def step(self, y, reference=None): return -1e3 * y[:1]\n"
        "    def applied(self, u): pass\n"
        "    def reset(self): pass\n"
    )
    return {"kind": "python", "factory": "./mark_of_code.py:Law", "measured": ["roll_rad"]}


def written(folder, **keys):
    path = folder / "controller.yaml"
    path.write_text(yaml.safe_dump({"name": "A", "vessel": SHIP, **keys}))
    return path


def the_storm(folder, controller):
    content = yaml.safe_load((CONFIGS / "scenarios" / "storm.yaml").read_text())
    content |= {"vessel": SHIP, "controllers": {"own": str(controller)}}
    content["sea"] = {"kind": "jonswap", "hs_m": 2.0, "tp_s": 9.0}
    path = folder / "scenario.yaml"
    path.write_text(yaml.safe_dump(content))
    return path


def said(*words):
    done = CliRunner(env={"COLUMNS": "300"}).invoke(app, [str(word) for word in words])
    return done.exit_code, done.stderr


def test_code_that_nobody_allows_is_refused_and_nothing_of_it_is_imported(tmp_path):
    controller = written(tmp_path, law=a_law(tmp_path))
    scenario = the_storm(tmp_path, controller)
    for words in (
        ("check", controller),
        ("check", scenario),
        ("run", controller, "--bus", "any0"),
        ("bench", scenario, "--duration", 1),
    ):
        code, stderr = said(*words)
        assert code == ExitCode.USAGE
        assert "law.kind: is python: it runs" in stderr
        assert "--allow-code" in stderr
    assert not (tmp_path / "ran").exists()


@pytest.mark.parametrize("kind", ["valve_clipped", "pump_with_valve"])
def test_code_within_another_law_is_refused_even_where_code_is_allowed(tmp_path, kind):
    law = {"kind": kind, "pump": a_law(tmp_path)}
    controller = written(tmp_path, vessel=VALVE, law=law)
    code, stderr = said("check", controller, "--allow-code")
    assert code == ExitCode.USAGE
    assert "law.pump.kind: must be one of" in stderr
    assert not (tmp_path / "ran").exists()


def test_code_that_is_allowed_is_run(tmp_path):
    controller = written(tmp_path, law=a_law(tmp_path), accept_low_margins=True)
    assert said("check", controller, "--allow-code")[0] == ExitCode.OK
    assert build_law(load_config(controller, ControllerConfig, allow_code=True))
    assert (tmp_path / "ran").exists()


def test_a_study_brings_in_no_code(tmp_path):
    controller = written(tmp_path, law={"kind": "passive"})
    study = tmp_path / "study.yaml"
    content = {
        "name": "S",
        "scenario": str(the_storm(tmp_path, controller)),
        "simulation": "bus",
        "set": {"controllers.own.law": a_law(tmp_path)},
    }
    study.write_text(json.dumps(content))
    with pytest.raises(ConfigError, match="--allow-code"):
        load_study(study)
    assert load_study(study, allow_code=True).cases
