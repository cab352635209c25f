"""A vessel without a pump is benched as the passive tank that it has."""

from pathlib import Path

import numpy as np
import pytest
import yaml
from typer.testing import CliRunner

from firmware_sim.bench import jobs_of
from firmware_sim.plant import Plant
from firmware_sim.run import run_lockstep
from firmware_sim.scenario import Scenario
from firmware_sim.scenario_content import PASSIVE
from utank_hil.analysis.loop.sea_response import motion_in_sea
from utank_hil.base.tick import TICK_NS
from utank_hil.cli import app
from utank_hil.configuration import ConfigError, load_config
from utank_hil.control import DesignPlant

DURATION_S = 60.0


def scenario_file(folder: Path, **changes: object) -> Path:
    vessel = yaml.safe_load(Path("configs/ships/naval_vessel.yaml").read_text())
    del vessel["pump"]
    (folder / "vessel.yaml").write_text(yaml.safe_dump(vessel))
    content = {
        "name": "passive tank",
        "vessel": "vessel.yaml",
        "sea": {"kind": "regular", "amplitude_m": 0.1, "period_s": 6.0},
        "duration_s": DURATION_S,
        "settle_s": 0.0,
    }
    path = folder / "scenario.yaml"
    path.write_text(yaml.safe_dump(content | changes))
    return path


def test_bench_runs_its_tank_passive(tmp_path: Path) -> None:
    scenario = load_config(scenario_file(tmp_path), Scenario)
    (job,) = jobs_of(scenario, seed=1, duration_s=DURATION_S)
    assert job.name == PASSIVE
    run = run_lockstep(job)
    assert not run.column("true_pressure_pa").any()
    # the same motion by the transfer function: its last waves, where the start has died out
    vessel = scenario.vessel
    steady = run.between(DURATION_S - 12.0, DURATION_S)
    roll = run.column("true_roll_rad")[steady]
    plant = DesignPlant(vessel.ship, vessel.tank)
    expected = motion_in_sea(None, plant, ("roll_rad",), scenario.wave_moment(1)).roll_rms_rad
    assert np.sqrt(np.mean(roll**2)) == pytest.approx(expected, rel=0.05)


def test_check_shows_no_margins_of_no_law(tmp_path: Path) -> None:
    done = CliRunner().invoke(app, ["check", str(scenario_file(tmp_path))])
    assert done.exit_code == 0, done.output
    assert "there is no pump" in done.stdout
    assert "Margins" not in done.stdout


def test_design_names_the_pump_to_order_and_its_keys(tmp_path: Path) -> None:
    scenario_file(tmp_path)
    ship = tmp_path / "vessel.yaml"

    def said(*words: str) -> list[str]:
        done = CliRunner(env={"COLUMNS": "80"}).invoke(app, ["design", "tank", str(ship), *words])
        assert done.exit_code == 0, done.output
        return done.stdout.splitlines()

    scenario = "--scenario", str(tmp_path / "scenario.yaml"), "--out", str(tmp_path / "out")
    lines = said(*scenario)
    assert not any("active" in line for line in lines)  # no row or column of what is not there
    (number,) = (at for at, line in enumerate(lines) if line.startswith("no pump;"))
    order, keys = lines[number].split(": ")[-1], lines[number + 1].strip()
    ship.write_text(ship.read_text() + keys + "\n")
    (tmp_path / "scenario.yaml").unlink()
    heads = [line for line in said() if line.startswith("pump: net head")]
    assert heads == [f"pump: net head, flow, shaft, duty: {order}"]


def test_plant_takes_no_command(tmp_path: Path) -> None:
    scenario = load_config(scenario_file(tmp_path), Scenario)
    vessel = scenario.vessel
    plant = Plant(vessel.ship, vessel.tank, vessel.pump, scenario.wave_moment(1))
    for tick in range(100):
        plant.drive_pump(20e3, enabled=True)
        plant.advance(tick * TICK_NS)
        assert plant.pressure_pa == 0.0
    assert plant.pump_power_w == 0.0
    assert plant.flow_m3_s != 0.0


def test_law_that_drives_a_pump_is_refused_there(tmp_path: Path) -> None:
    controller = {"name": "PD", "vessel": "vessel.yaml", "law": {"kind": "pd"}}
    path = scenario_file(tmp_path, controllers={"pd": controller})
    with pytest.raises(ConfigError, match=r"controllers\.pd\.law\.kind: is pd, which drives"):
        load_config(path, Scenario)
