"""The finite-memory ARX predictor, against Gaussian conditioning done in one piece."""

import control
import numpy as np
import pytest

from utank_hil.control.predictive.design import finite_memory_arx

RNG = np.random.default_rng(2)
A = np.array([[0.9, 0.3, 0.0], [-0.3, 0.9, 0.2], [0.0, 0.0, 0.7]])
SYSTEM = control.ss(A, RNG.normal(size=(3, 1)), RNG.normal(size=(2, 3)), [[0.5], [0.0]], 0.2)
PROCESS = np.diag([0.0, 0.1, 1.0])
MEASUREMENT = np.diag([0.2, 0.4])


def stationary_covariance():
    covariance, power = np.zeros((3, 3)), np.eye(3)
    for _ in range(2000):
        covariance += power @ PROCESS @ power.T
        power = A @ power
    return covariance


@pytest.mark.parametrize("order", [1, 2, 7])
def test_output_coefficients_are_the_conditional_mean_given_the_past(order):
    # y(k-p) ... y(k) jointly Gaussian with zero input: E[y(k) | past] = S_fp S_pp^-1 past
    size, c = order + 1, SYSTEM.C
    stationary = stationary_covariance()
    joint = np.zeros((size, 2, size, 2))
    for i in range(size):
        for j in range(i + 1):
            lagged = c @ np.linalg.matrix_power(A, i - j) @ stationary @ c.T
            joint[i, :, j], joint[j, :, i] = lagged, lagged.T
        joint[i, :, i] += MEASUREMENT
    joint = joint.reshape(2 * size, 2 * size)
    best = np.linalg.solve(joint[:-2, :-2], joint[:-2, -2:]).T  # oldest first
    arx = finite_memory_arx(SYSTEM, PROCESS, MEASUREMENT, order)
    newest_first = best.reshape(2, order, 2).transpose(1, 0, 2)[::-1]
    np.testing.assert_allclose(arx.alpha, newest_first, atol=1e-9)


def test_known_inputs_do_not_surprise_the_predictor():
    # without noise in the record, what the input does from rest is predicted exactly
    u = RNG.normal(size=(8, 1))
    x, y = np.zeros(3), []
    for sample in u:
        y.append(SYSTEM.C @ x + SYSTEM.D @ sample)
        x = SYSTEM.A @ x + SYSTEM.B @ sample
    arx = finite_memory_arx(SYSTEM, PROCESS, MEASUREMENT, 10)
    np.testing.assert_allclose(arx.predict(u, np.array(y)), y, atol=1e-12)


def test_long_memory_is_the_stationary_kalman_predictor():
    arx = finite_memory_arx(SYSTEM, PROCESS, MEASUREMENT, 200)
    gain = control.dlqe(A, np.eye(3), SYSTEM.C, PROCESS, MEASUREMENT)[0]
    row = SYSTEM.C
    for i in range(5):
        np.testing.assert_allclose(arx.alpha[i], row @ gain, atol=1e-8)
        row = row @ (A - gain @ SYSTEM.C)


def test_unstable_model_and_wrong_shapes_are_refused():
    with pytest.raises(ValueError, match="stable"):
        finite_memory_arx(control.ss(1.01, 1, 1, 0, 0.2), np.eye(1), np.eye(1), 5)
    with pytest.raises(ValueError, match="process_covariance"):
        finite_memory_arx(SYSTEM, np.eye(2), MEASUREMENT, 5)
    with pytest.raises(ValueError, match="measurement_covariance"):
        finite_memory_arx(SYSTEM, PROCESS, np.eye(3), 5)
    with pytest.raises(ValueError, match="order"):
        finite_memory_arx(SYSTEM, PROCESS, MEASUREMENT, 0)
