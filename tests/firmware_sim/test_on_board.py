"""What a bench says of its roll for people: shares and criteria, at the place it names."""

import json
import math
from dataclasses import asdict
from pathlib import Path

import numpy as np
import pytest
import yaml

from firmware_sim.figures import LEVELS_RAD, on_board
from firmware_sim.scenario import Scenario
from firmware_sim.scenario_sections import Place
from utank_hil.analysis.motion.comfort import comfort
from utank_hil.configuration import ConfigError, load_config
from utank_hil.dynamics import Tank

STEP_S = 0.05
TIME = np.arange(0, 1200, STEP_S)
CONFIGS = Path(__file__).resolve().parents[2] / "configs"


def test_shares_and_criteria_are_those_of_the_record() -> None:
    # every third swing is of 12 degrees, the others of 6
    omega = 0.6
    swing = np.floor(omega * TIME / math.pi)
    roll = np.radians(np.where(swing % 3 == 0, 12.0, 6.0)) * np.sin(omega * TIME)
    found = on_board(roll, STEP_S, Place(9.0, 4.0))
    assert found.exceedance is not None
    np.testing.assert_allclose(found.exceedance, [1, 1, 1 / 3, 1 / 3, 0, 0], atol=0.01)
    expected = comfort(roll, np.gradient(roll, STEP_S), STEP_S, 9.0, 4.0)
    assert found.comfort == expected
    low = on_board(roll, STEP_S, Place(-2.0)).comfort
    assert low.lateral_rms_m_s2 < found.comfort.lateral_rms_m_s2


def test_rayleigh_s_shares_are_those_of_a_gaussian_roll_of_a_narrow_band() -> None:
    random = np.random.default_rng(7)
    time = np.arange(0, 40_000, 0.1)
    omega = 0.6 + 0.02 * random.standard_normal(40)
    phase = random.uniform(0, 2 * math.pi, 40)
    roll = sum(np.cos(w * time + p) for w, p in zip(omega, phase, strict=True))
    roll = np.asarray(roll) * math.radians(5.0) / math.sqrt(20)
    found = on_board(roll, 0.1, Place(0.0))
    assert found.exceedance is not None
    np.testing.assert_allclose(found.exceedance, found.rayleigh, atol=0.06)
    assert found.rayleigh[1] == pytest.approx(math.exp(-0.5), abs=0.05)  # 5 degrees at one sigma


@pytest.mark.parametrize("roll", [np.zeros(50), np.full(3, 0.1)])
def test_a_ship_that_does_not_swing_has_no_shares_but_all_the_rest(roll: np.ndarray) -> None:
    found = on_board(roll, STEP_S, Place(5.0))
    assert found.exceedance is None
    assert len(found.rayleigh) == len(LEVELS_RAD)
    assert found.comfort.sickness_percent == 0


def test_the_place_is_the_scenario_s_or_the_deck_over_the_starboard_reservoir(
    tmp_path: Path,
) -> None:
    tank = Tank(17.1, 4.88, 17.11, 6.22, lz_m=1.83, headroom_m=3.0)
    deck = Place.over_reservoir(tank)
    assert (deck.height_m, deck.starboard_m) == pytest.approx((4.88 + 3.0 - 1.83, 8.55))
    content = yaml.safe_load((CONFIGS / "scenarios" / "naval_vessel.yaml").read_text())
    for key, folder in (("vessel", "ships"),):
        content[key] = str(CONFIGS / folder / Path(content[key]).name)
    content["controllers"] = {"one": str(CONFIGS / "controllers" / "naval_constrained_gpc.yaml")}
    path = tmp_path / "scenario.yaml"
    path.write_text(yaml.safe_dump({**content, "place": {"height_m": 6.5}}))
    scenario = load_config(path, Scenario)
    assert scenario.place_on_board == Place(6.5, 0.0)
    path.write_text(yaml.safe_dump({**content, "place": {"starboard_m": "far"}}))
    with pytest.raises(ConfigError) as caught:
        load_config(path, Scenario)
    assert {problem.key for problem in caught.value.problems} == {
        "place.height_m", "place.starboard_m",
    }  # fmt: skip


def test_figures_can_be_written_as_json() -> None:
    roll = 0.1 * np.sin(0.6 * TIME)
    assert json.loads(json.dumps(asdict(on_board(roll, STEP_S, Place(5.0)))))["comfort"]
