"""The tank's equation in a ship that sways, with a sound and with a reversed motion sensor."""

import cmath
from dataclasses import replace

import numpy as np
import pytest
from moving_ship import SHIP, TANK, THRESHOLDS

from utank_hil.dynamics.linear import coupled_matrices
from utank_hil.safety.monitors.finding import Finding
from utank_hil.safety.monitors.level_stuck import LevelStuck
from utank_hil.safety.monitors.sway import most_sway
from utank_hil.safety.monitors.tank_equation import TankEquation

STEP_S = 0.1
G = 9.80665
T = THRESHOLDS.tank_period_s
UNSTATED = replace(SHIP, sway_of_slope=None)


def swaying(share: float, w: float, slope_rad: float, pressure_pa: float, effective: float):
    """Roll and level in a regular wave of a slope, to which the sway is in phase."""
    mass, damping, stiffness = coupled_matrices(SHIP, TANK)
    area = TANK.reservoir_area_m2
    pressure = pressure_pa * cmath.exp(1.3j)
    moment = effective * SHIP.stiffness_nm_rad * slope_rad
    lateral = share * G * slope_rad
    force = area * pressure - TANK.density_kg_m3 * area * TANK.width_m * lateral
    q = np.linalg.solve(stiffness - w**2 * mass + 1j * w * damping, [moment, force])
    return (*q, pressure)


def found_in(
    ship, phasors, w: float, sign: float = 1.0, until_s: float = 120.0, noise_share: float = 1.0
):
    equation = TankEquation(ship, TANK, THRESHOLDS, STEP_S)
    stuck = LevelStuck(ship, TANK, THRESHOLDS, STEP_S)
    noise = np.random.default_rng(1)
    first: dict[Finding, float] = {}
    for k in range(round(until_s / STEP_S)):
        at = [(each * cmath.exp(1j * w * k * STEP_S)).real for each in phasors]
        roll, level, pressure = np.array(at) + noise_share * noise.standard_normal(3) * [
            2e-4, 0.0035, 100.0
        ]  # fmt: skip
        found = equation.update(sign * roll, level, pressure)
        found |= stuck.update(sign * roll, level, pressure, equation.slope_push)
        for finding in Finding if found else ():
            if found & finding:
                first.setdefault(finding, k * STEP_S)
    return first


@pytest.mark.parametrize("share", [0.0, 0.5, 1.0])
@pytest.mark.parametrize("w", [0.3, 0.5, 0.8])
@pytest.mark.parametrize("slope_rad", [0.01, 0.05])
@pytest.mark.parametrize("pressure_pa", [0.0, 20e3])
def test_no_sway_that_a_ship_may_have_is_a_fault(
    share: float, w: float, slope_rad: float, pressure_pa: float
) -> None:
    phasors = swaying(share, w, slope_rad, pressure_pa, effective=0.6)
    assert not found_in(UNSTATED, phasors, w)
    assert not found_in(replace(SHIP, sway_of_slope=share), phasors, w)


def test_without_the_term_a_swaying_ship_is_told_to_check_its_wiring() -> None:
    phasors = swaying(1.0, 0.3, 0.05, 0.0, effective=0.5)
    assert Finding.WATER_SIGN in found_in(SHIP, phasors, 0.3)
    assert not found_in(UNSTATED, phasors, 0.3)


@pytest.mark.parametrize("slope_rad", [0.02, 0.05])
@pytest.mark.parametrize("pressure_pa", [0.0, 20e3])
def test_the_most_sway_in_a_long_swell_without_noise_is_no_fault(
    slope_rad: float, pressure_pa: float
) -> None:
    w = 2 * np.pi / 20.0
    phasors = swaying(1.0, w, slope_rad, pressure_pa, effective=0.5)
    assert not found_in(UNSTATED, phasors, w, noise_share=0.0)


@pytest.mark.parametrize("share", [0.0, 0.3, 0.5, 0.7, 0.9, 1.0])
@pytest.mark.parametrize("w", [0.45, 0.6, 0.8])
@pytest.mark.parametrize("pressure_pa", [0.0, 10e3])
def test_reversed_motion_sensor_is_found_within_two_roll_periods(
    share: float, w: float, pressure_pa: float
) -> None:
    phasors = swaying(share, w, 0.03, pressure_pa, effective=0.7)
    found = found_in(UNSTATED, phasors, w, sign=-1.0)
    assert found[Finding.WATER_SIGN] <= 2 * T


def test_most_sway_is_that_of_long_waves_unless_the_ship_states_less() -> None:
    for ship, most in ((UNSTATED, 2.0), (SHIP, 0.0), (replace(SHIP, sway_of_slope=0.7), 1.4)):
        assert most_sway(ship) == pytest.approx(most)
