"""Gains of the tank's equation that are known beforehand: from water made with them by phasors."""

import cmath
import math
from dataclasses import replace

import pytest
from moving_ship import SHIP, TANK, THRESHOLDS

from utank_hil.safety.monitors.finding import Finding
from utank_hil.safety.monitors.tank_equation import DerivativeFilter, TankEquation

STEP_S = 0.05
G = 9.80665
W = 0.7
LENGTH_M = 2 * TANK.height_m + TANK.width_m * TANK.reservoir_area_m2 / TANK.duct_area_m2
W0 = math.sqrt(2 * G / LENGTH_M)
PUSH = G * TANK.width_m - TANK.width_m * (TANK.height_m + TANK.lz_m) * W**2
ANSWER = LENGTH_M * (W0**2 - W**2 + 2j * TANK.damping_ratio * W0 * W)
LEAST = 0.25
FILTERED = 1 / (1 + (W / (2 * W0)) ** 2)
"""What the filters leave of an amplitude at W."""
EXACT = replace(
    THRESHOLDS, zero_push_m2_s2=0.0, least_roll_push_m2_s2=LEAST, least_pump_push_m2_s2=LEAST,
    level_still_m=1e-3,
)  # fmt: skip


def equation_of(x, p, gain_x=1.0, gain_p=1.0, *, valve=False, held=0.0):
    """After a minute in which roll and pump push the water by `x` and `p` times their gains.

    Pushes are phasors at W, in m^2/s^2, as root mean squares behind the filters. A valve holds
    back a share `held` of `p`.
    """
    equation = TankEquation(SHIP, TANK, EXACT, STEP_S, valve=valve)
    x, p = x / FILTERED, p / FILTERED
    phasors = x / PUSH, (gain_x * x + gain_p * p) / ANSWER, p * TANK.density_kg_m3
    found = 0
    for k in range(1200):
        turn = math.sqrt(2) * cmath.exp(1j * W * k * STEP_S)
        roll_rad, level_m, pressure_pa = ((each * turn).real for each in phasors)
        found = equation.update(roll_rad, level_m, pressure_pa, held_pa=held * pressure_pa)
    return equation, found


@pytest.mark.parametrize(
    ("valve", "gain", "found"),
    [(False, 1.0, 0), (False, -0.23, 0), (False, -0.27, 1), (False, -1.0, 1),
     (True, -0.48, 0), (True, -0.52, 1)],
)  # fmt: skip
def test_a_gain_of_roll_or_pump_is_found_and_judged_by_its_sign(valve, gain, found):
    """The other push is three times as large, so that the level's own gain is sound."""
    _, said = equation_of(3.0, 9j, gain_x=gain, valve=valve)
    assert said & ~Finding.MOTION_LATE == found * Finding.WATER_SIGN
    _, said = equation_of(9j, 3.0, gain_p=gain, valve=valve)
    assert said & ~Finding.MOTION_LATE == found * Finding.PUMP_SIGN


@pytest.mark.parametrize(
    ("gain", "found"),
    [(1.0, 0), (0.32, 0), (0.28, Finding.LEVEL_STUCK), (-0.23, Finding.LEVEL_STUCK),
     (-0.27, Finding.WATER_SIGN)],
)  # fmt: skip
def test_the_level_has_a_gain_where_only_both_pushes_together_are_large_enough(gain, found):
    equation, said = equation_of(0.8 * LEAST, 0.8 * LEAST, gain, gain)
    assert equation.level_gain == pytest.approx(gain, abs=0.015)
    assert said == found


@pytest.mark.parametrize(
    ("valve", "held", "share", "pumps"),
    [(False, 0.0, 0.06, 0.06), (True, 1.0, 0.306, 0.2), (True, 0.5, 0.162, 0.2),
     (True, 0.0, 0.06, 0.2)],
)  # fmt: skip
def test_a_push_that_is_small_in_itself_or_beside_the_other_tells_nothing(
    valve, held, share, pumps
):
    """The sums swell and ebb by a fifth: what is far enough above or below is as said."""
    for times, told in ((0.75, False), (1.35, True)):
        small, large = times * LEAST, 60j * LEAST
        for x, p, gain_x, gain_p, sign in (
            (small, 0.0, -1.0, 1.0, Finding.WATER_SIGN),
            (0.0, small, 1.0, -1.0, Finding.PUMP_SIGN),
            (share * 60 * small, large, -1.0, 1.0, Finding.WATER_SIGN),
            (large, pumps * 60 * small, 1.0, -1.0, Finding.PUMP_SIGN),
        ):
            _, said = equation_of(x, p, gain_x, gain_p, valve=valve, held=held)
            assert bool(said & sign) is told, (sign, times)


@pytest.mark.parametrize("frequency_rad_s", [0.3, 1.2, 3.0])
def test_the_filter_has_two_poles_and_both_derivatives(frequency_rad_s):
    w, step_s = frequency_rad_s, 0.01
    once = DerivativeFilter(1.2, step_s)
    out = 1 / (1 + 1j * w / 1.2) ** 2
    for k in range(3000):
        turn = cmath.exp(1j * w * k * step_s)
        bend = once.update(turn.real)
    assert once.value == pytest.approx((out * turn).real, abs=1e-4)
    assert once.rate == pytest.approx((1j * w * out * turn).real, abs=3e-4)
    assert bend == pytest.approx((-(w**2) * out * turn).real, abs=1e-3)


def test_the_filter_begins_at_rest_and_follows_a_straight_line_two_time_constants_late():
    begun = DerivativeFilter(2.0, 0.5)
    begun.update(9.0)
    begun.start(5.0)
    for _ in range(3):
        assert begun.update(5.0) == pytest.approx(0.0, abs=1e-12)
        assert (begun.value, begun.rate) == pytest.approx((5.0, 0.0), abs=1e-12)
    for k in range(1, 8):
        bend = begun.update(5.0 + 3.0 * 0.5 * k)
        # of 1 / (s / w + 1)^2 to a ramp of 3: the transient is e^-wt (2 / w + t)
        t, fades = 0.5 * k, math.exp(-2.0 * 0.5 * k)
        assert begun.value == pytest.approx(5.0 + 3.0 * (t - 1.0 + fades * (1.0 + t)))
        assert begun.rate == pytest.approx(3.0 * (1 - fades * (1 + 2.0 * t)))
        assert bend == pytest.approx(3.0 * fades * 4.0 * t)
