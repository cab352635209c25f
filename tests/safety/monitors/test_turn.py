"""A ship that turns hard: the water feels an acceleration to the side that no sensor measures."""

import math

import numpy as np
import pytest
from moving_ship import FINDINGS, SHIP, TANK, THRESHOLDS
from scipy.integrate import solve_ivp

from utank_hil.dynamics.linear import coupled_matrices
from utank_hil.safety.monitors.finding import Finding
from utank_hil.safety.monitors.level_stuck import LevelStuck
from utank_hil.safety.monitors.tank_equation import TankEquation

STEP_S = 0.1
G = 9.80665
T = THRESHOLDS.tank_period_s
TURNS_S, STRAIGHT_S, END_S = 40.0, 100.0, 160.0
BUILDS_UP_S = 10.0


def inward_m_s2(t, hardest_m_s2):
    """To starboard."""
    share = min(max((t - TURNS_S) / BUILDS_UP_S, 0), max((STRAIGHT_S - t) / BUILDS_UP_S, 0), 1)
    return hardest_m_s2 * share


def sailed(seed, hardest_m_s2, lever_m, wave_heel_deg, law):
    """Roll, level and pressure each 0.1 s of a ship in irregular waves around her roll period."""
    mass, damping, stiffness = coupled_matrices(SHIP, TANK)
    random = np.random.default_rng(seed)
    waves_rad_s = TANK.natural_frequency_rad_s * random.uniform(0.7, 1.4, 20)
    phases = random.uniform(0, 2 * math.pi, 20)
    heel_rad = math.radians(wave_heel_deg) / math.sqrt(10)
    area_kg_m = TANK.density_kg_m3 * TANK.reservoir_area_m2
    # stiffness over the metacentric height of a ship of that mass: 1 m
    ships_n = SHIP.stiffness_nm_rad / G

    def pressure_pa(state):
        roll, level, roll_rate, _ = state
        return float(np.clip(law[0] * roll + law[1] * roll_rate + law[2] * level, -40e3, 40e3))

    def slopes(t, state):
        waves = SHIP.stiffness_nm_rad * heel_rad * np.cos(waves_rad_s * t + phases).sum()
        inward = inward_m_s2(t, hardest_m_s2)
        push = pressure_pa(state) / TANK.density_kg_m3 - TANK.width_m * inward
        forces = np.array([waves - ships_n * lever_m * inward, area_kg_m * push])
        at, rates = state[:2], state[2:]
        return [*rates, *np.linalg.solve(mass, forces - damping @ rates - stiffness @ at)]

    times_s = np.arange(0.0, END_S, STEP_S)
    states = solve_ivp(slopes, (0, END_S), [0.0] * 4, t_eval=times_s, rtol=1e-6, max_step=0.5).y.T
    noise = random.standard_normal((len(times_s), 3)) * [2e-4, 0.005 / math.sqrt(2), 100.0]
    return np.column_stack([states[:, :2], [pressure_pa(each) for each in states]]) + noise


def found_in(record, from_s=0.0):
    """When each finding came, since `from_s`."""
    equation = TankEquation(SHIP, TANK, THRESHOLDS, STEP_S)
    stuck = LevelStuck(SHIP, TANK, THRESHOLDS, STEP_S)
    first = {}
    for k, sample in enumerate(record.tolist()):
        found = equation.update(*sample) | stuck.update(*sample, equation.slope_push)
        for finding in FINDINGS:
            if found & finding:
                first.setdefault(finding, k * STEP_S - from_s)
    return first


LAWS = {
    "no pump": (0.0, 0.0, 0.0),
    "damps": (0.0, -150e3, 0.0),
    "holds": (-100e3, -100e3, 0.0),
    "moves water": (50e3, -100e3, -3e3),
}
HARDEST_M_S2 = 0.45


@pytest.mark.parametrize("law", LAWS)
@pytest.mark.parametrize("lever_m", [-1.0, 2.0, 4.0])
@pytest.mark.parametrize("wave_heel_deg", [0.2, 1.0, 3.0])
def test_a_hard_turn_of_a_sound_ship_is_no_fault(law, lever_m, wave_heel_deg):
    for seed, way in ((1, 1.0), (2, -1.0), (3, 0.7)):
        record = sailed(seed, way * HARDEST_M_S2, lever_m, wave_heel_deg, LAWS[law])
        assert not found_in(record)


@pytest.mark.parametrize("law", ["no pump", "damps"])
@pytest.mark.parametrize(("column", "finding"), [(0, Finding.WATER_SIGN), (1, Finding.WATER_SIGN)])
def test_a_wrong_sign_is_found_in_a_turn_as_well(law, column, finding):
    for seed in range(4):
        record = sailed(seed, HARDEST_M_S2, 2.0, 2.0, LAWS[law])
        record[round(TURNS_S / STEP_S) :, column] *= -1
        assert found_in(record, TURNS_S)[finding] <= 2 * T


@pytest.mark.parametrize("law", ["no pump", "damps"])
def test_a_level_that_stands_still_is_found_in_a_turn_as_well(law):
    for seed in range(4):
        record = sailed(seed, HARDEST_M_S2, 2.0, 2.0, LAWS[law])
        at = round((TURNS_S + 20) / STEP_S)
        record[at:, 1] = record[at, 1]
        assert found_in(record, TURNS_S + 20)[Finding.LEVEL_STUCK] <= T
