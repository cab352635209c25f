from pathlib import Path

import numpy as np
import pytest
import yaml

from firmware_sim.scenario import Scenario
from utank_hil.configuration import ConfigError, load_config

CONFIGS = Path("configs").resolve()
STORM = CONFIGS / "scenarios" / "storm.yaml"


def scenario_file(folder: Path, **changes: object) -> Path:
    """A small valid scenario with keys put in or, with None, left out."""
    content: dict[str, object] = {
        "name": "swell",
        "vessel": str(CONFIGS / "ships" / "thesis_first.yaml"),
        "sea": {"kind": "regular", "amplitude_m": 1.0, "period_s": 10.0},
        "controllers": {"gpc": str(CONFIGS / "controllers" / "gpc.yaml")},
        "operator": [{"time_s": 5.0, "action": "arm"}],
        "duration_s": 60.0,
        "settle_s": 10.0,
    }
    content.update(changes)
    path = folder / "scenario.yaml"
    path.write_text(
        yaml.safe_dump({key: value for key, value in content.items() if value is not None}),
        encoding="utf-8",
    )
    return path


@pytest.mark.parametrize(
    "path", sorted((CONFIGS / "scenarios").glob("*.yaml")), ids=lambda p: p.stem
)
def test_shipped_scenarios_are_valid(path: Path) -> None:
    scenario = load_config(path, Scenario)
    assert scenario.controllers
    for controller in scenario.controllers.values():
        assert controller.vessel.version == scenario.vessel.version  # else it never arms


@pytest.mark.parametrize(
    ("changes", "key", "reason"),
    [
        ({"name": None}, "name", "is required but missing"),
        ({"waves": 3}, "waves", "is not a known key"),
        ({"sea": {"kind": "calm"}}, "sea", "'calm'"),
        ({"sea": {"kind": "regular", "amplitude_m": -1.0, "period_s": 8.0}}, "sea.amplitude_m",
         "greater than or equal to 0 (got -1.0)"),
        ({"sea": {"kind": "regular", "amplitude_m": 1.0}}, "sea.period_s", "required but missing"),
        ({"sea": {"kind": "jonswap", "hs_m": 3.0, "tp_s": 9.0, "gamma": 20.0}}, "sea.gamma",
         "(got 20.0)"),
        ({"sea": {"kind": "measured", "file": "nowhere.txt", "time": "2019-02-10T05:40"}},
         "sea.file", "nowhere.txt can't be read: No such file"),
        ({"sea": {"kind": "measured", "time": "2019-02-10T05:45", "file": str(
            CONFIGS / "seas" / "ndbc_41010_2019-02_spectral_density.txt")}}, "sea.time",
         "the nearest is of 2019-02-10T05:40"),
        ({"sensors": {"motion_delay_ms": 25.0}}, "sensors.motion_delay_ms",
         "must be a multiple of 10"),
        ({"sensors": {"roll_noise": 25.0}}, "sensors.roll_noise", "is not a known key"),
        ({"drive": {"pressure_pa": -1.0}}, "drive.pressure_pa", "must be positive"),
        ({"drive": {"pressure_pa": 40e3}}, "drive.pressure_pa",
         "takes 40000 at most, but controllers.gpc.limits.pressure_pa is 50000"),
        ({"drive": {"pressure_rate_pa_s": 1e3}}, "drive.pressure_rate_pa_s",
         "controllers.gpc.limits.rate_pa_s is 100000"),
        ({"drive": {"longest_timeout_ms": 20.0}}, "drive.longest_timeout_ms",
         "controllers.gpc.command_timeout_ms is 50"),
        ({"operator": [{"time_s": 5.0, "action": "amr"}]}, "operator.0.action", "'amr'"),
        ({"operator": [{"time_s": -5.0, "action": "arm"}]}, "operator.0.time_s",
         "must be zero or more"),
        ({"actual_ship": {"stiffness": 1e9}}, "actual_ship.stiffness",
         "can't differ from the vessel's; it takes inertia_kg_m2, stiffness_nm_rad"),
        ({"plant": "exact"}, "plant", "'nonlinear' or 'linear'"),
        ({"actual_ship": {"inertia_kg_m2": -1.0}}, "actual_ship.inertia_kg_m2", "got -1.0"),
        ({"actual_ship": {"wind_moment_nm": 4e8}}, "actual_ship",
         "full or empty at one side: lower offset_moment_nm or wind_moment_nm"),
        ({"controllers": {}}, "controllers", "at least 1"),
        ({"operator": None}, "operator", "is required but missing"),
        ({"controllers": {"passive": str(CONFIGS / "controllers" / "gpc.yaml")}}, "controllers",
         "names one 'passive'"),
        ({"settle_s": 60.0}, "settle_s", "must be less than duration_s"),
        ({"duration_s": float("nan")}, "duration_s", "finite"),
        ({"seed": -1}, "seed", "(got -1)"),
    ],
)  # fmt: skip
def test_what_is_wrong_is_told_with_its_key(
    tmp_path: Path, changes: dict[str, object], key: str, reason: str
) -> None:
    path = scenario_file(tmp_path, **changes)
    with pytest.raises(ConfigError) as caught:
        load_config(path, Scenario)
    found = {problem.key: problem for problem in caught.value.problems}
    assert found[key].file == path
    assert reason in found[key].reason


def test_every_problem_of_a_scenario_is_told_at_once(tmp_path: Path) -> None:
    path = scenario_file(
        tmp_path, seed=-1, duration_s="long", sea={"kind": "regular", "period_s": 0}, extra=1
    )
    with pytest.raises(ConfigError) as caught:
        load_config(path, Scenario)
    assert {problem.key for problem in caught.value.problems} == {
        "seed", "duration_s", "sea.amplitude_m", "sea.period_s", "extra",
    }  # fmt: skip


def test_seed_alone_decides_the_waves_and_the_ship_their_moment() -> None:
    storm = load_config(STORM, Scenario)
    first, again, other = (storm.wave_moment(seed) for seed in (1, 1, 2))
    np.testing.assert_array_equal(first.phase_rad, again.phase_rad)
    np.testing.assert_array_equal(first.amplitude, again.amplitude)
    assert not np.array_equal(first.phase_rad, other.phase_rad)
    # half the wave slope acts on the ship's stiffness
    slope = storm.sea.sea(1).slope
    expected = 0.5**2 * storm.vessel.ship.stiffness_nm_rad**2 * slope.variance
    assert first.variance == pytest.approx(expected, rel=1e-12)
