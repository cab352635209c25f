"""The valve of a ship file: opening and loss, and what it refuses."""

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from utank_hil.configuration import Vessel, load_config
from utank_hil.dynamics.valves import (
    Valve,
    added_damping_ratio,
    air_valve_loss,
    duct_valve_loss,
    valve_problems,
)

TANK = load_config(Path("configs/ships/thesis_first.yaml"), Vessel).tank
DUCT = Valve("duct", opening_time_s=1.0, leakage=0.1)
AIR = Valve("air", opening_time_s=1.0, leakage=0.1, pipe_area_m2=0.4)
each = pytest.mark.parametrize("valve", [DUCT, AIR], ids=["duct", "air"])


@each
@given(st.floats(0, 1))
def test_the_opening_for_a_loss_has_that_loss(valve, opening):
    loss = valve.loss(TANK, opening)
    assert valve.loss(TANK, valve.opening(TANK, loss)) == pytest.approx(loss, rel=1e-9, abs=1e-9)


@each
@given(st.floats(0, 1e12))
def test_any_loss_gives_an_opening_of_the_valve(valve, loss):
    opening = valve.opening(TANK, loss)
    least, greatest = valve.range(TANK).open_loss, valve.range(TANK).shut_loss
    expected = min(max(loss, least), greatest)
    assert valve.loss(TANK, opening) == pytest.approx(expected, rel=1e-9, abs=1e-9)


def test_ends_of_the_way_are_open_and_the_leakage():
    assert DUCT.loss(TANK, 1.0) == 0
    assert DUCT.loss(TANK, 0.0) == duct_valve_loss(TANK, 0.1)
    assert AIR.loss(TANK, 1.0) == air_valve_loss(TANK, 0.4, 1.0)
    assert AIR.loss(TANK, 0.0) == pytest.approx(air_valve_loss(TANK, 0.4, 0.1))
    assert DUCT.fail_opening == 1.0
    assert replace(DUCT, fail_position="shut").fail_opening == 0.0


def test_added_damping_takes_the_energy_that_the_quadratic_loss_takes():
    loss, level_m = 2e4, 0.7
    omega = TANK.natural_frequency_rad_s
    linear = (
        2
        * added_damping_ratio(TANK, loss, level_m)
        * omega
        * (TANK.density_kg_m3 * TANK.effective_length_m)
    )
    speed = level_m * omega * np.cos(np.linspace(0, 2 * np.pi, 10_001))
    assert np.mean(linear * speed**2) == pytest.approx(np.mean(loss * abs(speed) ** 3), rel=1e-3)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"opening_time_s": 0.01}, "opening_time_s must be 0.05 to 60"),
        ({"leakage": 0.0}, "leakage must be above 0"),
        ({"leakage": 1.0}, "leakage must be above 0"),
        ({"pipe_area_m2": 0.4}, "pipe_area_m2 is for kind: air"),
        ({"kind": "air"}, "pipe_area_m2 is required but missing: kind is air"),
        ({"kind": "air", "pipe_area_m2": -1.0}, "pipe_area_m2 must be positive"),
    ],
)
def test_a_valve_that_can_not_be_is_refused_by_name(changes, message):
    with pytest.raises(ValueError, match=message):
        replace(DUCT, **changes)


@pytest.mark.parametrize(
    ("valve", "key"),
    [(replace(DUCT, leakage=1e-3), "leakage"), (replace(AIR, pipe_area_m2=1e-3), "pipe_area_m2")],
)
def test_a_valve_as_good_as_closed_does_not_suit_the_tank(valve, key):
    assert valve_problems(TANK, DUCT) == valve_problems(TANK, AIR) == []
    ((name, reason),) = valve_problems(TANK, valve)
    assert name == key
    assert "would stop the water within 1 ms" in reason
    inertia = TANK.density_kg_m3 * TANK.effective_length_m
    speed = math.sqrt(2 * 9.80665 / TANK.effective_length_m) * TANK.height_m
    assert valve.loss(TANK, 0.0) * speed / inertia > 1000  # 1/s
