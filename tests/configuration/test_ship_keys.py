"""Ship and pump in the keys that a naval architect has."""

import math

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from utank_hil.configuration import ConfigError, ControllerConfig, Vessel, load_config
from utank_hil.configuration.ship_keys import WrittenShip, weather_criterion_period_s
from utank_hil.dynamics.pump import Pump
from utank_hil.dynamics.ship import RollShip

SHIP = "{displacement_t: 1900, gm_m: 0.9, roll_period_s: 9.5, damping_ratio: 0.05}"
HULL = "beam_m: 10, draught_m: 3.2, length_m: 60"
PUMP = "{max_pressure_pa: 20.0e+3}"


def vessel_file(folder, ship=SHIP, pump=PUMP):
    path = folder / "vessel.yaml"
    tank = "{width_m: 8.0, height_m: 1.6, reservoir_area_m2: 6.0, duct_area_m2: 1.2}"
    lines = ["name: boat", f"ship: {ship}", f"tank: {tank}"]
    if pump is not None:
        lines.append(f"pump: {pump}")
    path.write_text("\n".join(lines) + "\n")
    return path


def vessel(folder, ship=SHIP, pump=PUMP):
    return load_config(vessel_file(folder, ship, pump), Vessel)


def problems(folder, ship=SHIP, pump=PUMP):
    with pytest.raises(ConfigError) as caught:
        vessel(folder, ship, pump)
    return {problem.key: problem.reason for problem in caught.value.problems}


@given(
    displacement_t=st.floats(10, 5e5),
    gm_m=st.floats(0.05, 15),
    roll_period_s=st.floats(2, 40),
    damping_ratio=st.floats(0.001, 0.5),
)
def test_ship_has_the_period_stability_and_damping_it_was_given(
    displacement_t, gm_m, roll_period_s, damping_ratio
):
    ship = WrittenShip(
        displacement_t=displacement_t,
        gm_m=gm_m,
        roll_period_s=roll_period_s,
        damping_ratio=damping_ratio,
    ).ship()
    assert type(ship) is RollShip
    gyradius_m = roll_period_s / (2 * math.pi) * math.sqrt(9.80665 * gm_m)
    assert ship.inertia_kg_m2 == pytest.approx(1e3 * displacement_t * gyradius_m**2)
    assert ship.stiffness_nm_rad == pytest.approx(ship.displacement_n * gm_m)
    assert ship.displacement_n == pytest.approx(9806.65 * displacement_t)
    # share of the amplitude that is left after one free swing
    decay = ship.damping_nms_rad / (2 * ship.inertia_kg_m2)
    frequency = math.sqrt(ship.natural_frequency_rad_s**2 - decay**2)
    left = math.exp(-2 * math.pi * damping_ratio / math.sqrt(1 - damping_ratio**2))
    assert math.exp(-decay * 2 * math.pi / frequency) == pytest.approx(left)


def test_a_quantity_may_be_given_by_either_key(tmp_path):
    whole = vessel(tmp_path)
    own = whole.ship
    mixed = (
        f"{{inertia_kg_m2: {own.inertia_kg_m2!r}, gm_m: 0.9, displacement_t: 1900, "
        f"damping_nms_rad: {own.damping_nms_rad!r}}}"
    )
    assert vessel(tmp_path, mixed).ship == own
    plain = f"{{inertia_kg_m2: 3.0e+7, stiffness_nm_rad: {own.stiffness_nm_rad!r}}}"
    assert vessel(tmp_path, plain).ship == RollShip(3e7, own.stiffness_nm_rad)


def test_period_of_the_weather_criterion():
    # by hand: C = 0.373 + 0.023 * 3.125 - 0.043 * 0.6 = 0.419075, T = 2 C 10 / 0.948683
    assert weather_criterion_period_s(10, 3.2, 60, 0.9) == pytest.approx(8.8349, abs=5e-4)


def test_period_by_formula_is_said(tmp_path):
    assert vessel(tmp_path).assumptions == ()
    found = vessel(tmp_path, f"{{displacement_t: 1900, gm_m: 0.9, {HULL}}}")
    assert 2 * math.pi / found.ship.natural_frequency_rad_s == pytest.approx(8.8349, abs=5e-4)
    assert "8.8 s by the weather criterion" in found.assumptions[0]
    by_stiffness = f"{{displacement_t: 1900, stiffness_nm_rad: 1.67693715e+7, {HULL}}}"
    again = vessel(tmp_path, by_stiffness).ship
    assert again.inertia_kg_m2 == pytest.approx(found.ship.inertia_kg_m2)


@pytest.mark.parametrize(
    ("own", "other"),
    [
        ("displacement_t", "displacement_n"),
        ("gm_m", "stiffness_nm_rad"),
        ("roll_period_s", "inertia_kg_m2"),
        ("damping_ratio", "damping_nms_rad"),
    ],
)
def test_a_quantity_given_twice_is_refused_by_both_names(tmp_path, own, other):
    found = problems(tmp_path, SHIP.replace("}", f", {other}: 1.0e+7}}"))
    assert found == {f"ship.{own}": f"and {other} give the same quantity: remove one of them"}


@pytest.mark.parametrize(
    ("ship", "expected"),
    [
        ("{}", {"stiffness_nm_rad": "displacement_t and gm_m", "inertia_kg_m2": "roll_period_s"}),
        ("{displacement_t: 9, roll_period_s: 9}", {"gm_m": "or else stiffness_nm_rad"}),
        ("{gm_m: 1, roll_period_s: 9}", {"displacement_t": "required with gm_m"}),
        (
            "{displacement_t: 9, gm_m: 1, beam_m: 5}",
            {"draught_m": "for the roll period", "length_m": "for the roll period"},
        ),
        (f"{{stiffness_nm_rad: 1.0e+7, {HULL}}}", {"displacement_t": "or else roll_period_s"}),
        (
            "{displacement_t: 12000, gm_m: 1, beam_m: 5, draught_m: 2, length_m: 2000}",
            {"length_m": "give roll_period_s"},
        ),
        (
            "{stiffness_nm_rad: 1.0e+30, roll_period_s: 1.0e+4, damping_ratio: 0}",
            {"roll_period_s": "at most 1e+30"},
        ),
        ("{displacement_t: -3, gm_m: 1, roll_period_s: 9}", {"displacement_t": "above 0"}),
        ("{gm: 1, roll_period_s: 9}", {"gm": "did you mean gm_m?"}),
        ("{displacment_t: 1, gm_m: 1}", {"displacment_t": "did you mean displacement_t?"}),
    ],
)
def test_what_is_missing_or_wrong_is_said_in_the_keys_of_the_file(tmp_path, ship, expected):
    found = problems(tmp_path, ship)
    assert found.keys() == {f"ship.{key}" for key in expected}
    for key, reason in expected.items():
        assert reason in found[f"ship.{key}"]


@pytest.mark.parametrize(
    ("change", "key", "reason"),
    [
        (
            ("9.5", "0.5"),
            "roll_period_s",
            "short for a ship that holds a tank 8 m wide: it is in s",
        ),
        (
            ("roll_period_s: 9.5", "beam_m: 0.5, draught_m: 1, length_m: 9"),
            "displacement_t",
            "length_m 9, beam_m 0.5 and draught_m 1",
        ),
        (("0.9", "90"), "gm_m", "radius of gyration of 44.9 m"),
        (("0.05", "5.0"), "damping_ratio", "10 % is 0.10"),
    ],
)
def test_a_slip_is_told_at_the_key_that_was_written(tmp_path, change, key, reason):
    assert reason in problems(tmp_path, SHIP.replace(*change))[f"ship.{key}"]


def test_an_unusual_figure_is_told_at_the_key_that_was_written(tmp_path):
    (found,) = vessel(tmp_path, SHIP.replace("0.05", "0.4")).warnings()[:1]
    assert found[0] == "ship.damping_ratio"
    assert "10 % is 0.10" in found[1]


def test_righting_levers_go_with_the_displacement_in_tonnes(tmp_path):
    levers = ", gz_step_rad: 0.1745, gz_m: [0.0, 0.16, 0.34, 0.5]}"
    ship = vessel(tmp_path, SHIP.replace("}", levers)).ship
    assert ship.displacement_n == pytest.approx(1900e3 * 9.80665)
    assert ship.gz_m == (0.0, 0.16, 0.34, 0.5)


@settings(suppress_health_check=[HealthCheck.function_scoped_fixture], max_examples=25)
@given(pressure_pa=st.floats(2e3, 1e5), area_m2=st.floats(0.4, 3))
def test_pump_follows_from_its_pressure_and_the_duct(tmp_path, pressure_pa, area_m2):
    given_both = f"{{max_pressure_pa: {pressure_pa!r}, duct_area_m2: {area_m2!r}}}"
    found = vessel(tmp_path, pump=given_both)
    assert found.pump == Pump.for_duct(area_m2, pressure_pa)


def test_pump_fills_the_tanks_duct_and_keeps_what_is_given(tmp_path):
    similar = Pump.for_duct(1.2, 20e3)
    assert vessel(tmp_path).pump == similar
    own = vessel(tmp_path, pump="{max_pressure_pa: 20.0e+3, max_power_w: 9.0e+4}").pump
    assert (own.max_power_w, own.radius_m) == (9e4, similar.radius_m)


@pytest.mark.parametrize(
    ("pump", "key", "reason"),
    [
        ("{}", "max_pressure_pa", "required"),
        ("{max_pressure_pa: -1}", "max_pressure_pa", "positive"),
        ("{max_pressure_pa: 1.0e+4, duct_area_m2: 0}", "duct_area_m2", "positive"),
        ("{max_pressure_pa: 1.0e+4, radus_m: 1}", "radus_m", "did you mean radius_m?"),
    ],
)
def test_pump_in_few_keys_is_checked_at_its_own_keys(tmp_path, pump, key, reason):
    found = problems(tmp_path, pump=pump)
    assert found.keys() == {f"pump.{key}"}
    assert reason in found[f"pump.{key}"]


def test_a_law_needs_a_pump(tmp_path):
    vessel_file(tmp_path, pump=None)
    controller = tmp_path / "controller.yaml"
    controller.write_text("name: c\nvessel: vessel.yaml\nlaw: {kind: pd}\n")
    with pytest.raises(ConfigError, match=r"law\.kind: is pd, which drives a pump, but boat has"):
        load_config(controller, ControllerConfig)
    controller.write_text("name: c\nvessel: vessel.yaml\nlaw: {kind: passive}\n")
    assert load_config(controller, ControllerConfig).vessel.pump is None


def test_vessels_with_and_without_pump_are_different_ones(tmp_path):
    assert vessel(tmp_path).version != vessel(tmp_path, pump=None).version
