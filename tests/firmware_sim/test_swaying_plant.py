"""The emulated ship with its sway, against the same equations by another integrator."""

import json
import math
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import xarray
from pydantic import ValidationError
from roll_energy import energy
from scipy.integrate import solve_ivp

from firmware_sim.plant import Plant
from firmware_sim.scenario import Scenario
from firmware_sim.ship_side import bare_plant, build_ship_side, plant_of
from firmware_sim.waves import PassingWaves, SteadyWaves
from utank_hil.assembly import build_controller_node
from utank_hil.base.tick import TICK_NS
from utank_hil.canbus import Mode
from utank_hil.configuration import ConfigError, Vessel, load_config
from utank_hil.configuration.hull_files.parts import Given
from utank_hil.configuration.hull_files.reader import read_hull
from utank_hil.dynamics.hull.hull_data import free_roll, radiation_at
from utank_hil.dynamics.hull.lateral import LateralHull
from utank_hil.dynamics.nonlinear import RollModel
from utank_hil.runners import Lockstep, SimulatedBus
from utank_hil.sea import Harmonics, Sea, jonswap
from utank_hil.sea.sea import PassingSea, slope_per_m

VESSEL = load_config(Path("configs/ships/thesis_first.yaml"), Vessel)
STORM = Path("configs/scenarios/storm.yaml")
FREQUENCY = np.array([0.5, 0.8])
MOMENT = Harmonics(np.array([1.5e7, 0.5e7]), FREQUENCY, np.array([0.3, 2.0]))
LATERAL = Harmonics(np.array([0.05, 0.03]), FREQUENCY, np.array([0.1, 2.2]))


def advanced(plant: Plant, seconds: int) -> list[float]:
    for tick in range(100 * seconds + 1):
        plant.advance(tick * TICK_NS)
    return [
        plant.roll_rad,
        plant.roll_rate_rad_s,
        plant.level_m,
        plant.flow_m3_s / VESSEL.tank.reservoir_area_m2,
    ]


def test_swaying_plant_equals_an_adaptive_integration() -> None:
    ship = replace(VESSEL.ship, quadratic_damping_nms2_rad2=2e8)
    model = RollModel(ship, VESSEL.tank)

    def slopes(t, x):
        lateral = 9.80665 * float(LATERAL.at(t))
        return model.derivative(x, 0.0, float(MOMENT.at(t)), sway_m_s2=lateral)

    expected = solve_ivp(slopes, (0, 60), [0.0] * 4, "DOP853", rtol=1e-10, atol=1e-12).y[:, -1]
    plant = Plant(ship, VESSEL.tank, None, SteadyWaves(MOMENT, LATERAL))
    assert advanced(plant, 60) == pytest.approx(expected, abs=1e-6)
    assert plant.lateral_m_s2 == pytest.approx(9.80665 * float(LATERAL.at(60.0)), rel=1e-6)


def test_work_less_losses_is_the_change_of_energy_in_a_swaying_ship() -> None:
    tank = replace(VESSEL.tank, quadratic_loss=2.0, headroom_m=1.5, restitution=0.2)
    forces = [Harmonics(3 * each.amplitude, FREQUENCY, each.phase_rad)
              for each in (MOMENT, LATERAL)]  # fmt: skip
    plant = Plant(VESSEL.ship, tank, VESSEL.pump, SteadyWaves(*forces))
    upright_j = float(energy(VESSEL.ship, tank, [[0.0] * 4])[0])
    state = advanced(plant, 120)
    assert plant.strikes > 3
    gained_j = float(energy(VESSEL.ship, tank, [state])[0]) - upright_j
    work_j = plant.wave_work_j + plant.pump_work_j - plant.losses_j
    assert work_j == pytest.approx(gained_j, abs=1e-5 * plant.losses_j)


def test_a_sea_that_passes_sways_the_ship_as_a_steady_one() -> None:
    sea = Sea.irregular(jonswap(3.0, 9.0), 2, components=32, heading_rad=1.2, speed_m_s=5.0)

    def moment(omega, heading):
        return 2e8 * slope_per_m(omega, heading)

    def lateral(omega, heading):
        return 0.7 * slope_per_m(omega, heading)

    forces = [sea.harmonics(sea.amplitude_m * each(sea.omega_rad_s, sea.heading_rad))
              for each in (moment, lateral)]  # fmt: skip
    passing = PassingWaves(PassingSea.of(sea), lambda _: 0.0, lambda _: 5.0, moment, lateral)
    plants = [Plant(VESSEL.ship, VESSEL.tank, None, waves)
              for waves in (SteadyWaves(*forces), passing)]  # fmt: skip
    assert advanced(plants[1], 30) == pytest.approx(advanced(plants[0], 30), rel=1e-7)


def test_scenario_sways_by_its_share_of_the_slope_and_not_without_it(tmp_path: Path) -> None:
    def plant(**ship: float) -> Plant:
        text = f"actual_ship: {json.dumps(ship)}\n" + STORM.read_text()
        file = tmp_path / "storm.yaml"
        file.write_text(text.replace("../", f"{STORM.resolve().parents[1]}/"))
        scenario = load_config(file, Scenario)
        return Plant(scenario.ship_at, VESSEL.tank, None, scenario.waves(1))

    still, zero, swaying = plant(), plant(sway_of_slope=0.0), plant(sway_of_slope=0.7)
    assert advanced(still, 20) == advanced(zero, 20)
    assert advanced(swaying, 20) != advanced(still, 20)
    slope = load_config(STORM, Scenario).sea.sea(1).slope
    assert swaying.lateral_m_s2 == pytest.approx(0.7 * 9.80665 * float(slope.at(20.0)), rel=1e-6)
    assert math.isclose(zero.lateral_m_s2, 0.0)


@pytest.mark.evidence("1.0")
@pytest.mark.slow
@pytest.mark.parametrize("share", [0.5, 1.0])
def test_controller_that_knows_no_sway_is_in_charge_of_a_ship_that_sways(share: float) -> None:
    storm = load_config(STORM, Scenario)
    scenario = storm.model_copy(update={"actual_ship": {"sway_of_slope": share}})
    ship = build_ship_side(scenario, 1, scenario.operator)
    node = build_controller_node(scenario.controllers["gpc"], commissioned=True)
    run = Lockstep([*ship.nodes, node], SimulatedBus(bit_rate=250_000))
    for second in range(10, 90):
        run.run_until(second * 1_000_000_000)
        assert node.mode is Mode.ACTIVE
        assert node.safety.monitors.found == 0


HULL = {"file": "tests/dynamics/data/wigley.nc", "gyration_m": (4.56, 15.0, 15.0)}
SEA = {"kind": "regular", "amplitude_m": 0.5, "period_s": 8.0}


def hull_scenario(**changes: object) -> Scenario:
    ship = {"stiffness_nm_rad": 2.0e7, "inertia_kg_m2": 3.2e7, "damping_nms_rad": 2e6}
    tank = {"width_m": 8.0, "height_m": 2.5, "reservoir_area_m2": 2.0, "duct_area_m2": 0.7}
    content = {
        "name": "hull", "vessel": {"name": "wigley", "ship": ship, "tank": tank}, "sea": SEA,
        "hull": HULL, "plant": "sway_roll_yaw", "duration_s": 60.0, "settle_s": 10.0, **changes,
    }  # fmt: skip
    return Scenario.model_validate(content)


@pytest.mark.evidence
def test_scenario_with_a_hull_sways_rolls_and_yaws() -> None:
    scenario = hull_scenario(sea={**SEA, "heading_deg": 60.0})
    ship = build_ship_side(scenario, 1, ())
    for tick in range(3001):
        ship.plant.advance(tick * TICK_NS)
    slope = 0.5 * (2 * math.pi / 8.0) ** 2 / 9.80665
    assert 0.1 * slope < abs(ship.plant.roll_rad) < 5 * slope
    assert 0.05 < abs(ship.plant.lateral_m_s2) / (9.80665 * slope) < 1.2
    moment = scenario.wave_moment(1).at(30.0)
    assert ship.plant.wave_moment_nm == pytest.approx(float(moment), rel=1e-6)


def test_a_memory_that_does_not_follow_the_radiation_is_warned_of(tmp_path):
    assert not [key for key, _ in hull_scenario(plant="six_degrees").warnings() if key == "hull"]
    with xarray.open_dataset(HULL["file"]) as whole:
        rough = whole.load().copy(deep=True)
    damping = rough.radiation_damping
    at = {"omega": damping.omega[1::2], "radiating_dof": "Heave", "influenced_dof": "Heave"}
    damping.loc[at] *= 1.5
    rough.to_netcdf(tmp_path / "rough.nc")
    hull = {**HULL, "file": str(tmp_path / "rough.nc")}
    assert not [key for key, _ in hull_scenario(hull=hull).warnings() if key == "hull"]
    said = dict(hull_scenario(hull=hull, plant="six_degrees").warnings())
    assert re.search(r"surge, heave and pitch .* misses by .* more than 1%", said["hull"])


@pytest.mark.parametrize("plant", ["sway_roll_yaw", "six_degrees"])
def test_a_hull_rolls_parametrically_where_its_righting_moment_swings_at_twice_its_roll(plant):
    sea = {"kind": "regular", "amplitude_m": 0.5, "period_s": 3.9, "heading_deg": 175.0}
    greatest = []
    for changes in ({}, {"righting_in_waves": {"length_m": 25.0, "share_per_m": -0.8}}):
        scenario = hull_scenario(sea=sea, plant=plant, **changes)
        moved, late = bare_plant(scenario, 1), 0.0
        for tick in range(20_001):
            moved.advance(tick * TICK_NS)
            if tick > 15_000:
                late = max(late, abs(moved.roll_rad))
        greatest.append(late)
    assert greatest[1] > 20 * greatest[0]


@pytest.mark.parametrize("plant", ["sway_roll_yaw", "six_degrees"])
def test_a_hull_on_a_voyage_without_changes_rolls_as_one_that_keeps_its_course(plant):
    sea = {"kind": "jonswap", "hs_m": 1.0, "tp_s": 6.0, "heading_deg": 70.0, "speed_m_s": 4.0}
    changes = {"gusts": {"mean_speed_m_s": 15.0}, "actual_ship": {"wind_moment_nm": 2e5}}
    changes["righting_in_waves"] = {"length_m": 60.0, "share_per_m": -0.2}
    still = {"voyage": [{"time_s": 5.0, "heading_deg": 70.0, "speed_m_s": 4.0}]}
    found = []
    for voyage in ({}, still):
        moved = bare_plant(hull_scenario(sea=sea, plant=plant, **changes, **voyage), 1)
        rolls = []
        for tick in range(4001):
            moved.advance(tick * TICK_NS)
            rolls.append((moved.roll_rad, moved.lateral_m_s2, moved.heave_m_s2))
        found.append(np.array(rolls))
    assert found[0][:, 0].std() > 0.005
    np.testing.assert_allclose(found[1], found[0], atol=1e-6)


def test_a_voyage_needs_hull_data_at_every_heading(tmp_path):
    with xarray.open_dataset(HULL["file"]) as whole:
        whole.sel(wave_direction=whole.wave_direction[[0]]).to_netcdf(tmp_path / "one.nc")
    hull = {**HULL, "file": str(tmp_path / "one.nc")}
    still = {**SEA, "heading_deg": 0.0}
    hull_scenario(sea=still, hull=hull)
    with pytest.raises(ValidationError, match="voyage needs hull data at all headings"):
        hull_scenario(sea=still, hull=hull, voyage=[{"time_s": 5.0, "speed_m_s": 3.0}])


@pytest.mark.parametrize(
    ("name", "lost"),
    [
        ("added_mass", (0.0, 0.9)),
        ("added_mass", (0.6, 1.1)),
        ("excitation_force", (0.77, 2.0)),
        ("excitation_force", (0.6, 1.1)),
    ],
)
def test_a_hull_without_frequencies_around_its_roll_is_refused_at_its_key(tmp_path, name, lost):
    """The roll is at 0.8 rad/s; what is no number is left out by the reader."""
    with xarray.open_dataset(HULL["file"]) as whole:
        rough = whole.load().copy(deep=True)
    if name not in rough:
        rough["excitation_force"] = rough["Froude_Krylov_force"] + rough["diffraction_force"]
    rough[name] = rough[name].where(~((rough.omega > lost[0]) & (rough.omega < lost[1])))
    rough.to_netcdf(tmp_path / "rough.nc")
    hull = {**HULL, "file": str(tmp_path / "rough.nc")}
    words = "frequency_rad_s has none near the free roll, 0.* compute the hull there, too"
    with pytest.raises(ValidationError, match=rf" hull does not fit: .*{words}"):
        hull_scenario(hull=hull)
    ship = tmp_path / "ship.yaml"
    content = {"name": "wigley", "ship": {"hull": hull}, "tank": {}, "emulated": True}
    ship.write_text(json.dumps(content))
    with pytest.raises(ConfigError, match=rf"ship\.hull.*{words}"):
        load_config(ship, Vessel)


@pytest.mark.parametrize("plant", ["sway_roll_yaw", "six_degrees"])
def test_a_hull_in_a_turn_heels_outward_and_its_water_lies_square_to_gravity_and_turn(plant):
    rate_rad_s, speed_m_s, lever_m, mass_kg = math.radians(1.0), 6.0, 2.0, 1e6
    scenario = hull_scenario(
        sea={"kind": "regular", "amplitude_m": 0.0, "period_s": 8.0, "speed_m_s": speed_m_s},
        plant=plant, turning_lever_m=lever_m, duration_s=300.0,
        actual_ship={"displacement_n": 9.80665 * mass_kg},
        voyage=[{"time_s": 10.0 + 90 * leg, "heading_deg": 90.0 * (1 - leg)} for leg in range(4)],
    )  # fmt: skip
    inward = speed_m_s * rate_rad_s / 9.80665  # to starboard
    bare, moved = bare_plant(scenario, 1), plant_of(scenario, 1)
    for tick in range(25_001):
        bare.advance(tick * TICK_NS)
        moved.advance(tick * TICK_NS)
    ship = scenario.sailing_ship
    heel_rad = -9.80665 * mass_kg * inward * lever_m / ship.stiffness_nm_rad
    assert bare.roll_rad == pytest.approx(heel_rad, rel=0.02)
    assert moved.lateral_m_s2 == pytest.approx(9.80665 * inward, rel=0.01)
    level_m = math.tan(moved.roll_rad - math.atan(inward)) * scenario.vessel.tank.width_m / 2
    assert moved.level_m == pytest.approx(level_m, rel=0.01)


@pytest.mark.evidence
def test_scenario_in_six_degrees_heaves_and_pitches_too() -> None:
    """In a beam wave of 15 s and 0.5 m the ship and its tank go up and down as the water does."""
    still, moving = (
        build_ship_side(hull_scenario(sea={**SEA, "period_s": 15.0}, plant=plant), 1, ()).plant
        for plant in ("sway_roll_yaw", "six_degrees")
    )
    found = []
    for tick in range(6001):
        still.advance(tick * TICK_NS)
        moving.advance(tick * TICK_NS)
        found.append(moving.heave_m_s2)
    assert still.heave_m_s2 == 0.0
    assert still.roll_rad != moving.roll_rad
    assert still.roll_rad == pytest.approx(moving.roll_rad, rel=0.05)
    assert max(found[4500:]) == pytest.approx(0.5 * (2 * math.pi / 15.0) ** 2, rel=0.1)


@pytest.mark.parametrize(
    ("changes", "key", "reason"),
    [
        ({"hull": None}, "hull", "is required with plant: sway_roll_yaw"),
        ({"plant": "roll"}, "hull", "needs plant: sway_roll_yaw or six_degrees"),
        ({"plant": "six_degrees", "hull": None}, "hull", "is required with plant: six_degrees"),
        ({"sea": {**SEA, "effective_slope": {"coefficient": 0.5}}}, "sea.effective_slope", "hull"),
        (
            {"voyage": [{"time_s": 5.0, "ship": {"stiffness_nm_rad": 2.1e7}}]},
            "voyage.0.ship.stiffness_nm_rad",
            "of one loading",
        ),
        ({"hull": {"file": HULL["file"]}}, "hull", "inertia_kg_m2 is missing"),
        ({"actual_ship": {"stiffness_nm_rad": 2.6e7}}, "hull", "make them agree"),
    ],
)
def test_hull_that_does_not_fit_the_scenario_is_refused(changes, key: str, reason: str) -> None:
    with pytest.raises(ValidationError) as refused:
        hull_scenario(**changes)
    assert key in str(refused.value)
    assert reason in str(refused.value)


def hull_vessel(**ship: object) -> dict[str, object]:
    tank = {"width_m": 8.0, "height_m": 2.5, "reservoir_area_m2": 2.0, "duct_area_m2": 0.7}
    return {"name": "wigley", "ship": ship, "tank": tank, "emulated": True}


def test_ship_of_a_hull_file_rolls_as_the_hull_does() -> None:
    hull = LateralHull(read_hull(Path(HULL["file"]), Given(gyration_m=HULL["gyration_m"])))
    vessel = Vessel.model_validate(hull_vessel(hull=HULL))
    found, ship, data = free_roll(hull.data), vessel.ship, hull.about_g
    omega = 2 * math.pi / found.period_s
    # sway and yaw eliminated from the equations of the data, at the frequency of free roll
    lateral = np.ix_([1, 3, 5], [1, 3, 5])
    added, damping = radiation_at(data, omega)
    matrix = omega**2 * (data.mass_matrix + added)[lateral]
    c44 = float(data.hydrostatic[3, 3])
    own = matrix[1, 1] - matrix[1, [0, 2]] @ np.linalg.solve(
        matrix[np.ix_([0, 2], [0, 2])], matrix[[0, 2], 1]
    )
    assert own == pytest.approx(c44, rel=1e-6)
    assert ship.stiffness_nm_rad == pytest.approx(c44)
    assert ship.natural_frequency_rad_s == pytest.approx(omega)
    mode = found.mode
    assert ship.damping_nms_rad == pytest.approx(float(mode @ damping[lateral] @ mode))
    assert ship.displacement_n == pytest.approx(hull.data.mass_kg * 9.80665)
    assert "roll period" in vessel.assumptions[0]
    assert any("waves alone" in each for each in vessel.assumptions)


def test_figure_that_is_given_goes_before_the_hull_s() -> None:
    own = Vessel.model_validate(hull_vessel(hull=HULL)).ship
    vessel = Vessel.model_validate(hull_vessel(hull=HULL, roll_period_s=9.0, damping_ratio=0.04))
    assert not any("viscous" in each for each in vessel.assumptions)
    ship = vessel.ship
    assert 2 * math.pi / ship.natural_frequency_rad_s == pytest.approx(9.0)
    assert ship.stiffness_nm_rad == own.stiffness_nm_rad
    critical = 2 * math.sqrt(ship.inertia_kg_m2 * ship.stiffness_nm_rad)
    assert ship.damping_nms_rad == pytest.approx(0.04 * critical)
    assert "given: roll_period_s, damping_ratio" in vessel.assumptions[0]


@pytest.mark.parametrize(
    ("changes", "key", "reason"),
    [
        ({"ship": {"hull": HULL["file"]}}, "ship.hull", "gyration_m beside hull.file give"),
        ({"ship": {"hull": "none.nc"}}, "ship.hull", "can't be"),
        ({"emulated": False}, "ship.hull", "not emulated: write instead inertia_kg_m2: "),
    ],
)
def test_hull_that_a_ship_can_t_take_is_refused(
    changes: dict[str, object], key: str, reason: str, tmp_path: Path
) -> None:
    file = tmp_path / "ship.yaml"
    file.write_text(json.dumps(hull_vessel(hull=HULL) | changes))
    with pytest.raises(ConfigError) as refused:
        load_config(file, Vessel)
    assert [each.key for each in refused.value.problems] == [key]
    assert reason in str(refused.value)


def test_plant_that_sways_has_the_vessel_s_hull() -> None:
    vessel = hull_vessel(hull=HULL, damping_ratio=0.03)
    assert hull_scenario(vessel=vessel, hull=None).lateral_hull is not None
    assert hull_scenario(vessel=vessel, hull=None, plant="roll").lateral_hull is None
