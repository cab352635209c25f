"""A level that stands still, against the tank's equation solved by another way."""

import math
from dataclasses import replace

import numpy as np
import pytest
from moving_ship import SHIP, TANK
from moving_ship import THRESHOLDS as OF_SHIP
from scipy.integrate import solve_ivp

from utank_hil.safety.monitors.finding import Finding
from utank_hil.safety.monitors.level_stuck import LevelStuck

STEP_S = 0.01
G = 9.80665
TUBE = replace(TANK, damping_ratio=0.2, density_kg_m3=1025.0)
LENGTH_M = 2 * TUBE.height_m + TUBE.width_m * TUBE.reservoir_area_m2 / TUBE.duct_area_m2
W0 = math.sqrt(2 * G / LENGTH_M)
BAND_M = 0.125
PERMITTED_M = 16 * BAND_M
THRESHOLDS = replace(OF_SHIP, level_still_m=BAND_M, steady_push_m2_s2=0.0)


def monitor(steady_push_m2_s2=0.0):
    thresholds = replace(THRESHOLDS, steady_push_m2_s2=steady_push_m2_s2)
    return LevelStuck(SHIP, TUBE, thresholds, STEP_S)


def found_at_s(roll_rad, level_m, pressure_pa, until_s, steady_push_m2_s2=0.0):
    stuck = monitor(steady_push_m2_s2)
    for k in range(round(until_s / STEP_S)):
        if stuck.update(roll_rad(k * STEP_S), level_m, pressure_pa, 0.0):
            return k * STEP_S
    return None


@pytest.mark.parametrize(
    ("roll_rad", "level_m", "pressure_pa"),
    [
        (lambda _: 0.0, 0.0, 60e3),
        (lambda _: 0.0, 0.0, -60e3),
        (lambda _: 0.0, 1.5, 0.0),
        (lambda _: 0.0, -2.5, 20e3),
        (lambda _: 0.19, 0.0, 0.0),  # a mean that it becomes only in the course of a period
        (lambda t: 0.15 * math.sin(W0 * t), 0.0, 0.0),
        (lambda t: 0.15 - 0.15 * math.cos(0.8 * t), -0.5, 10e3),
    ],
)
def test_it_is_found_when_the_free_water_would_have_moved_sixteen_bands(
    roll_rad, level_m, pressure_pa
):
    steady = G * TUBE.width_m
    swinging = steady - TUBE.width_m * (TUBE.height_m + TUBE.lz_m) * W0**2

    def slopes(t, state):
        level, rate, mean_rad = state
        push = swinging * (roll_rad(t) - mean_rad) + steady * mean_rad + pressure_pa / 1025.0
        acceleration = push / LENGTH_M - 2 * 0.2 * W0 * rate - W0**2 * level
        return rate, acceleration, (roll_rad(t) - mean_rad) * W0 / (2 * math.pi)

    times_s = np.arange(0.0, 40.0, STEP_S)
    level = solve_ivp(slopes, (0, 40), (level_m, 0.0, 0.0), t_eval=times_s, rtol=1e-6).y[0]
    moved_s = times_s[np.argmax(abs(level - level_m) > PERMITTED_M)]
    assert moved_s > 1.0
    found_s = found_at_s(roll_rad, level_m, pressure_pa, 40.0)
    assert found_s == pytest.approx(moved_s, abs=0.02)


@pytest.mark.parametrize("steady_push_m2_s2", [5.0, 15.0, 1e3])
@pytest.mark.parametrize(("swing_pa", "pressure_pa"), [(60e3, 0.0), (60e3, 30e3), (0.0, 60e3)])
def test_no_constant_push_may_explain_it(steady_push_m2_s2, swing_pa, pressure_pa):
    """The first time at which none of a thousand pushes has held the water still until then."""
    times_s = np.arange(0.0, 30.0, STEP_S)

    def moved_m(push_m2_s2):
        def slopes(t, state):
            return state[1], push_m2_s2(t) / LENGTH_M - 2 * 0.2 * W0 * state[1] - W0**2 * state[0]

        return solve_ivp(slopes, (0, 30), (0.0, 0.0), t_eval=times_s, rtol=1e-8).y[0]

    pushed_m = moved_m(lambda t: (pressure_pa + swing_pa * math.sin(0.9 * W0 * t)) / 1025.0)
    pushes = np.linspace(-1, 1, 1001) * steady_push_m2_s2
    furthest_m = np.maximum.accumulate(
        abs(pushed_m + pushes[:, None] * moved_m(lambda _: 1.0)), axis=1
    )
    held = (furthest_m <= PERMITTED_M).any(axis=0)
    stuck = monitor(steady_push_m2_s2)
    found_s = [
        time_s
        for k, time_s in enumerate(times_s)
        if stuck.update(
            0.0, 1e-4 * (k % 2), pressure_pa + swing_pa * math.sin(0.9 * W0 * time_s), 0.0
        )
    ]
    if held.all():
        assert (swing_pa, found_s) == (0.0, [])  # a pump that presses evenly may be held by a turn
    else:
        assert found_s[0] == pytest.approx(times_s[np.argmin(held)], abs=0.05)


@pytest.mark.parametrize("period_s", [3.0, 10.0])
def test_water_without_loss_is_held_by_a_turn_for_as_long_as_it_takes(period_s):
    """After a whole swing it is where it began, whatever pushed it."""
    height_m = G * (period_s / (2 * math.pi)) ** 2 - TUBE.width_m / 2
    tube = replace(
        TUBE, height_m=max(height_m, 0.2), width_m=min(TUBE.width_m, 4.0), damping_ratio=0.0,
        duct_area_m2=TUBE.reservoir_area_m2,
    )  # fmt: skip
    stuck = LevelStuck(SHIP, tube, replace(THRESHOLDS, steady_push_m2_s2=50.0), 0.1)
    found = [stuck.update(0.0, 1e-4 * (k % 2), 40e3, 0.0) for k in range(600)]
    assert not any(found)


def test_a_level_that_repeats_itself_is_stuck_though_a_turn_might_hold_the_water():
    """For a fifth of the period at least, and a second; what moves its last digit is alive."""
    alone_s = found_at_s(lambda _: 0.0, 0.0, 60e3, 20.0)
    assert alone_s > 0.2 * 2 * math.pi / W0
    assert found_at_s(lambda _: 0.0, 0.0, 60e3, 20.0, 1e3) == alone_s
    live, found = monitor(1e3), 0
    for k in range(2000):
        found |= live.update(0.0, 1e-4 * (k % 50 == 0), 60e3, 0.0)
    assert not found


@pytest.mark.parametrize("way", [-1, 1])
@pytest.mark.parametrize("share", [0.2, 0.45, 0.8, 2.3, -0.5])
def test_it_has_to_have_moved_whatever_share_of_the_slope_the_sway_has_taken(way, share):
    """Of a slope that pushes for a quarter period and by `share` of what the pump does."""
    pressure_pa, most_sway = way * 60e3, 2.0
    slope_push = share * pressure_pa / 1025.0 / most_sway
    ends_s = math.pi / 2 / W0

    def slopes(t, state):
        level, rate, swayed, sway_rate = state
        pushes = pressure_pa / 1025.0, slope_push if t < ends_s else 0.0
        spring = 2 * 0.2 * W0 * np.array([rate, sway_rate]) + W0**2 * np.array([level, swayed])
        level_m_s2, sway_m_s2 = np.array(pushes) / LENGTH_M - spring
        return rate, level_m_s2, sway_rate, sway_m_s2

    times_s = np.arange(0.0, 40.0, STEP_S)
    solved = solve_ivp(slopes, (0, 40), [0.0] * 4, t_eval=times_s, rtol=1e-6, max_step=0.05).y
    with_sway = solved[0] - most_sway * solved[2]
    stuck = np.minimum(way * solved[0], way * with_sway) > PERMITTED_M
    monitor = LevelStuck(replace(SHIP, sway_of_slope=1.0), TUBE, THRESHOLDS, STEP_S)
    for _ in range(300):  # where it stood before, and what was taken there, says nothing
        monitor.update(0.0, 2 * BAND_M, 0.0, -way * 3.0)
    found_s = next(
        time_s
        for time_s in times_s
        if monitor.update(0.0, 0.0, pressure_pa, slope_push if time_s < ends_s else 0.0)
    )
    assert found_s == pytest.approx(times_s[np.argmax(stuck)], abs=0.03)


@pytest.mark.parametrize("level_m", [0.0, math.pi, -2.5])
def test_the_first_sample_only_says_where_the_level_stands(level_m):
    assert monitor().update(0.0, level_m, 1e12, 0.0) == 0


@pytest.mark.parametrize("way", [-1, 1])
def test_a_push_that_carries_the_water_not_quite_so_far_is_left_alone(way):
    """At rest at first, it overshoots once: by exp(-pi z / sqrt(1 - z^2)) of the way."""
    overshoot = math.exp(-math.pi * 0.2 / math.sqrt(1 - 0.2**2))
    least_pa = PERMITTED_M * 2 * 1025.0 * G / (1 + overshoot)
    assert found_at_s(lambda _: 0.0, 0.0, way * 0.98 * least_pa, 60.0) is None
    found_s = found_at_s(lambda _: 0.0, 0.0, way * 1.02 * least_pa, 60.0)
    assert found_s == pytest.approx(math.pi / (W0 * math.sqrt(1 - 0.2**2)), rel=0.15)


@pytest.mark.parametrize(("away_m", "still"), [(BAND_M, True), (1.01 * BAND_M, False)])
def test_a_level_that_stays_within_the_band_stands_still(away_m, still):
    stuck = monitor()
    found = 0
    for k in range(1000):
        found |= stuck.update(0.0, away_m * (k % 2), 60e3, 0.0)
    assert found == (Finding.LEVEL_STUCK if still else 0)


def test_what_the_water_should_have_done_before_it_moved_does_not_count():
    stuck = monitor()
    alone_s = found_at_s(lambda _: 0.0, 0.0, 60e3, 20.0)
    assert alone_s is not None
    steps = round(alone_s / STEP_S)
    for level_m in (0.0, 0.2, 0.0):
        found = [stuck.update(0.0, level_m, 60e3, 0.0) for _ in range(steps)]
        assert found == [0] * steps
    assert stuck.update(0.0, 0.0, 60e3, 0.0)
    stuck.restart()
    found = [stuck.update(0.0, 0.0, 60e3, 0.0) for _ in range(steps + 1)]
    assert found == [0] * steps + [Finding.LEVEL_STUCK]
