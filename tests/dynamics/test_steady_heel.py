"""The steady heel, against ships that are pushed slowly and left alone."""

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from tools.thesis.simulate import simulate
from utank_hil.configuration import Vessel, load_config
from utank_hil.dynamics import RollModel
from utank_hil.dynamics.nonlinear import _at_rest, greatest_held_pa, righting_range, steady_heel

SHIPS = Path("configs/ships")
RISE_S, HOLD_S = 1000.0, 200.0


def vessel(name):
    return load_config(SHIPS / f"{name}.yaml", Vessel)


def left_alone(model, pressure_pa):
    """Last state under a pressure that rises slowly and stays, and when she capsized."""
    steps = pressure_pa * np.linspace(0, 1, round(RISE_S / 0.2))
    damped = RollModel(replace(model.ship, damping_nms_rad=20 * model.ship.damping_nms_rad),
                       model.tank)  # fmt: skip
    run = simulate(damped, RISE_S + HOLD_S, pressure_pa=steps, hold_s=0.2, record_every=50)
    return run.state[-1], run.time_s[-1]


@pytest.mark.parametrize("share", [0.3, 1.0, -1.0])
@pytest.mark.parametrize("name", ["thesis_first", "naval_vessel"])
def test_pressure_that_rises_slowly_ends_there(name, share):
    given = vessel(name)
    model, pressure_pa = RollModel(given.ship, given.tank), share * given.pump.max_pressure_pa
    heel = steady_heel(model, pressure_pa)
    state, _ = left_alone(model, pressure_pa)
    assert heel.roll_rad == pytest.approx(state[0], rel=2e-3)
    assert heel.at_the_end == (abs(state[2]) > 0.999 * given.tank.level_limit_m)


def test_water_of_a_held_heel_is_at_rest_at_its_level():
    given = vessel("thesis_first")
    model, pressure_pa = RollModel(given.ship, given.tank), 5e3
    heels = np.radians([0.0, 10.0, 30.0, 50.0])
    _, level_m = _at_rest(model, heels, pressure_pa)
    still = np.zeros_like(heels)
    states = np.stack([heels, still, level_m, still], axis=-1)
    _, roll, _, level = model.derivative(states, pressure_pa).T
    c = model.coefficients
    force_n = c.level_inertia * level + c.coupling * roll  # what is left of weight and pressure
    np.testing.assert_allclose(force_n, 0.0, atol=1e-6 * c.area * pressure_pa)


def test_water_at_the_roof_holds_less_than_the_pump_could():
    given = vessel("thesis_first")
    low = RollModel(given.ship, replace(given.tank, headroom_m=1.0))
    heel, state = steady_heel(low, 50e3), left_alone(low, 50e3)[0]
    assert heel.at_the_end
    assert heel.roll_rad == pytest.approx(state[0], rel=2e-3)
    assert heel.roll_rad < 0.5 * steady_heel(RollModel(given.ship, given.tank), 50e3).roll_rad


def test_pump_that_is_stronger_than_the_righting_moment_capsizes_her():
    given = vessel("patti_b")
    model = RollModel(given.ship, given.tank)
    assert steady_heel(model, 20e3) is None
    assert left_alone(model, 20e3)[1] < RISE_S + HOLD_S
    assert steady_heel(model, 2e3).roll_rad == pytest.approx(left_alone(model, 2e3)[0][0], rel=2e-3)


def test_the_greatest_pressure_that_is_held_is_where_she_begins_to_capsize():
    given = vessel("patti_b")
    model = RollModel(given.ship, given.tank)
    held_pa = greatest_held_pa(model, 20e3, 0.19)
    for share, capsizes in ((0.97, False), (1.03, True)):
        assert (left_alone(model, share * held_pa)[1] < RISE_S + HOLD_S) == capsizes
    assert greatest_held_pa(model, 2e3, 0.19) == 2e3


@pytest.mark.parametrize(("name", "within_deg"), [("patti_b", 4.0), ("thesis_first", 0.5)])
def test_the_greatest_pressure_that_is_held_heels_her_as_far_as_is_allowed(name, within_deg):
    given = vessel(name)
    windy = RollModel(replace(given.ship, wind_moment_nm=1e4), given.tank)  # has no part in it
    held_pa = greatest_held_pa(windy, given.pump.max_pressure_pa, math.radians(within_deg))
    state, _ = left_alone(RollModel(given.ship, given.tank), held_pa)
    assert abs(math.degrees(state[0])) == pytest.approx(within_deg, rel=4e-3)


@pytest.mark.parametrize("softer", [1.0, 0.9, 0.8, 0.7])
@pytest.mark.parametrize("curve", [1.0, 2.0])
def test_half_of_it_does_not_capsize_her_even_at_once(softer, curve):
    """Patti-B, and softer ships, from rest: in a step she heels further than in the end."""
    given = vessel("patti_b")
    ship = replace(
        given.ship,
        stiffness_nm_rad=softer * given.ship.stiffness_nm_rad,
        restoring_odd_nm=(curve * given.ship.restoring_odd_nm[0],),
    )
    model = RollModel(ship, given.tank)
    half_pa = greatest_held_pa(model, 20e3, righting_range(model).greatest_rad) / 2
    run = simulate(model, 300.0, pressure_pa=half_pa, record_every=5)
    assert np.abs(run.state[:, 0]).max() < 0.8 * righting_range(model).vanishing_rad


def test_a_ship_rights_herself_as_far_as_her_levers_less_what_the_water_takes():
    """M = k1 phi - k3 phi^3, hardly a tank: greatest at sqrt(k1 / 3 k3), gone at sqrt(k1 / k3)."""
    given = vessel("patti_b")
    ship = replace(given.ship, wind_moment_nm=1e4)  # which has no part in it
    small = replace(given.tank, reservoir_area_m2=2e-3, duct_area_m2=2e-4)
    k1, k3 = ship.stiffness_nm_rad, -ship.restoring_odd_nm[0]
    far = righting_range(RollModel(ship, small))
    assert far.greatest_rad == pytest.approx(math.sqrt(k1 / (3 * k3)), abs=1.5e-3)
    assert far.vanishing_rad == pytest.approx(math.sqrt(k1 / k3), abs=1.5e-3)
    stiffening = vessel("thesis_first")
    assert righting_range(RollModel(stiffening.ship, stiffening.tank)).vanishing_rad == math.inf


@pytest.mark.parametrize(("share", "capsizes"), [(0.98, False), (1.02, True)])
def test_from_where_her_stability_vanishes_she_falls_over(share, capsizes):
    """Let go at rest with the water level, so heavily damped that the water keeps up with her."""
    given = vessel("patti_b")
    model = RollModel(replace(given.ship, damping_nms_rad=1000 * given.ship.damping_nms_rad),
                      given.tank)  # fmt: skip
    roll_rad = share * righting_range(model).vanishing_rad
    level_m = given.tank.width_m / 2 * math.tan(roll_rad)
    run = simulate(model, 400.0, (roll_rad, 0.0, level_m, 0.0), record_every=50)
    assert (abs(run.state[-1, 0]) > roll_rad) == capsizes


def test_upright_ship_stays_and_wind_heels_her():
    given = vessel("thesis_first")
    assert steady_heel(RollModel(given.ship, given.tank)) == (0.0, False)
    windy = replace(given.ship, wind_moment_nm=-2e7)
    heel = steady_heel(RollModel(windy, given.tank))
    assert math.degrees(heel.roll_rad) == pytest.approx(-2.5, abs=0.1)
