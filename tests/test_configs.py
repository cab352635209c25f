"""The configuration files of the project are fit to be used."""

from pathlib import Path

import numpy as np
import pytest

from firmware_sim.assembly import build_ship_side
from firmware_sim.scenario import Scenario
from utank_hil.canbus import Mode
from utank_hil.config import ControllerConfig, Vessel
from utank_hil.config_files import load_config
from utank_hil.config_laws import LQGLaw
from utank_hil.control import DPC_ROLL_LEVEL, GPC_ROLL, LQG_ROLL_RATE_LEVEL
from utank_hil.runtime import Lockstep
from utank_hil.runtime.assembly import build_controller_node
from utank_hil.runtime.panel import Action, TimedAction

CONFIGS = Path(__file__).resolve().parents[1] / "configs"
CONTROLLERS = sorted((CONFIGS / "controllers").glob("*.yaml"))
SECOND_NS = 1_000_000_000


@pytest.mark.parametrize("path", sorted((CONFIGS / "ships").glob("*.yaml")), ids=lambda p: p.stem)
def test_ship_loads(path: Path) -> None:
    assert load_config(path, Vessel).ship.natural_frequency_rad_s > 0


@pytest.mark.parametrize(
    "path", sorted((CONFIGS / "scenarios").glob("*.yaml")), ids=lambda p: p.stem
)
def test_scenario_loads(path: Path) -> None:
    assert load_config(path, Scenario).controllers


def test_files_hold_the_default_designs() -> None:
    def law(name: str) -> object:
        return load_config(CONFIGS / "controllers" / name, ControllerConfig).law

    assert law("gpc.yaml") == GPC_ROLL
    assert law("dpc.yaml") == DPC_ROLL_LEVEL
    lqg = law("lqg.yaml")
    assert isinstance(lqg, LQGLaw)
    assert lqg.design == LQG_ROLL_RATE_LEVEL


@pytest.mark.parametrize("path", CONTROLLERS, ids=lambda p: p.stem)
def test_controller_arms_and_acts_on_the_bus_within_the_drives_limits(path: Path) -> None:
    config = load_config(path, ControllerConfig)
    scenario = load_config(CONFIGS / "scenarios" / "storm.yaml", Scenario).model_copy(
        update={"vessel": config.vessel}
    )
    ship = build_ship_side(scenario, 1, (TimedAction(2.0, Action.ARM),))
    pressures: list[float] = []
    node = build_controller_node(config, sink=lambda row: pressures.append(row[5]))
    lockstep = Lockstep([*ship.nodes, node])
    lockstep.run_until(30 * SECOND_NS)
    assert node.mode is Mode.ACTIVE
    assert np.ptp(pressures) > 10.0
    assert ship.drive.refused == 0
