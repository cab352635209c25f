"""Washout: no steady pressure for a steady list, the law untouched where the waves are."""

import numpy as np
import pytest

from utank_hil.control import PredictiveLaw, WashoutLaw

LAW = PredictiveLaw(
    np.array([0.3, -0.2]).reshape(2, 1, 1),
    np.array([[[1e6, 2e4]], [[-3e6, 1e4]]]),
    np.zeros((1, 1, 2)),
    0.2,
)
WASHED = WashoutLaw(LAW, 0.03)


def test_steady_list_ends_in_zero_pressure():
    controller, plain = WASHED.controller(), LAW.controller()
    for _ in range(3000):
        u, other = controller.step(np.array([0.05, 0.4])), plain.step(np.array([0.05, 0.4]))
        controller.applied(u)
    assert abs(u[0]) < 0.01
    assert abs(other[0]) > 1e3


def test_response_and_matrices_are_those_of_the_stepped_controller():
    y = np.random.default_rng(0).normal(size=(80, 2))
    controller = WASHED.controller()
    stepped = np.array([controller.step(sample)[0] for sample in y])
    a, b, c, d, _ = WASHED.matrices()
    x, by_state = np.zeros(len(a)), []
    for sample in y:
        x = a @ x + b @ sample  # u(k + 1) from y(k): the model's output one ahead
        by_state.append((c @ x)[0])
    np.testing.assert_allclose(by_state, stepped, rtol=1e-9)
    z = np.exp(1j * np.array([0.001, 0.1, 2.0]))
    for point, response in zip(z, WASHED.response(z), strict=True):
        expected = c @ np.linalg.solve(point * np.eye(len(a)) - a, b) + d
        np.testing.assert_allclose(response, expected, rtol=1e-9)


def test_wave_frequencies_pass_and_steady_values_do_not():
    z = np.exp(0.2j * np.array([1e-5, 0.5]))
    ratio = WASHED.response(z)[:, 0, 0] / LAW.response(z)[:, 0, 0]
    assert abs(ratio[0]) < 1e-3
    assert abs(ratio[1] - 1) < 0.07


def test_reset_forgets_the_mean():
    used, new = WASHED.controller(), WASHED.controller()
    for _ in range(50):
        used.step(np.ones(2))
    used.reset()
    np.testing.assert_array_equal(used.step(np.ones(2)), new.step(np.ones(2)))


def test_corner_must_be_positive():
    with pytest.raises(ValueError, match="corner_rad_s"):
        WashoutLaw(LAW, 0.0)
