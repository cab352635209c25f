"""Constrained GPC: the analytic law inside the limits, an independent optimum at them."""

import math
from dataclasses import replace

import clarabel
import numpy as np
import pytest
from arx_law import arx_law
from hypothesis import given
from hypothesis import strategies as st
from scipy import sparse

from utank_hil.base.arrays import FloatArray
from utank_hil.control import ARX, PumpLimits, design_gpc
from utank_hil.control.constrained.horizon import LEVEL_SPACING
from utank_hil.control.constrained.law import ConstrainedController, ConstrainedLaw

WIDE = PumpLimits(pressure_pa=1e12, rate_pa_s=1e12, level_m=1e12)


def random_arx(rng, order, outputs=2) -> ARX:
    return ARX(
        rng.normal(size=(order, outputs, outputs)) * 0.8 / order,
        rng.normal(size=(order + 1, outputs, 1)),
        0.2,
    )


def respond(arx, u, y, newest_u):
    """Output of the ARX recursion; pasts newest last."""
    now = arx.beta[0] @ newest_u
    for i in range(1, arx.order + 1):
        now = now + arx.alpha[i - 1] @ y[-i] + arx.beta[i] @ u[-i]
    return now


@given(
    seed=st.integers(0, 2**32 - 1),
    order=st.integers(1, 5),
    targets=st.sampled_from([None, (2,), (12, 2)]),
)
def test_without_active_limits_it_is_the_analytic_law(seed, order, targets):
    rng = np.random.default_rng(seed)
    arx = random_arx(rng, order)
    args = (8, 12, (1.0, 0.3), 0.7, 2)
    one = design_gpc(arx, *args).controller()
    other = arx_law(arx, WIDE, *args, level_output=1).controller()
    target = None if targets is None else rng.normal(size=targets)
    for _ in range(20):
        y, left = rng.normal(size=2), rng.normal(size=1)
        expected = one.step(y, target)
        np.testing.assert_allclose(other.step(y, target), expected, rtol=1e-9, atol=1e-9)
        assert not other.limited
        # what left was something else: on its own the analytic law may grow without bounds
        one.applied(left)
        other.applied(left)


def test_the_linear_law_of_the_margins_is_the_analytic_one():
    arx = random_arx(np.random.default_rng(3), 4)
    args = (8, 12, (1.0, 0.3), 0.7)
    z = np.exp(1j * np.linspace(0.1, 3, 20))
    np.testing.assert_allclose(
        arx_law(arx, WIDE, *args).response(z),
        design_gpc(arx, *args).response(z),
        rtol=1e-9,
    )


def independent(arx, past_u, past_y, limits, last, hc, hp, weight, penalty):
    """First command of the optimum: commands, outputs and slack as unknowns, dynamics as rows."""
    m = arx.outputs
    n = hc + hp * m + 1
    equal, right = np.zeros((hp * m, n)), np.zeros(hp * m)
    for q in range(hp):
        rows = slice(q * m, (q + 1) * m)
        equal[rows, hc + q * m : hc + (q + 1) * m] = np.eye(m)
        if q < hc:
            equal[rows, q] -= arx.beta[0][:, 0]
        for i in range(1, arx.order + 1):
            if q - i >= 0:
                equal[rows, hc + (q - i) * m : hc + (q - i + 1) * m] -= arx.alpha[i - 1]
                if q - i < hc:
                    equal[rows, q - i] -= arx.beta[i][:, 0]
            else:
                back = i - q
                right[rows] += arx.alpha[i - 1] @ past_y[-back] + arx.beta[i] @ past_u[-back]
    cost = np.zeros((n, n))
    cost[range(hc), range(hc)] = 1.0
    for q in range(hp):
        for channel in range(m):
            cost[hc + q * m + channel, hc + q * m + channel] = weight[channel]
    cost[-1, -1] = penalty
    linear = np.zeros(n)
    linear[-1] = penalty
    rows, bounds = [], []

    def at_most(indices, values, bound):
        row = np.zeros(n)
        row[indices] = values
        rows.append(row)
        bounds.append(bound)

    rate = limits.rate_pa_s * arx.sample_time_s
    for sign in (1, -1):
        for j in range(hc):
            at_most([j], [sign], limits.pressure_pa)
            if j:
                at_most([j, j - 1], [sign, -sign], rate)
        at_most([0], [sign], rate + sign * last)
        for q in range(LEVEL_SPACING - 1, hp, LEVEL_SPACING):
            at_most([hc + q * m + 1, n - 1], [sign, -1], limits.level_m)
    at_most([n - 1], [-1], 0.0)
    solver_settings = clarabel.DefaultSettings()
    solver_settings.verbose = False
    solver_settings.tol_gap_abs = solver_settings.tol_gap_rel = solver_settings.tol_feas = 1e-10
    solution = clarabel.DefaultSolver(
        sparse.csc_matrix(np.triu(cost)),
        linear,
        sparse.csc_matrix(np.vstack([equal, rows])),
        np.concatenate([right, bounds]),
        [clarabel.ZeroConeT(hp * m), clarabel.NonnegativeConeT(len(rows))],
        solver_settings,
    ).solve()
    return solution.x[0]


@pytest.mark.slow
def test_thousand_limited_steps_equal_an_independent_optimum():
    rng = np.random.default_rng(7)
    hc, hp, limited, worst = 6, 9, 0, 0.0
    for _ in range(100):
        arx = random_arx(rng, 3)
        limits = PumpLimits(
            pressure_pa=rng.uniform(0.5, 1.5),
            rate_pa_s=rng.uniform(1, 5),
            level_m=rng.uniform(0.3, 2),
        )
        weight, penalty = (rng.uniform(0.5, 3), rng.uniform(0, 1)), 50.0
        controller = arx_law(
            arx, limits, hc, hp, weight, level_output=1, level_penalty=penalty
        ).controller()
        share = rng.choice([1.0, 0.5, 0.2])
        controller.allow(share)
        allowed = replace(limits, pressure_pa=share * limits.pressure_pa)
        u, y = [np.zeros(1)] * 4, [np.zeros(2)] * 3
        last = 0.0
        for _ in range(10):
            newest = 5 * rng.normal(size=2) + respond(arx, u[:-1], y, u[-1])
            y.append(newest)
            command = controller.step(newest)
            expected = independent(arx, u, y, allowed, last, hc, hp, weight, penalty)
            worst = max(worst, abs(command[0] - expected) / limits.pressure_pa)
            limited += controller.limited
            u.append(command)
            last = float(command[0])
    assert limited > 500
    assert worst < 1e-5


@pytest.mark.parametrize("size", [1e-6, 1.0, 1e12])
def test_cost_in_another_unit_makes_the_same_law(size):
    arx, limits = random_arx(np.random.default_rng(11), 3), PumpLimits(1.0, 2.0, 0.5)
    rng = np.random.default_rng(3)
    measured = 3 * rng.normal(size=(40, 2))

    def commands(size):
        controller = arx_law(
            arx, limits, 12, 15, (5.0 * size, size), size, level_output=1
        ).controller()
        return [float(controller.step(y)[0]) for y in measured]

    np.testing.assert_allclose(commands(size), commands(2.0), atol=1e-5)


def saturating(iteration_limit=100, level_m=0.5) -> ConstrainedController:
    arx = random_arx(np.random.default_rng(11), 3)
    limits = PumpLimits(pressure_pa=1.0, rate_pa_s=2.0, level_m=level_m)
    return arx_law(
        arx,
        limits,
        12,
        15,
        (5.0, 1.0),
        level_output=1,
        level_penalty=100.0,
        iteration_limit=iteration_limit,
    ).controller()


@given(
    st.lists(
        st.tuples(st.floats(-1e3, 1e3), st.floats(-1e3, 1e3), st.floats(-1, 1)),
        min_size=1,
        max_size=20,
    ),
    st.integers(1, 50),
)
def test_pressure_and_rate_hold_for_any_measurement_and_budget(sequence, budget):
    controller = saturating(budget)
    last = 0.0
    for first, second, _ in sequence:
        command = float(controller.step(np.array([first, second]))[0])
        assert abs(command) <= 1.0
        assert abs(command - last) <= 0.4 * (1 + 1e-12)
        last = command


def test_a_share_of_the_pressure_is_kept_as_soon_as_the_rate_allows_and_not_for_good():
    controller = saturating(level_m=1e6)
    push = np.array([0.0, 1e3])
    full = [float(controller.step(push)[0]) for _ in range(6)]
    assert abs(full[-1]) == pytest.approx(1.0)
    controller.allow(0.3)
    held = [abs(float(controller.step(push)[0])) for _ in range(4)]
    assert held == pytest.approx([0.6, 0.3, 0.3, 0.3], abs=1e-6)
    controller.allow(1.0)
    # a command that a limit bends is on a grid of 2^-19: this one, and the one before
    assert abs(float(controller.step(push)[0])) == pytest.approx(0.7, abs=2**-19)


def test_a_plan_with_leeway_stays_near_what_the_linear_law_commands(monkeypatch):
    rng = np.random.default_rng(11)
    arx = random_arx(rng, 3)

    def law_of(level_m: float, leeway: float | None) -> ConstrainedLaw:
        limits = PumpLimits(pressure_pa=1.0, rate_pa_s=100.0, level_m=level_m)
        law = arx_law(arx, limits, 12, 15, (5.0, 1.0), level_output=1, level_penalty=100.0)
        return replace(law, leeway=leeway)

    def differences(law: ConstrainedLaw) -> FloatArray:
        controller, linear = law.controller(), law.unlimited().controller()
        found = []
        for y in 5 * np.random.default_rng(5).normal(size=(40, 2)):
            command = controller.step(y)
            found.append(abs(command[0] - np.clip(linear.step(y)[0], -1.0, 1.0)))
            linear.applied(command)
        return np.array(found)

    monkeypatch.setattr(ConstrainedController, "_rises_too_far", lambda *_: 0.0)
    near, free_of_it = differences(law_of(0.5, 0.1)), differences(law_of(0.5, None))
    assert near.max() == pytest.approx(0.1, abs=1e-5)
    assert free_of_it.max() > 1.0


def test_a_plan_with_leeway_may_brake_the_water_before_its_limit():
    """But only against the way that the level goes, and where the near plan passes the limit."""
    rng = np.random.default_rng(11)
    arx = random_arx(rng, 3)
    limits = PumpLimits(pressure_pa=1.0, rate_pa_s=100.0, level_m=0.5)
    law = arx_law(arx, limits, 12, 15, (5.0, 1.0), level_output=1, level_penalty=100.0)
    controller, braked = replace(law, leeway=0.1).controller(), 0
    for _ in range(60):
        state = rng.normal(size=len(law.model.A))
        best = rng.uniform(-1, 1, len(controller._knots))
        low, high = controller._bounds(state, 0.0, best)
        rise = controller._rises_too_far(state, best)
        free_low, free_high = low[0] < best[0] - 0.11, high[0] > best[0] + 0.11
        reach = controller._reach_pa[0]
        if reach >= 2 and abs(best[0]) < 0.8:
            assert (free_low, free_high) == (rise > 0, rise < 0)
            braked += rise != 0
    assert 5 < braked < 60


def test_when_the_budget_is_too_small_the_last_plan_goes_on_and_ends_in_zero():
    controller, starved = saturating(), saturating(1)
    rng = np.random.default_rng(5)
    commands = []
    for k in range(30):
        y = 10 * rng.normal(size=2)
        wanted = controller.step(y)
        got = starved.step(y)
        if k == 0:
            assert abs(wanted[0]) > 0
        commands.append(got[0])
    assert starved.fallbacks > 25
    assert controller.fallbacks == 0
    assert commands[-1] == 0.0


def test_told_of_a_ramp_it_goes_on_from_its_end():
    push = np.array([50.0, 20.0])
    ramping, jumping = saturating(), saturating()
    first = float(ramping.step(push)[0])
    jumping.step(push)
    assert abs(first) == pytest.approx(0.4)  # the whole rate
    ramping.applied(np.array([first / 2]))  # ramped all the way, the mean is half
    jumping.applied(np.array([first]))
    for controller in (ramping, jumping):
        second = float(controller.step(-1e3 * push)[0])
        assert second == pytest.approx(first - np.sign(first) * 0.4, abs=1e-6)


def test_told_of_zero_it_goes_on_from_there():
    controller = saturating()
    for _ in range(3):
        controller.step(np.array([50.0, 20.0]))
    for _ in range(3):
        controller.applied(np.zeros(1))
        command = float(controller.step(np.array([50.0, 20.0]))[0])
    assert abs(command) <= 0.4 * (1 + 1e-12)


@pytest.mark.parametrize("wrong", [math.nan, math.inf, -math.inf])
@pytest.mark.parametrize("place", [0, 1])
def test_a_measurement_that_is_no_number_is_passed_over(wrong, place):
    controller, other = saturating(), saturating()
    rng = np.random.default_rng(4)
    for k in range(40):
        y = rng.normal(size=2)
        other.step(y)
        if k == 5:
            y[place] = wrong
        assert abs(controller.step(y)[0]) <= 1.0
    y = rng.normal(size=2)
    assert controller.step(y)[0] == pytest.approx(other.step(y)[0], abs=1e-3)


def test_reset_makes_it_as_new():
    controller, fresh = saturating(), saturating()
    rng = np.random.default_rng(9)
    for _ in range(5):
        controller.step(10 * rng.normal(size=2))
    controller.reset()
    y = np.array([1.0, -2.0])
    np.testing.assert_allclose(controller.step(y), fresh.step(y), rtol=1e-9)


def test_power_limit_bounds_pressure_times_the_water_s_speed():
    # water with inertia, driven to a level far away
    drag, push = 0.05, 2e-3
    arx = ARX(np.array([[[2 - drag]], [[drag - 1]]]), np.array([[[0.0]], [[push]], [[0.0]]]), 0.2)
    area, target = 3.0, np.array([50.0])

    def powers(power_w):
        limits = PumpLimits(pressure_pa=10.0, rate_pa_s=1e3, level_m=1e3, power_w=power_w)
        controller = arx_law(
            arx,
            limits,
            8,
            8,
            (100.0,),
            0.01,
            level_output=0,
            level_penalty=100.0,
            reservoir_area_m2=area,
        ).controller()
        level = step_m = 0.0
        found = []
        for _ in range(100):
            command = float(controller.step(np.array([level]), target)[0])
            step_m = (1 - drag) * step_m + push * command
            level += step_m
            found.append(area * command * step_m / 0.2)
        return np.array(found)

    assert powers(math.inf).max() == pytest.approx(
        area * 10.0 * (push * 10.0 / drag) / 0.2, rel=0.02
    )
    assert 19.0 < powers(20.0).max() < 22.0  # the speed it reckons with is that of the last plan


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"level_penalty": -1.0}, "level_penalty must be positive"),
        ({"level_penalty": math.nan}, "level_penalty must be positive"),
        ({"iteration_limit": 0}, "iteration_limit must be 1 or more"),
        ({"level_output": 7}, "level_output must be one of the 2 outputs, 0 to 1, got 7"),
        ({"level_output": -1}, "level_output must be"),
        ({"input_weight": math.inf}, "input_weight positive, and both finite"),
        ({"input_weight": 0.0}, "input_weight positive"),
        ({"output_weight": (1.0, math.nan)}, "output_weight must be zero or more"),
        ({"reservoir_area_m2": -1.0}, "reservoir_area_m2 must be positive"),
        ({"level_output": None}, "name the level_output"),
    ],
)
def test_what_is_out_of_range_is_refused_by_name(change, message):
    limits = PumpLimits(pressure_pa=1.0, rate_pa_s=1.0, level_m=1.0, power_w=1.0)
    settings = {
        "control_horizon": 8,
        "prediction_horizon": 12,
        "output_weight": (1.0, 1.0),
        "level_output": 1,
        "reservoir_area_m2": 1.0,
    }
    arx = random_arx(np.random.default_rng(3), 2)
    arx_law(arx, limits, **settings)
    with pytest.raises(ValueError, match=message):
        arx_law(arx, limits, **{**settings, **change})
