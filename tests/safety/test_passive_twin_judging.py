"""The comparison with the twin: its sums by their powers, its thresholds to the update."""

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import scipy.integrate
from hypothesis import given
from hypothesis import strategies as st

from utank_hil.configuration import Vessel, load_config
from utank_hil.dynamics.linear import coupled_matrices
from utank_hil.dynamics.ship import restoring
from utank_hil.safety.passive_twin import PassiveTwin

FIRST = load_config(Path("configs/ships/thesis_first.yaml"), Vessel)
PERIOD_S = 2 * math.pi / FIRST.tank.natural_frequency_rad_s
UPDATES = 62
"""In a roll period, of which a quarter is the patience: the sixteenth is more."""
STEP_S = PERIOD_S / UPDATES
SHARE = 1 / (6 * UPDATES)
RECORD_SHARE = 1 / (36 * UPDATES)


def twin_of(powers, record, least_rad=0.01):
    """A twin that remembers these mean squares of the ship's roll and its own, in rad^2."""
    twin = PassiveTwin(FIRST.ship, FIRST.tank, STEP_S, least_rad)
    assert (twin.roll_rad, twin.amplified) == (0.0, False)
    twin._unknown = 0.0
    twin._power, twin._twin_power = powers
    twin._record_power, twin._twin_record_power = record
    return twin


def judged(twin, times):
    """Judgements of mean squares that stay as they are."""
    found = []
    for _ in range(times):
        twin._judge()
        found.append(twin.amplified)
    return found


@pytest.mark.parametrize("mean_rad", [-0.2, 0.0, 0.3])
def test_mean_squares_are_of_six_periods_and_of_36_about_the_mean_of_six(mean_rad):
    twin = PassiveTwin(FIRST.ship, FIRST.tank, STEP_S, 0.01)
    mean = power = record = 0.0
    for k in range(8 * UPDATES):
        roll_rad = mean_rad + 0.05 * math.sin(0.1 * k)
        twin.update(roll_rad, 0.0, 0.0, 0.0)
        mean += (roll_rad - mean) * SHARE
        power += ((roll_rad - mean) ** 2 - power) * SHARE
        record += ((roll_rad - mean) ** 2 - record) * RECORD_SHARE
        assert twin.roll_rad == roll_rad
    assert twin.ship_rms_rad == pytest.approx(math.sqrt(power), rel=1e-9)
    assert twin.rms_rad == pytest.approx(math.sqrt(power), rel=1e-9)
    assert (twin._record_power, twin._twin_record_power) == pytest.approx((record, record))
    unknown = (1 - SHARE) ** (8 * UPDATES)
    assert twin.share == pytest.approx(1 / (1.25 + unknown))


@pytest.mark.parametrize(
    ("ratio", "record_ratio", "found"),
    [(1.26, 1.11, True), (1.24, 1.11, False), (1.26, 1.09, False), (1.24, 1.09, False)],
)
def test_a_law_has_lost_by_a_quarter_over_six_periods_and_a_tenth_over_36(
    ratio, record_ratio, found
):
    twin = twin_of(((0.1 * ratio) ** 2, 0.01), ((0.1 * record_ratio) ** 2, 0.01))
    assert twin.share == pytest.approx(min(ratio / 1.25, record_ratio / 1.1))
    # longer than a quarter of a period
    assert judged(twin, 18) == [False] * 15 + [found] * 3


@pytest.mark.parametrize(("ratio", "found"), [(1.61, True), (1.59, False)])
def test_over_six_periods_a_law_loses_by_sixty_percent_whatever_its_record(ratio, found):
    twin = twin_of(((0.1 * ratio) ** 2, 0.01), (0.002, 0.01))
    assert twin.share == pytest.approx(ratio / 1.6)
    assert judged(twin, 18) == [False] * 15 + [found] * 3


def test_once_found_it_is_over_at_a_twentieth_whatever_the_record():
    twin = twin_of((0.0256, 0.01), (0.0256, 0.01))
    assert judged(twin, 18)[-1]
    twin._record_power = 0.0
    twin._power = (0.1 * 1.06) ** 2
    assert judged(twin, 3) == [True] * 3
    twin._power = (0.1 * 1.04) ** 2
    assert judged(twin, 3) == [False] * 3
    # and the patience begins anew
    twin._power = twin._record_power = 0.0256
    assert judged(twin, 18) == [False] * 15 + [True] * 3


def test_at_the_start_twice_as_much_is_left_alone_and_less_from_period_to_period():
    twin = twin_of((0.01, 0.01), (0.01, 0.01))
    twin._forget()
    assert (twin.ship_rms_rad, twin.rms_rad, twin._record_power) == (0.0, 0.0, 0.0)
    for k in range(1, 200):
        twin._power, twin._twin_power = (0.1 * 1.7) ** 2, 0.01
        twin._record_power, twin._twin_record_power = 0.04, 0.01
        twin._judge()
        assert twin.share == pytest.approx(1.7 / (1.25 + (1 - SHARE) ** k))
    # 1 e^(-t / 6 periods) < 0.45, and then the patience
    first_s = next(k for k in range(1, 999) if (1 - SHARE) ** k < 0.45)
    found = judged(twin, 600)
    assert found.index(True) + 200 == first_s + 15


def test_at_the_start_as_much_more_than_sixty_percent_is_left_alone():
    twin = twin_of((0.0, 0.0), (0.0, 0.0))
    twin._forget()
    twin._power, twin._twin_power = (0.1 * 2.4) ** 2, 0.01
    found = judged(twin, 300)  # the record tells nothing against it
    # 1.6 + 1 e^(-t / 6 periods) < 2.4, and then the patience
    first = next(k for k in range(1, 999) if (1 - SHARE) ** k < 0.8)
    assert found.index(True) + 1 == first + 15


def test_little_roll_is_not_judged():
    for least_rad, found in ((0.0999, True), (0.1, False), (0.12, False)):
        twin = twin_of((0.1**2, 0.05**2), (0.1**2, 0.05**2), least_rad)
        assert math.isnan(twin.share) is not found
        assert judged(twin, 20)[-1] is found
    assert math.isnan(twin_of((0.01, 0.0), (0.01, 0.0)).share)


def test_roll_on_purpose_is_forgotten_after_six_periods_and_judged_after_two_more():
    twin = twin_of((0.04, 0.01), (0.04, 0.01))
    assert judged(twin, 20)[-1]
    twin.excuse()
    assert not twin.amplified
    assert math.isnan(twin.share)
    assert judged(twin, 6 * UPDATES - 2) == [False] * (6 * UPDATES - 2)
    assert twin.ship_rms_rad == pytest.approx(0.2)
    assert judged(twin, 3) == [False] * 3
    assert (twin.ship_rms_rad, twin.rms_rad) == (0.0, 0.0)
    assert (twin._record_power, twin._twin_record_power) == (0.0, 0.0)
    twin._power, twin._twin_power = 0.04, 0.01
    twin._record_power, twin._twin_record_power = 0.04, 0.01
    assert judged(twin, 2 * UPDATES - 3) == [False] * (2 * UPDATES - 3)
    assert math.isnan(twin.share)
    # 0.72 of the room at the beginning is left
    assert judged(twin, 20) == [False] * 18 + [True] * 2
    assert twin.share == pytest.approx(2.0 / (1.25 + math.exp(-1 / 3)), rel=0.02)


TABLE = replace(
    FIRST.ship,
    gz_m=tuple(0.8 * math.sin(0.15 * k) * (1 - (0.1 * k) ** 3) for k in range(7)),
    gz_step_rad=0.15,
    displacement_n=FIRST.ship.stiffness_nm_rad / 0.8,
)


def test_righting_moment_is_that_of_the_ship_piece_by_piece_and_beyond():
    """Beyond the angle of vanishing stability, too, where it capsizes her."""
    softening = replace(FIRST.ship, restoring_odd_nm=(-3e9,))
    assert restoring(softening).moment_nm(0.9) < 0
    for ship in (TABLE, replace(FIRST.ship, restoring_odd_nm=(-3e8, 2e8)), softening):
        twin = PassiveTwin(ship, FIRST.tank, STEP_S, 0.01)
        for roll_rad in (*np.linspace(-0.95, 0.95, 39), 0.15, 0.3, -0.45, 0.9):
            expected_nm = float(restoring(ship).moment_nm(roll_rad))
            found_nm = twin._righting_nm(float(roll_rad))
            assert found_nm == pytest.approx(expected_nm, rel=1e-9, abs=1e-3)


@given(st.floats(-0.5, 0.5), st.floats(-0.3, 0.3), st.floats(-0.3, 0.3), st.floats(-0.3, 0.3))
def test_the_moment_beside_the_linear_one_is_the_ships_less_the_twins(
    roll_rad, rate_rad_s, made_rad, made_rad_s
):
    for ship in (replace(TABLE, quadratic_damping_nms2_rad2=3e9), TABLE):
        twin = PassiveTwin(ship, FIRST.tank, STEP_S, 0.01)
        twin._made[:2] = made_rad, made_rad_s

        def beside(roll, rate, ship=ship):
            damping_nm = ship.quadratic_damping_nms2_rad2 * abs(rate) * rate
            righting_nm = float(restoring(ship).moment_nm(roll))
            return -damping_nm - righting_nm + ship.stiffness_nm_rad * roll

        expected_nm = beside(roll_rad, rate_rad_s)
        expected_nm -= beside(roll_rad - made_rad, rate_rad_s - made_rad_s)
        found_nm = twin._moment_beside_nm(roll_rad, rate_rad_s)
        assert found_nm == pytest.approx(expected_nm, rel=1e-9, abs=1.0)


@pytest.mark.parametrize("way", [-1, 1])
@pytest.mark.parametrize(
    "changes",
    [{}, {"quadratic_damping_nms2_rad2": 2e10}, {"restoring_odd_nm": (-1e9,)}],
    ids=["linear", "quadratic damping", "softening"],
)
def test_what_the_pump_has_made_obeys_the_equations_of_ship_and_tank(way, changes):
    """Beside an ordinary solver, for a ship held at a heel in a steady flow of her water."""
    ship, tank = replace(FIRST.ship, **changes), replace(FIRST.tank, quadratic_loss=2.0)
    roll_rad, rate_rad_s, level_rate_m_s, pressure_pa = 0.2 * way, 0.15, 0.6 * way, 30e3
    mass, damping, stiffness = coupled_matrices(ship, tank)
    odd = (*ship.restoring_odd_nm, 0.0)[0]
    loss = tank.reservoir_area_m2 * tank.quadratic_loss_pa_per_m2_s2

    def slopes(_, d):
        made_rad, _, made_rad_s, made_m_s = d

        def beside(roll, rate, level_rate):
            moment_nm = -ship.quadratic_damping_nms2_rad2 * abs(rate) * rate - odd * roll**3
            return np.array([moment_nm, -loss * abs(level_rate) * level_rate])

        effort = beside(roll_rad, rate_rad_s, level_rate_m_s)
        effort -= beside(roll_rad - made_rad, rate_rad_s - made_rad_s, level_rate_m_s - made_m_s)
        effort[1] += tank.reservoir_area_m2 * pressure_pa
        effort -= damping @ d[2:] + stiffness @ d[:2]
        return np.concatenate([d[2:], np.linalg.solve(mass, effort)])

    step_s = 0.01
    twin = PassiveTwin(ship, tank, step_s, 0.01)
    rolls = []
    for _ in range(800):
        twin.update(roll_rad, rate_rad_s, level_rate_m_s, pressure_pa)
        rolls.append(roll_rad - twin.roll_rad)
    times_s = step_s * np.arange(1, 801)
    made = scipy.integrate.solve_ivp(slopes, (0, 8.0), np.zeros(4), t_eval=times_s, rtol=1e-8)
    assert np.abs(np.array(rolls) - made.y[0]).max() < 0.01 * np.abs(made.y[0]).max()


def test_a_ship_that_is_taken_over_has_nothing_of_the_other_ones_losses():
    lossy = replace(FIRST.ship, quadratic_damping_nms2_rad2=2e10)
    twin = PassiveTwin(lossy, replace(FIRST.tank, quadratic_loss=2.0), STEP_S, 0.01)
    twin._made[:4] = 0.1
    twin.update(0.2, 0.15, 0.6, 0.0)
    assert (twin._effort[1:] != 0.0).all()
    twin.take(FIRST.ship, replace(FIRST.tank, quadratic_loss=0.0))
    twin._made[:4] = 0.0  # of a pump that has done nothing
    twin.update(0.2, 0.15, 0.6, 0.0)
    assert twin.roll_rad == 0.2
