"""The tank's equation in a ship that sways, with a sound and with a reversed motion sensor."""

import cmath
import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from moving_ship import FINDINGS, SHIP, TANK, THRESHOLDS

from utank_hil.dynamics.linear import coupled_matrices
from utank_hil.dynamics.ship import RollShip
from utank_hil.dynamics.tank import Tank
from utank_hil.safety.monitors import tank_equation
from utank_hil.safety.monitors.finding import Finding
from utank_hil.safety.monitors.level_stuck import LevelStuck
from utank_hil.safety.monitors.sway import most_sway
from utank_hil.safety.monitors.tank_equation import TankEquation

STEP_S = 0.1
G = 9.80665
T = THRESHOLDS.tank_period_s
UNSTATED = replace(SHIP, sway_of_slope=None)
OF_HULL = replace(THRESHOLDS, of_hull=True)
BETWEEN = pytest.mark.evidence  # the motion is linear in the share: its ends stand for them


def swaying(share, w, slope_rad, pressure_pa, effective):
    """Roll and level in a regular wave of a slope, to which the sway is in phase."""
    mass, damping, stiffness = coupled_matrices(SHIP, TANK)
    area = TANK.reservoir_area_m2
    pressure = pressure_pa * cmath.exp(1.3j)
    moment = effective * SHIP.stiffness_nm_rad * slope_rad
    lateral = share * G * slope_rad
    force = area * pressure - TANK.density_kg_m3 * area * TANK.width_m * lateral
    q = np.linalg.solve(stiffness - w**2 * mass + 1j * w * damping, [moment, force])
    return (*q, pressure)


def found_in(ship, phasors, w, sign=1.0, noise_share=1.0, thresholds=THRESHOLDS, gauges=1.0):
    equation = TankEquation(ship, TANK, thresholds, STEP_S)
    stuck = LevelStuck(ship, TANK, thresholds, STEP_S)
    noise = np.random.default_rng(1)
    first: dict[int, float] = {}
    for k in range(round(120.0 / STEP_S)):
        at = [(each * cmath.exp(1j * w * k * STEP_S)).real for each in phasors]
        roll, level, pressure = np.array(at) + noise_share * noise.standard_normal(3) * [
            2e-4, 0.0035, 100.0
        ]  # fmt: skip
        level *= gauges
        found = equation.update(sign * roll, level, pressure)
        found |= stuck.update(sign * roll, level, pressure, equation.slope_push)
        for finding in FINDINGS:
            if found & finding:
                first.setdefault(finding, k * STEP_S)
    return first


@pytest.mark.parametrize("share", [0.0, pytest.param(0.5, marks=BETWEEN), 1.0])
@pytest.mark.parametrize("w", [0.3, 0.5, 0.8])
@pytest.mark.parametrize("slope_rad", [0.01, 0.05])
@pytest.mark.parametrize("pressure_pa", [0.0, 20e3])
@pytest.mark.parametrize("thresholds", [THRESHOLDS, OF_HULL])
def test_no_sway_that_a_ship_may_have_is_a_fault(share, w, slope_rad, pressure_pa, thresholds):
    phasors = swaying(share, w, slope_rad, pressure_pa, effective=0.6)
    assert not found_in(UNSTATED, phasors, w, thresholds=thresholds)
    ship = replace(SHIP, sway_of_slope=share)
    assert not found_in(ship, phasors, w, thresholds=thresholds)


def test_without_the_term_a_swaying_ship_is_told_to_check_its_wiring():
    phasors = swaying(1.0, 0.3, 0.05, 0.0, effective=0.5)
    assert Finding.WATER_SIGN in found_in(SHIP, phasors, 0.3)
    assert not found_in(UNSTATED, phasors, 0.3)


@pytest.mark.parametrize("slope_rad", [0.02, 0.05])
@pytest.mark.parametrize("pressure_pa", [0.0, 20e3])
def test_the_most_sway_in_a_long_swell_without_noise_is_no_fault(slope_rad, pressure_pa):
    w = 2 * np.pi / 20.0
    phasors = swaying(1.0, w, slope_rad, pressure_pa, effective=0.5)
    assert not found_in(UNSTATED, phasors, w, noise_share=0.0)


@pytest.mark.parametrize(
    "share", [0.0, 0.5, 1.0, *(pytest.param(share, marks=BETWEEN) for share in (0.3, 0.7, 0.9))]
)
@pytest.mark.parametrize("w", [0.45, 0.6, 0.8])
@pytest.mark.parametrize("pressure_pa", [0.0, 10e3])
@pytest.mark.parametrize(("thresholds", "slope_rad"), [(THRESHOLDS, 0.03), (OF_HULL, 0.035)])
def test_reversed_motion_sensor_is_found_within_two_roll_periods(
    share, w, pressure_pa, thresholds, slope_rad
):
    phasors = swaying(share, w, slope_rad, pressure_pa, effective=0.7)
    found = found_in(UNSTATED, phasors, w, sign=-1.0, thresholds=thresholds)
    assert found[Finding.WATER_SIGN] <= 2 * T


def test_swapped_gauges_of_a_ship_that_sways_in_a_long_swell_are_not_called_stuck():
    phasors = swaying(1.0, 0.3, 0.035, 10e3, effective=0.7)
    found = found_in(UNSTATED, phasors, 0.3, gauges=-1.0)
    assert found[Finding.WATER_SIGN] < found[Finding.LEVEL_STUCK]


@pytest.mark.parametrize("times", [0.5, 0.7])
@pytest.mark.parametrize("pressure_pa", [0.0, -8e3, -20e3])
@pytest.mark.parametrize("thresholds", [THRESHOLDS, OF_HULL])
def test_no_sway_takes_from_the_gain_of_the_level_or_makes_the_motion_late(
    times, pressure_pa, thresholds
):
    """Both are told as they speak most for sound sensors: not below 1, and not above 0."""
    w = times * TANK.natural_frequency_rad_s
    phasors = swaying(1.0, w, 0.04, pressure_pa, effective=0.6)
    equation, told = TankEquation(UNSTATED, TANK, thresholds, STEP_S), 0
    for k in range(900):
        equation.update(*((each * cmath.exp(1j * w * k * STEP_S)).real for each in phasors))
        assert not equation.level_gain < 1.0
        assert not equation.late_s > 0.0
        told += equation.late_s == equation.late_s
    assert bool(told > 300) is (times > 0.5)  # so long a swell is taken for the heel of a turn


def wide_hull(share, w, slope_rad, pressure_pa):
    """Her roll moment per sway falls with the frequency: 0 at 1.65 w0, then of the other sign."""
    times = w / TANK.natural_frequency_rad_s
    return swaying(share, w, slope_rad, pressure_pa, effective=share * (0.9 - 0.33 * times**2))


RECORDED = json.loads((Path(__file__).parent / "data/swaying_ships.json").read_text())
"""Two ships of `tools.studies.ten_hulls` in their seas, sound sensors: the first 70 s of a record,
every 0.1 s, with their self-tuned laws in charge from 5 s on."""


def found_in_record(name, sign=1.0, start_s=0.0):
    """All that is found in a record of a ship from some time on, and the greatest doubt."""
    at = RECORDED[name]
    equation = TankEquation(
        RollShip(**at["ship"]), Tank(**at["tank"]), replace(OF_HULL, **at["thresholds"]), STEP_S
    )
    found, doubt = 0, 0.0
    signals = "roll_1e-4_rad", "level_mm", "pressure_100_pa"
    for roll, level, pressure in zip(
        *(at[each][round(start_s / STEP_S) :] for each in signals), strict=True
    ):
        found |= equation.update(sign * 1e-4 * roll, 1e-3 * level, 100.0 * pressure)
        doubt = max(doubt, equation.doubt) if equation.doubt == equation.doubt else doubt
    return found, doubt


@pytest.mark.parametrize("name", RECORDED)
def test_short_waves_that_sway_a_wide_hull_are_no_fault(name):
    found, doubt = found_in_record(name)
    assert not found
    assert doubt < 0.8
    assert found_in_record(name, sign=-1.0)[0] & Finding.WATER_SIGN


def test_the_first_part_of_a_wave_tells_less_than_all_of_it():
    """The worst start of twenty."""
    found, doubt = found_in_record("bulk carrier, 200 m", start_s=4.0)
    assert not found
    assert doubt < 0.8


@pytest.mark.parametrize("name", RECORDED)
def test_without_the_band_they_look_like_a_wrong_sign(name, monkeypatch):
    monkeypatch.setattr(tank_equation, "BAND", 40.0)
    monkeypatch.setattr(tank_equation, "NOTCH", 1e6)
    found, doubt = found_in_record(name)
    assert found & Finding.WATER_SIGN
    assert doubt > 1.5


@pytest.mark.parametrize("times", [0.8, 1.0, 1.1])
def test_reversed_motion_sensor_of_a_wide_hull_is_found(times):
    w = times * TANK.natural_frequency_rad_s
    found = found_in(UNSTATED, wide_hull(0.8, w, 0.04, 5e3), w, sign=-1.0, thresholds=OF_HULL)
    assert found[Finding.WATER_SIGN] <= 2 * T


@pytest.mark.parametrize(("ship", "stuck"), [(UNSTATED, False), (SHIP, True)])
def test_a_ship_held_still_while_sway_moves_the_water_is_not_stuck(ship, stuck):
    """The moment of the water holds her; with no sway nothing would explain the water."""
    w, slope_rad, share = TANK.natural_frequency_rad_s, 0.05, 0.8
    mass, damping, stiffness = coupled_matrices(SHIP, TANK)
    dynamics = stiffness - w**2 * mass + 1j * w * damping
    level = 0.2 * SHIP.stiffness_nm_rad * slope_rad / dynamics[0, 1]
    pressure = dynamics[1, 1] * level / TANK.reservoir_area_m2
    pressure += TANK.density_kg_m3 * TANK.width_m * share * G * slope_rad
    found = found_in(ship, (0j, level, pressure), w, thresholds=OF_HULL)
    assert (Finding.ROLL_STUCK in found) is stuck


def test_most_sway_is_that_of_long_waves_unless_the_ship_states_less():
    for ship, most in ((UNSTATED, 2.0), (SHIP, 0.0), (replace(SHIP, sway_of_slope=0.7), 1.4)):
        assert most_sway(ship) == pytest.approx(most)
