"""The regression that is never written out, against the one that is."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from utank_hil.identification import IdentificationError
from utank_hil.identification.lag_regression import LagRegression, segment_bounds


def _case(seed: int) -> LagRegression:
    """Random sizes, gaps and basis."""
    rng = np.random.default_rng(seed)
    order = int(rng.integers(1, 7))
    outputs, inputs, functions = rng.integers(1, 4), rng.integers(1, 3), rng.integers(0, 3)
    samples = int(rng.integers(20, 90))
    z = rng.standard_normal((samples, outputs + inputs))
    z[rng.integers(10, samples, rng.integers(0, 4))] = np.nan
    return LagRegression(z, int(outputs), order, rng.standard_normal((functions, samples)))


@given(st.integers(0, 2**31))
def test_gram_matrix_by_displacement_is_that_of_the_matrix(seed: int) -> None:
    regression = _case(seed)
    matrix, targets = regression.matrix()
    gram, right = regression.gram()
    assert matrix.shape == (regression.rows, regression.columns)
    np.testing.assert_allclose(np.triu(gram), np.triu(matrix.T @ matrix), atol=1e-11)
    np.testing.assert_allclose(right, matrix.T @ targets, atol=1e-11)
    np.testing.assert_allclose(regression.target_squares(), np.sum(targets**2, axis=0))


@given(st.integers(0, 2**31))
def test_products_by_convolution_are_those_of_the_matrix(seed: int) -> None:
    regression = _case(seed)
    matrix, targets = regression.matrix()
    coefficients = np.random.default_rng(seed + 1).standard_normal(
        (regression.columns, regression.outputs)
    )
    errors = regression.residuals(coefficients)
    expected = targets - matrix @ coefficients
    np.testing.assert_allclose(np.hstack(errors).T, expected, atol=1e-11)
    np.testing.assert_allclose(regression.transposed(errors), matrix.T @ expected, atol=1e-10)


def test_rows_of_the_matrix_are_the_arx_equation() -> None:
    # y(k) = a1 y(k-1) + a2 y(k-2) + b0 u(k) + b1 u(k-1) + b2 u(k-2) + c psi(k), spelt out
    rng = np.random.default_rng(3)
    u, psi, y = rng.standard_normal(30), rng.standard_normal(30), np.zeros(30)
    for k in range(2, 30):
        y[k] = 0.5 * y[k - 1] - 0.3 * y[k - 2] + 2 * u[k] - u[k - 1] + 0.7 * u[k - 2] + 4 * psi[k]
    regression = LagRegression(np.column_stack([y, u]), 1, 2, psi[None])
    coefficients = np.array([[2.0], [0.5], [-1.0], [-0.3], [0.7], [4.0]])
    assert np.abs(regression.residuals(coefficients)[0]).max() < 1e-12
    assert regression.input_rows.tolist() == [0, 2, 4]


def test_windows_never_span_a_gap() -> None:
    z = np.ones((10, 2))
    z[4] = np.nan
    assert segment_bounds(z) == [(0, 4), (5, 10)]
    assert LagRegression(z, 1, 3, np.empty((0, 10))).rows == 1 + 2


def test_record_without_a_long_enough_stretch_is_refused() -> None:
    z = np.ones((10, 2))
    z[::3] = np.nan
    with pytest.raises(IdentificationError, match="longer than the order"):
        LagRegression(z, 1, 3, np.empty((0, 10)))
