from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import yaml

from firmware_sim.scenario import Scenario
from firmware_sim.waves import PassingWaves
from tools.thesis.capsize import equilibria
from utank_hil.configuration import ConfigError, Vessel, load_config
from utank_hil.dynamics import RollModel
from utank_hil.sea.components import write_components

CONFIGS = Path("configs").resolve()
STORM = CONFIGS / "scenarios" / "storm.yaml"


STORM_SEA = {
    "kind": "measured",
    "file": str(CONFIGS / "seas" / "ndbc_41010_2019-02_spectral_density.txt"),
    "time": "2019-02-10T05:40",
}


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


def test_waves_of_a_file_roll_the_ship_as_the_sea_that_they_are_of(tmp_path: Path) -> None:
    sea = load_config(scenario_file(tmp_path, sea=STORM_SEA), Scenario).sea.sea(7)
    file = write_components(sea, tmp_path / "sea.csv")
    drawn = load_config(scenario_file(tmp_path, sea=STORM_SEA), Scenario).wave_moment(7)
    given = load_config(
        scenario_file(tmp_path, sea={"kind": "components", "file": str(file)}), Scenario
    )
    for seed in (1, 2):  # Nothing is drawn.
        again = given.wave_moment(seed)
        assert np.array_equal(again.amplitude, drawn.amplitude)
        assert np.array_equal(again.frequency_rad_s, drawn.frequency_rad_s)
        assert np.array_equal(again.phase_rad, drawn.phase_rad)


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
        ({"sea": {"kind": "calm"}}, "sea.kind", "'calm'"),
        ({"sea": {"kind": "regular", "amplitude_m": -1.0, "period_s": 8.0}}, "sea.amplitude_m",
         "must be zero or more and finite (got -1.0)"),
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
        ({"plant": "linear", "vessel": str(CONFIGS / "ships" / "thesis_first_valve.yaml"),
          "controllers": {"valve": str(CONFIGS / "controllers" / "valve_on_off.yaml")}},
         "plant", "the loss of the vessel's valve is quadratic"),
        ({"plant": "exact"}, "plant", "must be one of roll, linear, sway_roll_yaw"),
        ({"actual_ship": {"inertia_kg_m2": -1.0}}, "actual_ship.inertia_kg_m2", "got -1.0"),
        ({"actual_ship": {"wind_moment_nm": 4e8}}, "actual_ship",
         "full or empty at one side: lower offset_moment_nm or wind_moment_nm"),
        ({"controllers": {}}, "controllers", "must have 1 or more"),
        ({"operator": None}, "operator", "is required but missing"),
        ({"controllers": {"../x": str(CONFIGS / "controllers" / "gpc.yaml")}}, "controllers",
         "it can't be a path"),
        ({"controllers": {"passive": str(CONFIGS / "controllers" / "gpc.yaml")}}, "controllers",
         "names one 'passive'"),
        ({"settle_s": 60.0}, "settle_s", "must be less than duration_s"),
        ({"duration_s": float("nan")}, "duration_s", "finite"),
        ({"seed": -1}, "seed", "(got -1)"),
        ({"voyage": [{"time_s": 30.0}, {"time_s": 20.0}]}, "voyage.1.time_s", "not after 30"),
        ({"voyage": [{"time_s": 90.0}]}, "voyage.0.time_s", "after duration_s, 60"),
        ({"voyage": [{"time_s": 9.0, "course_deg": 9.0}]}, "voyage.0.course_deg",
         "give heading_deg"),
        ({"voyage": [{"time_s": 9.0, "sea": {"kind": "ittc", "hs_m": 1.0, "tp_s": 6.0}}]},
         "voyage.0.sea", "the scenario's sea is given wave by wave"),
        ({"voyage": [{"time_s": 9.0, "ship": {"gm_m": 1.0}}]}, "voyage.0.ship.gm_m",
         "can't change; it takes inertia_kg_m2"),
        ({"voyage": [{"time_s": 9.0, "ship": {"inertia_kg_m2": -1.0}}]},
         "voyage.0.ship.inertia_kg_m2", "got -1.0"),
        ({"voyage": [{"time_s": 9.0, "ship": {"stiffness_nm_rad": 1e6}}]}, "voyage.0.ship",
         "takes all of the ship's stability"),
        ({"voyage": [{"time_s": 9.0, "ship": {"offset_moment_nm": 4e8}}]}, "voyage.0.ship",
         "full or empty at one side: lower offset_moment_nm or wind_moment_nm"),
        ({"sea": {"kind": "jonswap", "hs_m": 3.0, "tp_s": 9.0, "heading_deg": 0.0},
          "voyage": [{"time_s": 9.0, "speed_m_s": 3.0}]}, "sea.heading_deg", "no roll moment"),
        ({"sea": {**STORM_SEA, "until": "2019-02-10T05:40"}}, "sea.until", "must be after time"),
        ({"sea": {**STORM_SEA, "until": "2019-02-10T06:10"}}, "sea.until",
         "no spectrum of 2019-02-10T06:10"),
        ({"sea": {**STORM_SEA, "until": "2019-02-10T06:40"},
          "voyage": [{"time_s": 9.0, "sea": {"kind": "ittc", "hs_m": 1.0, "tp_s": 6.0}}]},
         "voyage.0.sea", "given by its own records"),
        ({"sea": {"kind": "regular", "amplitude_m": 1.0, "period_s": 9.0,
                  "roll_moment_table": "nowhere.csv"}}, "sea.roll_moment_table",
         "nowhere.csv can't be read"),
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


def test_between_waypoints_ship_course_and_speed_pass_linearly(tmp_path: Path) -> None:
    ship = {"stiffness_nm_rad": 6e8, "lift_damping_ns2_rad": 1e6}
    vessel = yaml.safe_load((CONFIGS / "ships" / "thesis_first.yaml").read_text())
    vessel["ship"]["lift_damping_ns2_rad"] = 1e6
    (tmp_path / "ship.yaml").write_text(yaml.safe_dump(vessel))
    controller = yaml.safe_load((CONFIGS / "controllers" / "gpc.yaml").read_text())
    (tmp_path / "gpc.yaml").write_text(yaml.safe_dump({**controller, "vessel": "ship.yaml"}))
    before = vessel["ship"]["stiffness_nm_rad"]
    path = scenario_file(
        tmp_path,
        vessel="ship.yaml",
        controllers={"gpc": "gpc.yaml"},
        sea={"kind": "regular", "amplitude_m": 1.0, "period_s": 10.0, "heading_deg": -170.0},
        voyage=[
            {"time_s": 10.0},
            {"time_s": 30.0, "heading_deg": 150.0, "ship": {"stiffness_nm_rad": 6e8}},
            {"time_s": 50.0, "speed_m_s": 8.0},
        ],
    )
    scenario = load_config(path, Scenario)
    stiffness = [scenario.ship_at(time_s).stiffness_nm_rad for time_s in (0, 10, 20, 30, 59)]
    between = (before + ship["stiffness_nm_rad"]) / 2
    assert stiffness == pytest.approx([before, before, between, 6e8, 6e8])
    damping = [scenario.ship_at(time_s).damping_nms_rad for time_s in (0, 30, 40, 55)]
    still = vessel["ship"]["damping_nms_rad"]
    assert damping == pytest.approx([still, still, still + 4e6, still + 8e6])
    # from -170 to 150 the shorter way, by way of 180: the heading falls by 40 degrees
    sailing = scenario.waves(1)
    assert isinstance(sailing, PassingWaves)
    turns = [scenario.turn_rad(float(time_s)) for time_s in (0, 10, 20, 30, 60)]
    assert turns == pytest.approx(np.radians([0, 0, 20, 40, 40]))


def test_records_of_hours_pass_into_one_another(tmp_path: Path) -> None:
    sea = {**STORM_SEA, "until": "2019-02-10T07:40"}
    scenario = load_config(scenario_file(tmp_path, sea=sea), Scenario)
    waves = scenario.waves(3)
    assert isinstance(waves, PassingWaves)
    assert [time_s for time_s, _ in scenario.sea.spectra] == [0, 3600, 7200]
    passing = scenario.sea.passing_sea(scenario.sea.spectra, 3)
    heights = [4 * np.sqrt((passing.at(t)[0] ** 2).sum() / 2) for t in (0, 3600, 5400, 7200)]
    mean = np.sqrt((4.27**2 + 3.86**2) / 2)
    assert heights == pytest.approx([4.71, 4.27, mean, 3.86], abs=0.006)


@pytest.mark.parametrize("wind_moment_nm", [-2e4, 3e4, -3.5e4, 4e4, 5e4])
def test_wind_is_taken_as_far_as_the_ship_finds_a_heel_to_hold(
    tmp_path: Path, wind_moment_nm: float
) -> None:
    """Her restoring moment softens: a linear ship would find one for each of these."""
    vessel = load_config(CONFIGS / "ships" / "patti_b.yaml", Vessel)
    windy = RollModel(replace(vessel.ship, wind_moment_nm=wind_moment_nm), vessel.tank)
    held = [
        each
        for each in equilibria(windy)
        if each.stable and abs(each.level_m) < vessel.tank.level_limit_m
    ]
    controller = CONFIGS / "controllers" / "patti_b_constrained_gpc.yaml"
    path = scenario_file(
        tmp_path,
        vessel=str(CONFIGS / "ships" / "patti_b.yaml"),
        controllers={"constrained": str(controller)},
        actual_ship={"wind_moment_nm": wind_moment_nm},
    )
    if held:
        assert load_config(path, Scenario).actual_ship
        return
    with pytest.raises(ConfigError, match="actual_ship: capsizes the ship without a wave"):
        load_config(path, Scenario)


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({}, "Waves of 2.83 m"),
        ({"voyage": [{"time_s": 30.0, "speed_m_s": 3.0}]}, "At the start, waves of 2.83 m"),
    ],
)
def test_sea_that_changes_is_told_as_it_is_at_the_start(
    tmp_path: Path, changes: dict[str, object], said: str
) -> None:
    (line,) = load_config(scenario_file(tmp_path, **changes), Scenario).meaning()
    assert line.startswith(said)
