"""Predictions of a plan against the plain recursion; its optimum against a search."""

import numpy as np
import pytest

from utank_hil.control.constrained.horizon import condense
from utank_hil.dynamics.sampling import LinearModel


def model(seed=0, n=4, m=2) -> LinearModel:
    rng = np.random.default_rng(seed)
    a = rng.normal(size=(n, n))
    a *= 0.95 / np.abs(np.linalg.eigvals(a)).max()
    b, c, d = rng.normal(size=(n, 1)), rng.normal(size=(m, n)), rng.normal(size=(m, 1))
    return LinearModel(a, b, c, d, 0.2)


KNOTS = (0, 1, 3, 6)
WEIGHT = np.array([1.0, 0.2])


def recursion(plant, state, commands):
    outputs = []
    for u in commands:
        outputs.append(plant.C @ state + plant.D[:, 0] * u)
        state = plant.A @ state + plant.B[:, 0] * u
    return np.array(outputs), state


def cost_of(plant, state, commands, target, terminal, first_output=2):
    outputs, end = recursion(plant, state, commands)
    squares = WEIGHT * np.square(target - outputs[first_output:])
    return squares.sum() + 0.3 * np.square(commands).sum() + np.square(terminal @ end).sum()


def test_command_runs_straight_between_knots_and_is_zero_after_the_last():
    horizon = condense(model(), KNOTS, 9, WEIGHT, 1.0)
    commands = horizon.interpolation @ np.array([1.0, 2.0, 6.0, 3.0])
    np.testing.assert_allclose(commands, [1, 2, 4, 6, 5, 4, 3, 0, 0])


def test_outputs_equal_the_recursion():
    plant, rng = model(1), np.random.default_rng(1)
    horizon = condense(plant, KNOTS, 9, WEIGHT, 1.0)
    state, plan = rng.normal(size=4), rng.normal(size=4)
    expected, _ = recursion(plant, state, horizon.interpolation @ plan)
    np.testing.assert_allclose(
        horizon.outputs_state @ state + horizon.outputs_plan @ plan, expected, rtol=1e-10
    )
    held, _ = recursion(plant, np.zeros(4), np.ones(9))
    np.testing.assert_allclose(horizon.outputs_held, held, rtol=1e-10)


def test_nothing_near_the_unlimited_plan_is_cheaper_and_the_hessian_tells_by_how_much():
    plant, rng = model(2), np.random.default_rng(2)
    terminal = rng.normal(size=(3, 4))
    horizon = condense(plant, KNOTS, 9, WEIGHT, 0.3, first_output=2, terminal=terminal)
    state, target = rng.normal(size=4), rng.normal(size=2)
    best = horizon.unlimited_state @ state + horizon.unlimited_target.sum(axis=0) @ target

    def cost(plan):
        return cost_of(plant, state, horizon.interpolation @ plan, target, terminal)

    for _ in range(20):
        change = rng.normal(size=4)
        assert cost(best + change) - cost(best) == pytest.approx(
            change @ horizon.hessian @ change, rel=1e-8
        )


@pytest.mark.parametrize("knots", [(), (1, 2), (0, 2, 2), (0, 9)])
def test_bad_knots_are_refused(knots):
    with pytest.raises(ValueError, match="knots"):
        condense(model(), knots, 9, WEIGHT, 1.0)


def test_bad_weights_and_two_pumps_are_refused():
    with pytest.raises(ValueError, match="weight"):
        condense(model(), KNOTS, 9, WEIGHT, 0.0)
    plant = model()
    two = plant._replace(B=np.ones((4, 2)), D=np.ones((2, 2)))
    with pytest.raises(ValueError, match="2 inputs"):
        condense(two, KNOTS, 9, WEIGHT, 1.0)
