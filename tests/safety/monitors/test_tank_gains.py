"""Gains of the tank's equation that are known beforehand: from water made with them by phasors."""

import cmath
import math
from dataclasses import replace

import pytest
from moving_ship import SHIP, TANK, THRESHOLDS

from utank_hil.dynamics.linear import coupled_matrices
from utank_hil.safety.monitors.finding import Finding
from utank_hil.safety.monitors.tank_equation import (
    Band,
    DerivativeFilter,
    TankEquation,
    roll_push_at_natural_frequency,
)

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
    THRESHOLDS, zero_push_m2_s2=0.0, steady_push_m2_s2=0.0, least_roll_push_m2_s2=LEAST,
    least_pump_push_m2_s2=LEAST, level_still_m=1e-3,
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
    for gains, sign in (
        ((3.0, 9j, gain, 1.0), Finding.WATER_SIGN), ((9j, 3.0, 1.0, gain), Finding.PUMP_SIGN)
    ):  # fmt: skip
        equation, said = equation_of(*gains, valve=valve)
        assert said & ~Finding.MOTION_LATE == found * sign
        assert (equation.doubt > 1) is bool(found)


@pytest.mark.parametrize(
    ("valve", "gain", "obeys"),
    [(False, 1.0, True), (False, 0.27, True), (False, 0.23, False), (False, -1.0, False),
     (True, 0.52, True), (True, 0.48, False)],
)  # fmt: skip
def test_water_obeys_a_roll_by_as_far_as_it_would_contradict_one_of_the_wrong_sign(
    valve, gain, obeys
):
    assert equation_of(3.0, 0.0, gain, valve=valve)[0].obeyed is obeys


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


def test_a_roll_at_w0_pushes_by_gravity_less_what_the_water_is_carried_along():
    """Thesis (2.19): g L - L (H + Lz) w0^2 per roll."""
    due = G * TANK.width_m - TANK.width_m * (TANK.height_m + TANK.lz_m) * W0**2
    assert roll_push_at_natural_frequency(SHIP, TANK) == pytest.approx(due)


def test_the_band_begins_at_rest_lets_w0_pass_and_nothing_of_twice_that():
    w, step_s = 0.9, 0.05
    band = Band(w, step_s, 2)
    for value in (5.0, -3.0):
        assert [band.update((value, 2 * value)) for _ in range(50)] == [
            pytest.approx([value, 2 * value]) for _ in range(50)
        ]
        band.begun = False
    for times, gain in ((1.0, 0.75 / abs(1 - 1 / 1.3**2 + 1j / 1.3)), (2.0, 0.0)):
        band.begun = False
        found = [band.update((math.sin(times * w * step_s * k), 0.0)) for k in range(3000)]
        most = max(each[0] for each in found[-500:])
        assert most == pytest.approx(gain, abs=5e-3)
        assert {each[1] for each in found} == {0.0}


@pytest.mark.parametrize("of_hull", [False, True])
@pytest.mark.parametrize("valve", [False, True])
def test_after_a_restart_it_is_as_a_new_one(of_hull, valve):
    """Whatever it saw before, a heel and a level that stand still among that."""
    thresholds = replace(THRESHOLDS, of_hull=of_hull)
    used, fresh = (TankEquation(SHIP, TANK, thresholds, STEP_S, valve=valve) for _ in range(2))
    for k in range(900):
        used.update(0.2 + 0.1 * math.sin(W * k * STEP_S), 1.0, 9e3, held_pa=-7e3)
    used.restart()
    names = "doubt", "level_gain", "late_s", "obeyed", "water_moves", "slope_push", "settled"
    for k in range(1200):
        now = 0.1 * math.sin(W * k * STEP_S), 0.4 * math.cos(W * k * STEP_S), 3e3
        found = [each.update(*now, held_pa=1e3) for each in (used, fresh)]
        assert found[0] == found[1]
        for name in names:
            assert getattr(used, name) == pytest.approx(getattr(fresh, name), nan_ok=True)


@pytest.mark.parametrize(("of_hull", "settled", "memory"), [(False, 6.0, 0.4), (True, 8.5, 0.44)])
def test_it_says_nothing_until_a_quarter_of_its_memory_has_filled(of_hull, settled, memory):
    """After its filters have settled; a memory of tau holds 1 - exp(-t / tau)."""
    equation = TankEquation(SHIP, TANK, replace(EXACT, of_hull=of_hull), STEP_S)
    first = found = 0
    while equation.level_gain != equation.level_gain:
        assert found == 0
        found = equation.update(
            0.1 * math.sin(W * first * STEP_S), 0.4 * math.cos(W * first * STEP_S), 0.0
        )
        first += 1
    wait_s = settled / (2 * W0) + math.log(4 / 3) * memory * EXACT.tank_period_s
    assert first * STEP_S == pytest.approx(wait_s, abs=3 * STEP_S)
    assert equation.settled


def test_a_roll_that_is_still_is_found_after_a_quarter_of_a_period():
    equation = TankEquation(SHIP, TANK, THRESHOLDS, STEP_S)
    found_s = next(
        k * STEP_S
        for k in range(2000)
        if equation.update(0.0, math.cos(W0 * k * STEP_S), 30e3 * math.sin(W0 * k * STEP_S))
        & Finding.ROLL_STUCK
    )
    wait_s = 6.0 / (2 * W0) + 0.25 * THRESHOLDS.tank_period_s
    assert found_s == pytest.approx(wait_s, abs=3 * STEP_S)


@pytest.mark.parametrize(("share", "moves"), [(0.95, False), (1.05, True)])
def test_water_moves_as_one_that_swings_at_w0_by_more_than_the_gauges_noise(share, moves):
    """The filters leave 1 / (1 + 1/4) of what swings at w0."""
    equation = TankEquation(SHIP, TANK, THRESHOLDS, STEP_S)
    still_m = THRESHOLDS.level_still_m * share * 1.25
    seen = {-1: False, 1: False}
    for k in range(1200):
        equation.update(0.0, still_m * math.sin(W0 * k * STEP_S), 0.0)
        if k > 600:
            seen[1 if math.cos(W0 * k * STEP_S - 2 * math.atan(0.5)) > 0 else -1] |= (
                equation.water_moves
            )
    assert seen == {-1: moves, 1: moves}


def test_the_slope_push_is_that_of_roll_and_level_together():
    roll, level = 0.1 + 0j, 0.3j
    mass, damping, stiffness = (each[0] for each in coupled_matrices(SHIP, TANK))
    still = replace(SHIP, quadratic_damping_nms2_rad2=0.0)
    equation = TankEquation(still, TANK, THRESHOLDS, STEP_S)
    moment = sum(
        (s - W * W * m + 1j * W * d) * each
        for m, d, s, each in zip(mass, damping, stiffness, (roll, level), strict=True)
    )
    tau_s = 3 * 2 * math.pi / W0  # of the mean that is taken off
    due = abs(G * TANK.width_m / SHIP.stiffness_nm_rad * FILTERED * moment)
    due *= W * tau_s / math.hypot(1.0, W * tau_s)
    most = 0.0
    for k in range(4000):
        turn = cmath.exp(1j * W * k * STEP_S)
        equation.update((roll * turn).real, (level * turn).real, 0.0)
        most = max(most, abs(equation.slope_push)) if k > 3000 else 0.0
    assert most == pytest.approx(due, rel=0.02)


@pytest.mark.parametrize("side", [1.0, -1.0])
@pytest.mark.parametrize(("share", "judged"), [(0.88, True), (0.92, False)])
def test_a_level_over_nine_tenths_of_the_tank_is_not_judged_on_either_side(side, share, judged):
    equation = TankEquation(SHIP, TANK, THRESHOLDS, STEP_S)
    for _ in range(600):
        equation.update(0.0, 0.0, 0.0)
    assert equation.settled
    equation.update(0.0, side * share * TANK.level_limit_m, 0.0)
    assert equation.settled == judged


@pytest.mark.parametrize(("of_hull", "left"), [(False, 0.5), (True, 1.0)])
def test_errors_of_the_model_may_leave_half_a_push_and_of_a_hull_with_the_band_all_of_it(
    of_hull, left
):
    """A fifth more is one fifth over the threshold, if the true sign leaves far less."""
    equation = TankEquation(SHIP, TANK, replace(EXACT, of_hull=of_hull), STEP_S)
    for push in (0.5, 3.0):
        worse = 1.2 * (left * push) ** 2
        assert equation._excess(worse, worse / 4, push * push, 0.0) == pytest.approx(1.2)


@pytest.mark.parametrize(("of_hull", "per_share"), [(False, 0.0), (True, 0.1)])
def test_a_share_of_sway_that_is_not_constant_leaves_three_tenths_of_the_slopes_push(
    of_hull, per_share
):
    """And of a hull, whose sway is known less well around w0, a tenth of the share besides."""
    sways = replace(SHIP, sway_of_slope=None)  # by up to all of the slope
    equation = TankEquation(sways, TANK, replace(EXACT, of_hull=of_hull), STEP_S)
    for k in range(2400):
        roll_rad = 0.1 * math.sin(W / 2 * k * STEP_S)
        equation.update(roll_rad, 0.1 * roll_rad, 0.0)
    share = equation._sound.share
    assert share > 0.3
    assert equation._of_sway == pytest.approx(0.3 + per_share * share)


def test_a_level_that_stands_at_a_crest_has_a_sign_for_a_tenth_of_a_period():
    equation, found = equation_of(3.0, 0.0, -1.0)
    assert found & Finding.WATER_SIGN
    roll_rad, level_m = equation._roll.last, equation._level.last
    told = [equation.update(roll_rad, level_m, 0.0) & Finding.WATER_SIGN > 0 for _ in range(40)]
    stands = 0.1 * EXACT.tank_period_s / STEP_S
    assert all(told[: round(0.75 * stands)])  # its stop leaves less of the sign as well
    assert not any(told[round(stands) + 2 :])


def test_a_sign_counts_by_half_of_a_memory_that_is_full_by_a_quarter():
    """A gain of -1 leaves (1 + 1)^2 of the push's square, of which the model may leave 1 / 2^2."""
    equation, k = TankEquation(SHIP, TANK, EXACT, STEP_S), 0
    roll_rad, answer = 3.0 / PUSH, -3.0 / ANSWER
    while math.isnan(equation.doubt):
        turn = cmath.exp(1j * W * k * STEP_S)
        equation.update((roll_rad * turn).real, (answer * turn).real, 0.0)
        k += 1
    assert equation.doubt == pytest.approx(16 * math.sqrt(0.25), rel=0.05)
