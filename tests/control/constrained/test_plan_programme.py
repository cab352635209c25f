"""The level in a plan: kept where it can be, exceeded by as little as can be where it cannot."""

import numpy as np
import pytest

from utank_hil.control import PumpLimits
from utank_hil.control.constrained.horizon import PlanProgramme, condense
from utank_hil.dynamics.sampling import LinearModel

# level(k+1) = 0.9 level(k) + u(k): what is wanted of it is a level of 2
PLANT = LinearModel(np.full((1, 1), 0.9), np.ones((1, 1)), np.ones((1, 1)), np.zeros((1, 1)), 1.0)
LIMITS = PumpLimits(pressure_pa=0.5, rate_pa_s=0.2, level_m=1.0)
HORIZON = condense(PLANT, tuple(range(12)), 12, np.ones(1), 1e-3)
TO_TARGET = HORIZON.unlimited_target.sum(axis=0)[:, 0]  # a constant one
LOW, HIGH = np.full(12, -0.5), np.full(12, 0.5)


def programme(penalty: float = 1e3) -> PlanProgramme:
    return PlanProgramme(HORIZON, LIMITS, 1.0, 0, penalty, 100)


def levels_of(plan, start):
    levels = [start]
    for u in plan:
        levels.append(0.9 * levels[-1] + u)
    return np.array(levels[:12])


def solve(start: float, target: float = 2.0, last: float = 0.0):
    one = programme()
    best = HORIZON.unlimited_state[:, 0] * start + TO_TARGET * target
    free = HORIZON.outputs_state[one.held, 0, 0] * start
    assert not one.respects(best, LOW, HIGH, last, free)
    plan = one.solve(-HORIZON.hessian @ best, LOW, HIGH, last, free)
    return one, plan, free


def test_a_wish_beyond_the_level_limit_ends_at_it():
    one, plan, _ = solve(0.0)
    held = levels_of(plan, 0.0)[one.held]
    assert held.max() == pytest.approx(1.0, abs=1e-5)
    assert np.abs(np.diff(plan, prepend=0.0)).max() <= 0.2 + 1e-6


def test_from_beyond_the_limit_the_plan_comes_back_as_fast_as_the_pump_can():
    one, plan, _ = solve(3.0)
    # full rate, then full pressure: the first held level is what that leaves
    expected = levels_of([-0.2, -0.4, -0.5], 3.0)
    assert levels_of(plan, 3.0)[one.held[0]] == pytest.approx(expected[one.held[0]], abs=1e-5)


def test_a_plan_is_accepted_only_within_every_limit():
    one = programme()
    free = np.zeros(len(one.held))
    gentle = np.minimum(0.05 * np.arange(1, 13), 0.1)
    assert one.respects(gentle, LOW, HIGH, 0.0, free)
    assert not one.respects(gentle, LOW, HIGH, -0.2, free)  # rate
    assert not one.respects(gentle, LOW, np.full(12, 0.09), 0.0, free)  # pressure
    assert not one.respects(gentle, LOW, HIGH, 0.0, free + 0.7)  # level


def test_without_a_level_output_nothing_holds_the_level():
    one = PlanProgramme(HORIZON, LIMITS, 1.0, None, 1.0, 100)
    assert len(one.held) == 0
    best = TO_TARGET * 5.0
    plan = one.solve(-HORIZON.hessian @ best, LOW, HIGH, 0.0, np.zeros(0))
    assert levels_of(plan, 0.0).max() > 2.0
