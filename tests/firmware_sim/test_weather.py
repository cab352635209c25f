"""Gusts, turns and righting moments in waves, against closed forms and the standard."""

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import yaml
from roll_energy import energy
from scipy.integrate import quad, solve_ivp
from test_scenario import scenario_file

from firmware_sim.plant import Plant
from firmware_sim.scenario import Scenario
from firmware_sim.scenario_sections import RightingInWaves
from firmware_sim.ship_side import bare_plant
from firmware_sim.voyage import TURN_S, turning
from firmware_sim.waves import SteadyWaves
from firmware_sim.wind import BAND_HZ, Gusts
from utank_hil.base.tick import TICK_NS
from utank_hil.configuration import ConfigError, Vessel, load_config
from utank_hil.dynamics.tank import GRAVITY_M_S2, negligible
from utank_hil.sea import Harmonics

VESSEL = load_config(Path("configs/ships/thesis_first.yaml"), Vessel)
NO_TANK = negligible(VESSEL.tank)


def wave(amplitude: float, frequency_rad_s: float, phase_rad: float = 0.0) -> Harmonics:
    return Harmonics(*(np.array([each]) for each in (amplitude, frequency_rad_s, phase_rad)))


def rolls(plant: Plant, seconds: float) -> np.ndarray:
    found = []
    for tick in range(round(seconds * 100) + 1):
        plant.advance(tick * TICK_NS)
        found.append(plant.roll_rad)
    return np.array(found)


@pytest.mark.parametrize("mean_m_s", [10.0, 20.0, 30.0])
def test_gusts_are_as_strong_as_the_standards_other_formula_says(mean_m_s: float) -> None:
    gusts = Gusts(mean_speed_m_s=mean_m_s)

    def density(log_hz: float) -> float:
        hz = math.exp(log_hz)
        return hz * float(gusts.speed_density(np.array([hz]))[0])

    whole, _ = quad(density, math.log(1 / 2400), math.log(0.5), epsrel=1e-9)
    # ISO 19901-1 gives the turbulence intensity by itself, of a fit to the same measurements
    intensity = 0.06 * (1 + 0.043 * mean_m_s)
    assert math.sqrt(whole) / mean_m_s == pytest.approx(intensity, rel=0.1)
    drawn, _ = quad(density, *map(math.log, BAND_HZ), epsrel=1e-9)
    moments = [gusts.moment(1e6, seed) for seed in range(20)]
    spread = np.mean([moment.variance for moment in moments])
    assert spread == pytest.approx((2e6 / mean_m_s) ** 2 * drawn, rel=0.01)


def test_a_great_windage_feels_less_of_a_short_gust_as_vickery_says() -> None:
    gusts = Gusts(mean_speed_m_s=20.0, windage_m2=2500.0)
    # 2 f sqrt(A) / U = 1 at 0.2 Hz
    assert gusts.admittance(np.array([0.2])) == pytest.approx([0.5])
    assert gusts.admittance(np.array([0.025])) == pytest.approx([1 / (1 + 0.0625)])


def test_the_bench_rolls_in_gusts_as_its_transfer_function_says(tmp_path: Path) -> None:
    changes = {
        "sea": {"kind": "regular", "amplitude_m": 0.0, "period_s": 10.0},
        "actual_ship": {"wind_moment_nm": 1e7},
        "gusts": {"mean_speed_m_s": 20.0},
    }
    scenario = load_config(scenario_file(tmp_path, **changes), Scenario)
    ship, gusts = scenario.sailing_ship, scenario.gusts
    assert gusts is not None
    moment = gusts.moment(1e7, 3 + (1 << 32))
    omega = moment.frequency_rad_s
    response = 1 / (
        ship.stiffness_nm_rad - ship.inertia_kg_m2 * omega**2 + 1j * omega * ship.damping_nms_rad
    )
    steady = Harmonics(
        moment.amplitude * np.abs(response), omega, moment.phase_rad + np.angle(response)
    )
    time_s = np.arange(60_001) * 0.01
    expected = 1e7 / ship.stiffness_nm_rad + steady.at(time_s)
    found = rolls(bare_plant(scenario, 3), 600.0)
    late = time_s > 500  # the start has died out
    assert np.std(expected[late]) > 0.002
    np.testing.assert_allclose(found[late], expected[late], atol=0.01 * np.std(expected[late]))


@pytest.mark.parametrize("side", [-1.0, 1.0])
def test_in_a_turn_the_ship_heels_outward_by_the_formula_of_the_is_code(side: float) -> None:
    length_m, speed_m_s, lever_m, mass_kg = 150.0, 10.0, 4.0, 1.2e7
    rate_rad_s = side * speed_m_s / (5 * length_m)  # in a circle of five lengths
    forces = turning(lambda t: rate_rad_s * max(t, 0.0), lambda _: speed_m_s, mass_kg, lever_m)
    assert forces(0.0) == (0.0, 0.0)
    moment_nm, inward = forces(TURN_S)
    # IS Code 2008, A 3.1.2: 0.200 v^2 / L times the displacement in t times the lever, in kN m
    code_nm = 1e3 * 0.2 * speed_m_s**2 / length_m * mass_kg / 1e3 * lever_m
    assert moment_nm == pytest.approx(-side * code_nm)
    still = SteadyWaves(wave(0.0, 1.0), wave(0.0, 1.0))
    plant = Plant(VESSEL.ship, VESSEL.tank, VESSEL.pump, still, turning=forces)
    for tick in range(60_000):
        plant.drive_pump(0.0, enabled=True)
        plant.advance(tick * TICK_NS)
    assert plant.lateral_m_s2 == pytest.approx(speed_m_s * rate_rad_s)
    assert plant.roll_rad * side < 0
    # the water lies square to gravity and the turn's acceleration together
    slope_rad = plant.roll_rad - math.atan(inward)
    level_m = math.tan(slope_rad) * VESSEL.tank.width_m / 2
    assert plant.level_m == pytest.approx(level_m, rel=1e-4)


def test_a_voyages_turn_heels_the_ship_of_the_bench(tmp_path: Path) -> None:
    changes = {
        "sea": {"kind": "regular", "amplitude_m": 0.0, "period_s": 10.0, "speed_m_s": 9.0},
        "voyage": [{"time_s": 10.0, "heading_deg": 90.0}, {"time_s": 50.0, "heading_deg": 50.0}],
        "turning_lever_m": 3.0,
        "actual_ship": {"displacement_n": 1.2e8},
        "duration_s": 60.0,
    }
    scenario = load_config(scenario_file(tmp_path, **changes), Scenario)
    found = rolls(bare_plant(scenario, 1), 60.0)
    # to starboard, as the waves' heading falls by a degree a second
    moment_nm = 1.2e8 / GRAVITY_M_S2 * 9.0 * math.radians(1.0) * 3.0
    assert np.abs(found[:1000]).max() < 1e-9
    heel_rad = -moment_nm / scenario.sailing_ship.stiffness_nm_rad
    assert found[2500:5000].mean() == pytest.approx(heel_rad, rel=0.05)


@pytest.mark.parametrize(("depth", "shift"), [(0.3, 1.0), (0.3, 1.12), (0.1, 1.0)])
def test_righting_moments_that_swing_at_twice_the_roll_grow_it_as_mathieu_says(
    depth: float, shift: float
) -> None:
    ship = replace(VESSEL.ship, damping_nms_rad=VESSEL.ship.damping_nms_rad / 4)
    omega = ship.natural_frequency_rad_s
    push = ship.stiffness_nm_rad * 1e-6
    waves = SteadyWaves(
        *(
            Harmonics(np.array(sizes), np.array([0.3, 2 * shift * omega]), np.array([0.2, 0.7]))
            for sizes in ([push, 0.0], [0.0, 0.0], [0.0, depth])
        )
    )
    seconds = 240.0
    found = rolls(Plant(ship, NO_TANK, None, waves), seconds)

    def rates(t: float, x: np.ndarray) -> list[float]:
        change = 1 + depth * math.cos(2 * shift * omega * t + 0.7)
        moment = push * math.cos(0.3 * t + 0.2) - change * ship.stiffness_nm_rad * x[0]
        return [x[1], (moment - ship.damping_nms_rad * x[1]) / ship.inertia_kg_m2]

    times = np.linspace(0, seconds, len(found))
    exact = solve_ivp(rates, (0, seconds), [0.0, 0.0], "DOP853", times, rtol=1e-11, atol=1e-14)
    greatest = np.abs(exact.y[0]).max()
    np.testing.assert_allclose(found, exact.y[0], atol=1e-4 * greatest)
    # inside the first tongue it grows by depth / 4 a radian less the damping; outside it does not
    early, late = (np.abs(found[at : at + 3000]).max() for at in (12_000, 21_000))
    rate = depth * omega / 4 - ship.damping_nms_rad / (2 * ship.inertia_kg_m2)
    if shift == 1.0 and rate > 0.01:
        assert math.log(late / early) / 90 == pytest.approx(rate, rel=0.05)
    else:
        assert late < 2 * early


def test_a_wave_counts_as_the_nearest_wave_of_the_ships_length() -> None:
    section = RightingInWaves(length_m=120.0, share_per_m=-0.2)
    along = np.linspace(-60.0, 60.0, 20_001)
    basis = np.column_stack([np.cos(2 * np.pi * along / 120.0), np.ones_like(along)])
    for length_m, heading_rad in ((120.0, math.pi), (70.0, 3.0), (200.0, 0.4), (100.0, 2.2)):
        omega = math.sqrt(2 * math.pi / length_m * GRAVITY_M_S2)
        surface = np.cos(2 * np.pi / length_m * math.cos(heading_rad) * along)
        fitted = np.linalg.lstsq(basis, surface, rcond=None)[0][0]
        found = section.change_per_m(np.array([omega]), np.array([heading_rad]))
        assert found == pytest.approx(-0.2 * fitted, abs=1e-4)
    beam = section.change_per_m(np.array([0.7]), np.array([math.pi / 2]))
    assert abs(beam[0]) < 1e-12


def test_work_of_turns_gusts_and_righting_moments_is_booked() -> None:
    tank = replace(VESSEL.tank, quadratic_loss=2.0)
    ship = replace(VESSEL.ship, restoring_odd_nm=(-1e8,))
    omega = ship.natural_frequency_rad_s
    frequency, phase = np.array([omega, 1.9 * omega]), np.array([0.1, 0.4])
    stiffness = ship.stiffness_nm_rad
    waves = SteadyWaves(
        Harmonics(np.array([0.04 * stiffness, 0.0]), frequency, phase),
        Harmonics(np.array([0.02, 0.0]), frequency, phase + 1.0),
        Harmonics(np.array([0.1, 0.3]), frequency, phase),
    )
    turn = turning(lambda t: 0.01 * max(t - 20, 0), lambda _: 9.0, 1.2e7, 3.0)
    plant = Plant(ship, tank, None, waves, turning=turn)
    rolls(plant, 200.0)
    rate_m_s = plant.flow_m3_s / tank.reservoir_area_m2
    state = [plant.roll_rad, plant.roll_rate_rad_s, plant.level_m, rate_m_s]
    gained_j = float(energy(ship, tank, [state])[0] - energy(ship, tank, [[0.0] * 4])[0])
    assert plant.losses_j > 1e8
    assert plant.wave_work_j - plant.losses_j == pytest.approx(gained_j, abs=1e-6 * plant.losses_j)


@pytest.mark.parametrize(
    ("changes", "key", "words"),
    [
        ({"gusts": {"mean_speed_m_s": 15.0}}, "gusts", "needs a steady wind"),
        ({"gusts": {"mean_speed_m_s": 0.1}}, "gusts.mean_speed_m_s", "must be 1 to 80"),
        ({"turning_lever_m": 3.0}, "turning_lever_m", "voyage with turns"),
        (
            {"turning_lever_m": 3.0, "voyage": [{"time_s": 30.0, "heading_deg": 40.0}]},
            "turning_lever_m",
            "ship's mass",
        ),
        (
            {"righting_in_waves": {"length_m": 100.0, "share_per_m": -0.1}, "plant": "fmu"},
            "righting_in_waves",
            "does not act on the ship of an FMU",
        ),
    ],
)
def test_what_can_not_act_is_refused_by_its_key(
    tmp_path: Path, changes: dict[str, object], key: str, words: str
) -> None:
    with pytest.raises(ConfigError, match=f"{key}: .*{words}"):
        load_config(scenario_file(tmp_path, **changes), Scenario)


def test_gusts_go_on_while_the_ship_changes_course(tmp_path: Path) -> None:
    changes = {
        "sea": {"kind": "jonswap", "hs_m": 0.001, "tp_s": 8.0, "spreading": 10.0},
        "actual_ship": {"wind_moment_nm": 1e7},
        "gusts": {"mean_speed_m_s": 20.0},
    }
    steady = load_config(scenario_file(tmp_path, **changes), Scenario)
    way = [{"time_s": 50.0, "heading_deg": 40.0}]
    sailing = yaml.safe_load(scenario_file(tmp_path, **changes, voyage=way).read_text())
    (tmp_path / "way.yaml").write_text(yaml.safe_dump(sailing))
    under_way = load_config(tmp_path / "way.yaml", Scenario)
    one, other = (rolls(bare_plant(each, 2), 60.0) for each in (steady, under_way))
    assert np.std(one) > 1e-3
    np.testing.assert_allclose(one, other, atol=0.02 * np.std(one))
