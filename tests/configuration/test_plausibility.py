"""Slips of unit and digit: what can't be is refused at its key, what is unusual is warned of."""

import copy
from pathlib import Path

import pytest
import yaml

from firmware_sim.scenario import Scenario
from utank_hil.configuration import ConfigError, ControllerConfig, Vessel, load_config
from utank_hil.configuration.yaml_text import parse_yaml
from utank_hil.dynamics.nonlinear import RollModel, steady_heel

CONFIGS = Path("configs").resolve()
SHIPS = {path.stem: parse_yaml(path.read_text())[0] for path in CONFIGS.glob("ships/*.yaml")}
STORM = {
    **parse_yaml((CONFIGS / "scenarios" / "storm.yaml").read_text())[0],
    "vessel": str(CONFIGS / "ships" / "thesis_first.yaml"),
    "controllers": {"pd": str(CONFIGS / "controllers" / "pd.yaml")},
}
FIRST = "thesis_first"


def told(folder, content, model):
    """Refusals and warnings of a file, by key."""
    file = folder / "changed.yaml"
    file.write_text(yaml.safe_dump(content))
    try:
        return {}, dict(load_config(file, model).warnings())
    except ConfigError as error:
        return {problem.key: problem.reason for problem in error.problems}, {}


def vessel(ship, **changes):
    """A shipped ship with keys (``__`` for the dot) changed; a function changes what is there."""
    content = copy.deepcopy(SHIPS[ship])
    for key, value in changes.items():
        section, name = key.split("__")
        content[section][name] = value(content[section][name]) if callable(value) else value
    return content


def thousandth(value):
    return value / 1000


def thousandfold(value):
    return value * 1000


@pytest.mark.parametrize(
    ("ship", "changes", "key", "words"),
    [
        (FIRST, {"tank__width_m": 17100}, "tank.width_m", "17100 m, wider than any ship"),
        (FIRST, {"tank__height_m": 4880}, "tank.height_m", "4880 m in a tank of width_m 17.1"),
        (FIRST, {"tank__density_kg_m3": 1.0}, "tank.density_kg_m3", "no liquid's density"),
        (FIRST, {"ship__inertia_kg_m2": thousandth}, "ship.inertia_kg_m2",
         "roll period of 0.4 s, short for a ship that holds a tank 17.1 m wide: inertia_kg_m2 is "
         "in kg m2 (in t m2 it would be 12.6 s)"),
        (FIRST, {"ship__stiffness_nm_rad": thousandth}, "ship.stiffness_nm_rad",
         "roll period of 397 s, long for a ship that holds a tank 17.1 m wide: stiffness_nm_rad is "
         "in N m (in kN m it would be 12.6 s)"),
        (FIRST, {"ship__inertia_kg_m2": thousandth, "ship__stiffness_nm_rad": thousandth,
                 "ship__damping_nms_rad": thousandth}, "tank",
         "unless inertia_kg_m2 and stiffness_nm_rad are given in thousands (t m2, kN m)"),
        (FIRST, {"ship__damping_nms_rad": thousandfold}, "ship.damping_nms_rad",
         "is a damping ratio of 25 at 10 degrees of roll and 10 m/s; hulls have 0.005 to 0.15"),
        ("patti_b", {"ship__quadratic_damping_nms2_rad2": thousandfold},
         "ship.quadratic_damping_nms2_rad2", "at 10 degrees of roll"),
        (FIRST, {"ship__displacement_n": 4.1e4}, "ship.displacement_n",
         "a weight in newtons, not a mass"),
        (FIRST, {"ship__displacement_n": 1.6e10, "ship__inertia_kg_m2": 9.6e10,
                 "ship__stiffness_nm_rad": 2.4e10}, "ship.displacement_n", "m3 of water for a"),
        (FIRST, {"tank__damping_ratio": 10}, "tank.damping_ratio", "10 % is 0.10"),
        (FIRST, {"tank__lz_m": -20}, "tank.lz_m",
         "puts the duct -20 m from the ship's centre of gravity, positive downwards"),
        (FIRST, {"tank__lx_m": 1000}, "tank.lx_m", "positive forward"),
        (FIRST, {"tank__duct_area_m2": thousandth}, "tank.duct_area_m2",
         "gives the water a period of 308 s, and the ship rolls in 12.6 s: about 4.26 m2 would "
         "suit"),
        (FIRST, {"tank__duct_area_m2": 62200}, "tank.duct_area_m2", "of one duct and of one"),
        (FIRST, {"tank__reservoir_area_m2": 170}, "tank", "more roll inertia in its water"),
        (FIRST, {"pump__max_pressure_pa": 25}, "pump.max_pressure_pa",
         "is 0.0025 m of water, and a reservoir is full or empty at 4.88 m: it is in Pa, 25 kPa is "
         "25e3"),
        (FIRST, {"pump__max_pressure_pa": 50e6}, "pump.max_pressure_pa", "it is in Pa"),
        ("naval_vessel", {"pump__max_power_w": 225}, "pump.max_power_w",
         "is 0.225 kW, and to hold max_pressure_pa, 20 kPa, takes 27.1 kW even in still water "
         "with a duct_area_m2 of 0.39: raise it, or lower max_pressure_pa; it is in W, 225 kW is "
         "225e3"),
        (FIRST, {"pump__max_torque_nm": 200}, "pump.max_torque_nm", "it is in N m"),
        (FIRST, {"pump__max_pressure_rate_pa_s": 500}, "pump.max_pressure_rate_pa_s",
         "takes 100 s to the greatest pressure, and the ship rolls in 12.6 s"),
        (FIRST, {"pump__lag_s": 100}, "pump.lag_s", "it is in seconds"),
        (FIRST, {"pump__inertia_kg_m2": thousandfold}, "pump.inertia_kg_m2", "it is in kg m2"),
        (FIRST, {"pump__radius_m": 985, "pump__pitch_m": 400}, "pump.radius_m", "is 985 m in a"),
        (FIRST, {"tank__duct_area_m2": 1.13, "pump__duct_area_m2": 11, "pump__radius_m": 1.3,
                 "pump__pitch_m": 0.53}, "pump.duct_area_m2",
         "is 11 m2, and the tank's duct has 1.13 m2: the propeller fills the duct"),
    ],
)  # fmt: skip
def test_what_can_not_be_is_refused_at_its_key_with_the_remedy(tmp_path, ship, changes, key, words):
    refused, _ = told(tmp_path, vessel(ship, **changes), Vessel)
    assert set(refused) == {key}
    assert words in refused[key]


@pytest.mark.parametrize(
    ("changes", "key", "words"),
    [
        ({"tank__damping_ratio": 0.8}, "tank.damping_ratio", "creep instead of swing"),
        ({"tank__damping_ratio": 0.0}, "tank.damping_ratio", "swing for ever"),
        ({"tank__lz_m": 14.0}, "tank.lz_m", "the duct 14 m from"),
        ({"tank__duct_area_m2": 0.6, "pump__duct_area_m2": 0.6, "pump__radius_m": 0.3,
          "pump__pitch_m": 0.12}, "tank.duct_area_m2", "about 4.26 m2 would suit"),
        ({"pump__max_power_w": 225e3}, "pump.max_power_w", "is 225 kW, and to hold"),
        ({"pump__max_power_w": 225e6}, "pump.max_power_w", "times what the greatest pressure"),
        ({"pump__max_pressure_pa": 1e3}, "pump.max_pressure_pa", "0.1 m of water"),
        ({"pump__duct_area_m2": 15.0}, "pump.duct_area_m2", "make both the same"),
    ],
)  # fmt: skip
def test_what_is_unusual_is_warned_of(tmp_path, changes, key, words):
    refused, warned = told(tmp_path, vessel(FIRST, **changes), Vessel)
    assert refused == {}
    assert words in warned[key]


@pytest.mark.parametrize(
    ("hull", "key"),
    [
        ({"roll_period_s": 0.4}, "ship.roll_period_s"),
        ({"beam_m": 0.02, "draught_m": 0.01, "length_m": 1.0}, "ship.displacement_t"),
        ({"beam_m": 2.0, "draught_m": 200.0, "length_m": 100.0}, "ship.beam_m"),
        ({"inertia_kg_m2": 1.9e6}, "ship.inertia_kg_m2"),
        ({"roll_period_s": 12.6, "damping_ratio": 3.0}, "ship.damping_ratio"),
    ],
)
def test_what_can_not_be_is_refused_at_the_key_that_is_written(tmp_path, hull, key):
    content = vessel(FIRST)
    content["ship"] = {"displacement_t": 41e3, "gm_m": 1.2, **hull}
    refused, _ = told(tmp_path, content, Vessel)
    assert set(refused) == {key}


@pytest.mark.parametrize("ship", SHIPS)
def test_shipped_vessels_are_plausible(tmp_path, ship):
    """But for the fishing boat's tank, which does take half of her stability."""
    refused, warned = told(tmp_path, vessel(ship), Vessel)
    assert refused == {}
    expected = {"tank.reservoir_area_m2"} if ship == "patti_b" else set()
    assert set(warned) == expected


def jonswap(hs_m, tp_s, **more):
    return {"kind": "jonswap", "hs_m": hs_m, "tp_s": tp_s, **more}


def regular(**more):
    return {"kind": "regular", "amplitude_m": 1.0, "period_s": 10.0, **more}


@pytest.mark.parametrize(
    ("sea", "key", "words"),
    [
        (jonswap(300, 60), "sea.hs_m", "must be above 0 and at most 30"),
        (jonswap(300, 60), "sea.tp_s", "must be above 0 and at most 40"),
        (jonswap(12, 8), "sea.hs_m", "a steepness of 1/8.3: such waves break"),
        ({"kind": "pierson_moskowitz", "hs_m": 300}, "sea.hs_m", "at most 30"),
        (regular(amplitude_m=15), "sea.amplitude_m", "it breaks above 11 m"),
        (regular(heading_deg=420), "sea.heading_deg", "must be -360 to 360"),
        (regular(speed_m_s=120), "sea.speed_m_s", "must be 0 to 40"),
        (regular(heading_deg=0), "sea.heading_deg", "of 0 gives no roll moment"),
        (jonswap(3, 10, heading_deg=180), "sea.heading_deg", "of 180 gives no roll moment"),
        (jonswap(3, 10, effective_slope={"coefficient": 0}), "sea.effective_slope.coefficient",
         "takes all of the waves' moment"),
    ],
)  # fmt: skip
def test_sea_that_can_not_be_or_does_nothing_is_refused(tmp_path, sea, key, words):
    refused, _ = told(tmp_path, {**STORM, "sea": sea}, Scenario)
    assert words in refused[key]


@pytest.mark.parametrize(
    ("sea", "key", "words"),
    [
        (jonswap(8, 9), "sea.hs_m", "seas of this period hardly pass 1/15.9"),
        (jonswap(3, 10, speed_m_s=22), "sea.speed_m_s", "is 43 knots"),
    ],
)
def test_unusual_sea_is_warned_of(tmp_path, sea, key, words):
    refused, warned = told(tmp_path, {**STORM, "sea": sea}, Scenario)
    assert refused == {}
    assert words in warned[key]


@pytest.mark.parametrize(("scale", "refused"), [(1.0, False), (1e-3, True), (1e3, True)])
def test_moment_table_in_other_units_is_refused(tmp_path, scale, *, refused):
    full = 4.81875e8 / 9.80665  # stiffness times k / omega^2
    rows = [
        f"{omega},{heading},{scale * full * omega**2 * (heading == 90)},90"
        for omega in (0.3, 0.6, 0.9)
        for heading in (0, 90, 180)
    ]
    head = "omega_rad_s,heading_deg,moment_nm_per_m,phase_deg"
    (tmp_path / "moments.csv").write_text("\n".join([head, *rows]))
    sea = jonswap(3, 10, roll_moment_table="./moments.csv")
    problems, _ = told(tmp_path, {**STORM, "sea": sea}, Scenario)
    assert set(problems) == ({"sea.roll_moment_table"} if refused else set())
    assert not refused or "not kN m" in problems["sea.roll_moment_table"]


@pytest.mark.parametrize(
    "sea",
    [
        regular(amplitude_m=0.0),
        jonswap(3, 10, heading_deg=0, spreading=10),
        jonswap(3, 10, heading_deg=-90),
        jonswap(3, 10, heading_deg=300, speed_m_s=10),
        STORM["sea"] | {"file": str(CONFIGS / "seas/ndbc_41010_2019-02_spectral_density.txt")},
    ],
)
def test_seas_that_can_be_pass(tmp_path, sea):
    assert told(tmp_path, {**STORM, "sea": sea}, Scenario) == ({}, {})


@pytest.mark.parametrize(("section", "watched"), [({}, False), ({"sea_estimate": {}}, True)])
def test_limit_of_the_stability_that_nothing_watches_is_warned_of(tmp_path, section, watched):
    ship = copy.deepcopy(SHIPS[FIRST])
    ship["ship"].pop("displacement_n", None)
    ship["ship"]["displacement_t"] = 14500
    (tmp_path / "ship.yaml").write_text(yaml.safe_dump({**ship, "least_gm_m": 0.45}))
    content = parse_yaml((CONFIGS / "controllers" / "lqg.yaml").read_text())[0]
    controller = {**content, "vessel": "ship.yaml", **section}
    refused, warned = told(tmp_path, controller, ControllerConfig)
    assert refused == {}
    assert ("vessel.least_gm_m" not in warned) == watched


@pytest.mark.parametrize(
    ("name", "noise_m", "pressure_pa", "warned"),
    [
        ("patti_b_constrained_gpc", 0.001, 20e3, False),
        ("patti_b_constrained_gpc", 0.005, 20e3, True),
        ("patti_b_constrained_gpc", 0.005, 1.5e3, False),  # held for ever, it does no harm
        ("gpc", 0.05, 50e3, False),
        ("naval_constrained_gpc", 0.02, 20e3, False),
    ],
)
def test_gauges_too_noisy_for_a_pump_that_is_strong_for_its_ship_are_warned_of(
    tmp_path, name, noise_m, pressure_pa, warned
):
    """What the water weighs that moves 48 times the noise: 2 rho g of it, held by the pump."""
    sensors, limits = {"level_noise_m": noise_m}, {"pressure_pa": pressure_pa}
    content = controller(name, sensors=sensors, limits=limits)
    _, found = told(tmp_path, content, ControllerConfig)
    assert ("sensors.level_noise_m" in found) == warned
    loaded = load_config(tmp_path / "changed.yaml", ControllerConfig)
    model = RollModel(loaded.vessel.ship, loaded.vessel.tank)
    unseen_pa = min(2 * loaded.vessel.tank.density_kg_m3 * 9.80665 * 48 * noise_m, pressure_pa)
    heel = steady_heel(model, unseen_pa)
    most_rad = loaded.safety.roll_limit_rad / 4
    assert (heel is None or abs(heel.roll_rad) > most_rad) == warned
    if warned:  # either remedy is one
        words = found["sensors.level_noise_m"]
        fine_m, weak_pa = (
            float(words.split(before)[1].split()[0]) for before in ("gauges of ", "pressure_pa to ")
        )
        for change in (
            {"sensors": {"level_noise_m": fine_m}},
            {"limits": {"pressure_pa": weak_pa}},
        ):
            content = controller(name, **{"sensors": sensors, "limits": limits, **change})
            assert "sensors.level_noise_m" not in told(tmp_path, content, ControllerConfig)[1]


def controller(name, **changes):
    """A shipped controller with sections changed."""
    content = parse_yaml((CONFIGS / "controllers" / f"{name}.yaml").read_text())[0]
    vessel = (CONFIGS / "controllers" / content["vessel"]).resolve()
    return {**content, "vessel": str(vessel), **changes}


def test_roll_and_heel_are_limited_while_she_still_rights_herself(tmp_path):
    """Patti-B with her water: her righting moment is greatest at 10.9 degrees, gone at 19.0."""
    limits = {}
    for name in ("patti_b_constrained_gpc", "gpc"):
        safety = load_config(CONFIGS / "controllers" / f"{name}.yaml", ControllerConfig).safety
        limits[name] = (safety.roll_limit_rad, safety.heel_limit_rad)
    assert limits == {"patti_b_constrained_gpc": (0.19, 0.095), "gpc": (0.35, 0.14)}
    given = {"roll_limit_rad": 0.33, "heel_limit_rad": 0.2}
    file = tmp_path / "given.yaml"
    file.write_text(yaml.safe_dump(controller("patti_b_constrained_gpc", safety=given)))
    safety = load_config(file, ControllerConfig).safety
    assert (safety.roll_limit_rad, safety.heel_limit_rad) == (0.33, 0.2)


def test_a_roll_limit_at_which_she_no_longer_rights_herself_is_refused(tmp_path):
    wrong = controller("patti_b_constrained_gpc", safety={"roll_limit_rad": 0.34})
    refused, _ = told(tmp_path, wrong, ControllerConfig)
    assert list(refused) == ["safety.roll_limit_rad"]
    assert "vanishes at 0.33 rad" in refused["safety.roll_limit_rad"]
    assert "set it to 0.19 or less" in refused["safety.roll_limit_rad"]


@pytest.mark.parametrize(("pressure_pa", "warned"), [(20e3, True), (4.5e3, True), (4.2e3, False)])
def test_a_pump_that_could_capsize_her_is_warned_of(tmp_path, pressure_pa, warned):
    limits = {"pressure_pa": pressure_pa, "level_m": 1.64, "brake_share": 1.0, "sharpness": 4.0}
    without_a_cut = {key: value for key, value in SHIPS["patti_b"].items() if key != "redundancy"}
    law = controller("patti_b_self_tuning", limits=limits) | {"vessel": without_a_cut}
    refused, warnings = told(tmp_path, law, ControllerConfig)
    assert refused == {}
    assert ("limits.pressure_pa" in warnings) == warned
    if warned:
        assert (
            f"is {pressure_pa / 1e3:.4g} kPa, and over 4.44 kPa takes the ship beyond 0.19"
            in (warnings["limits.pressure_pa"])
        )


def test_without_a_pump_none_is_warned_of(tmp_path):
    ship = vessel("patti_b")
    del ship["pump"]
    (tmp_path / "ship.yaml").write_text(yaml.safe_dump(ship))
    passive = {"name": "Passive", "vessel": "ship.yaml", "law": {"kind": "passive"}}
    refused, warnings = told(tmp_path, passive, ControllerConfig)
    assert refused == {}
    assert "limits.pressure_pa" not in warnings


def test_a_ship_that_hardly_rights_herself_is_refused_in_words(tmp_path):
    ship = vessel("patti_b", ship__restoring_odd_nm=[-1.6e9])
    (tmp_path / "ship.yaml").write_text(yaml.safe_dump(ship))
    refused, _ = told(
        tmp_path, {**controller("patti_b_self_tuning"), "vessel": "ship.yaml"}, ControllerConfig
    )
    assert "righting moment is greatest at 0.0063 rad" in refused["tank"]
    assert list(refused) == ["tank"]


@pytest.mark.parametrize(("roll_rad", "warned"), [(0.19, True), (0.18, False)])
def test_a_retuning_that_ends_after_control_has_is_warned_of(tmp_path, roll_rad, warned):
    safety, retuning = (
        {"roll_limit_rad": 0.19},
        {"roll_limit_rad": roll_rad, "roll_period_range_s": [9, 16]},
    )
    law = controller("gpc", safety=safety, retuning=retuning)
    refused, warnings = told(tmp_path, law, ControllerConfig)
    assert refused == {}
    assert ("retuning.roll_limit_rad" in warnings) == warned
