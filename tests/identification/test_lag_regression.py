"""The regression of an ARX model, and its solution."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from roll_plant import SLOW_PUMP, noisy, plant, pulses

from utank_hil.identification import IdentificationError
from utank_hil.identification.lag_regression import LagRegression, fit, segment_bounds


def test_rows_of_the_matrix_are_the_arx_equation():
    # y(k) = a1 y(k-1) + a2 y(k-2) + b0 u(k) + b1 u(k-1) + b2 u(k-2) + c psi(k), spelt out
    rng = np.random.default_rng(3)
    u, psi, y = rng.standard_normal(30), rng.standard_normal(30), np.zeros(30)
    for k in range(2, 30):
        y[k] = 0.5 * y[k - 1] - 0.3 * y[k - 2] + 2 * u[k] - u[k - 1] + 0.7 * u[k - 2] + 4 * psi[k]
    regression = LagRegression(np.column_stack([y, u]), 1, 2, psi[None])
    coefficients = np.array([[2.0], [0.5], [-1.0], [-0.3], [0.7], [4.0]])
    assert np.abs(regression.residuals(coefficients)).max() < 1e-12
    assert regression.input_rows.tolist() == [0, 2, 4]


def test_windows_never_span_a_gap():
    z = np.ones((10, 2))
    z[4] = np.nan
    assert segment_bounds(z) == [(0, 4), (5, 10)]
    regression = LagRegression(z, 1, 3, np.empty((0, 10)))
    assert regression.at.tolist() == [3, 8, 9]
    assert regression.ends.tolist() == [1]
    assert np.isfinite(regression.matrix).all()


def test_record_without_a_long_enough_stretch_is_refused():
    z = np.ones((10, 2))
    z[::3] = np.nan
    with pytest.raises(IdentificationError, match="longer than the order"):
        LagRegression(z, 1, 3, np.empty((0, 10)))


def test_a_record_that_takes_too_much_memory_is_refused():
    z = np.zeros((100_000, 3))  # Six hours at five samples a second.
    with pytest.raises(IdentificationError, match="a part of 33057 samples at most"):
        LagRegression(z, 2, 120, np.empty((0, len(z))))


def _regression(u, y, order):
    z = np.column_stack([y, u])
    z = z / np.sqrt(np.mean(z**2, axis=0))
    return LagRegression(z, y.shape[1], order, np.empty((0, len(z))))


def test_noisy_data_give_the_least_squares_solution():
    u = pulses(1)
    y = noisy(plant().respond(u, np.zeros_like(u)), 0.01, 2)
    regression = _regression(u, y, 120)
    matrix, targets = regression.matrix, regression.targets
    expected, residual, rank, _ = np.linalg.lstsq(matrix, targets, rcond=None)
    found = fit(regression)
    assert found.rank == rank == regression.columns
    np.testing.assert_allclose(found.coefficients, expected, atol=1e-11)
    freedom = regression.rows - regression.columns
    np.testing.assert_allclose(np.diag(found.residual_covariance), residual / freedom, rtol=1e-9)
    assert not found.penalty.any()


def test_data_without_noise_give_the_minimum_norm_solution():
    u = pulses(1)
    regression = _regression(u, plant().respond(u, np.zeros_like(u)), 60)
    matrix, targets = regression.matrix, regression.targets
    expected, _, rank, _ = np.linalg.lstsq(matrix, targets, rcond=1e-10)
    found = fit(regression)
    assert found.rank == rank == 61 + 4  # lagged inputs and the state, however many outputs
    np.testing.assert_allclose(found.coefficients, expected, atol=1e-9)
    assert np.sqrt(np.trace(found.residual_covariance)) < 1e-13


def test_slow_pump_shrinks_the_input_coefficients_and_predicts_as_well():
    u = pulses(1, SLOW_PUMP)
    clean = plant().respond(u, np.zeros_like(u))
    regression = _regression(u, noisy(clean, 0.01, 2), 120)
    matrix, targets = regression.matrix, regression.targets
    unshrunk = np.linalg.lstsq(matrix, targets, rcond=None)[0]
    found = fit(regression)
    assert (found.penalty > 0).all()
    inputs = regression.input_rows
    assert np.linalg.norm(found.coefficients[inputs]) < 0.7 * np.linalg.norm(unshrunk[inputs])
    # judged on what no noise was added to
    truth = _regression(u, clean, 120)
    scale = np.std(noisy(clean, 0.01, 2), axis=0) / np.std(clean, axis=0)
    assert np.all(scale < 1.001)
    fresh = truth.residuals(found.coefficients), truth.residuals(unshrunk)
    assert np.std(fresh[0]) < 1.05 * np.std(fresh[1])


def test_shrinkage_is_the_bayesian_posterior_mean():
    # with the penalty given, the coefficients solve a ridge regression on the inputs alone
    u = pulses(1, SLOW_PUMP)
    regression = _regression(u, noisy(plant().respond(u, 0 * u), 0.01, 2), 40)
    matrix, targets = regression.matrix, regression.targets
    found = fit(regression)
    for j, penalty in enumerate(found.penalty):
        ridge = np.zeros((41, regression.columns))
        ridge[np.arange(41), regression.input_rows] = np.sqrt(penalty)
        stacked = np.vstack([matrix, ridge])
        wanted = np.concatenate([targets[:, j], np.zeros(41)])
        expected = np.linalg.lstsq(stacked, wanted, rcond=None)[0]
        np.testing.assert_allclose(found.coefficients[:, j], expected, atol=1e-8)


def test_two_outputs_that_tell_the_same_end_in_finite_coefficients():
    u = pulses(1, SLOW_PUMP)
    y = noisy(plant().respond(u, 0 * u)[:, :1], 0.01, 2)
    regression = _regression(u, np.hstack([y, y]), 30)
    found = fit(regression)
    assert np.isfinite(found.coefficients).all()
    error = regression.residuals(found.coefficients)
    assert np.std(error) < 0.02


@given(st.integers(0, 2**31))
def test_random_problems_agree_with_lstsq(seed):
    rng = np.random.default_rng(seed)
    outputs, inputs, order = (int(v) for v in rng.integers(1, [3, 3, 6]))
    z = rng.standard_normal((200, outputs + inputs)) @ rng.standard_normal((outputs + inputs,) * 2)
    z[rng.integers(0, 200, 3)] = np.nan
    regression = LagRegression(z, outputs, order, rng.standard_normal((2, 200)))
    matrix, targets = regression.matrix, regression.targets
    expected = np.linalg.lstsq(matrix, targets, rcond=None)[0]
    found = fit(regression)
    assert found.rank == regression.columns
    np.testing.assert_allclose(
        matrix @ found.coefficients, matrix @ expected, atol=1e-9 * np.abs(targets).max()
    )


def test_more_coefficients_than_rows_are_refused():
    rng = np.random.default_rng(0)
    regression = LagRegression(rng.standard_normal((60, 2)), 1, 25, np.empty((0, 60)))
    with pytest.raises(IdentificationError, match="35 usable rows cannot determine 51"):
        fit(regression)
