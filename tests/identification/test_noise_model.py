"""Noise models: as least squares row by row has them, short where the noise is, else none."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from roll_plant import jonswap_moment

from utank_hil.base.arrays import FloatArray
from utank_hil.identification import IdentificationError
from utank_hil.identification.noise_model import NoiseModel, low_order_noise_model

ALPHA = np.array([[[1.2, 0.1], [0.0, 0.5]], [[-0.6, 0.0], [0.2, -0.4]]])
MIXING = np.array([[1.0, 0.0], [0.5, 0.3]])


def coloured(samples: int, seed: int) -> FloatArray:
    """Autoregression of order 2, shape (samples, 2), settled."""
    v = np.zeros((samples + 200, 2))
    e = np.random.default_rng(seed).standard_normal(v.shape) @ MIXING.T
    for k in range(2, len(v)):
        v[k] = ALPHA[0] @ v[k - 1] + ALPHA[1] @ v[k - 2] + e[k]
    return v[200:]


def row_by_row(v: FloatArray, order: int, highest: int) -> tuple[FloatArray, FloatArray, int]:
    """Coefficients, sum of squared errors and rows, from every row whose past is whole."""
    past, now = [], []
    for k in range(highest, len(v)):
        window = v[k - highest : k + 1]
        if np.isfinite(window).all():
            past.append([x for i in range(1, order + 1) for x in window[highest - i]])
            now.append(window[highest])
    matrix, targets = np.array(past).reshape(len(now), -1), np.array(now)
    solution = np.linalg.lstsq(matrix, targets, rcond=None)[0]
    left = targets - matrix @ solution
    alpha = solution.reshape(order, 2, 2).transpose(0, 2, 1)
    return alpha, left.T @ left, len(now)


def test_white_noise_is_found_white() -> None:
    v = np.random.default_rng(1).standard_normal((1500, 2)) @ MIXING.T
    found = low_order_noise_model(v, 30)
    assert found.order == 0
    np.testing.assert_allclose(found.covariance, v[30:].T @ v[30:] / 1470, rtol=1e-9)


def test_white_noise_is_seldom_refused() -> None:
    """One in a hundred is; the ratio's correction keeps it so with few rows for each lag."""
    rng = np.random.default_rng(2)
    found = [low_order_noise_model(rng.standard_normal((1000, 2)), 100) for _ in range(200)]
    assert sum(one is None for one in found) <= 8  # of a mean of 2: once in 4000
    assert all(one.order == 0 for one in found if one is not None)


def test_autoregression_is_recovered() -> None:
    found = low_order_noise_model(coloured(20_000, 3), 20)
    assert found.order == 2
    np.testing.assert_allclose(found.alpha, ALPHA, atol=0.05)  # standard deviation 0.01 on average
    np.testing.assert_allclose(found.covariance, MIXING @ MIXING.T, atol=0.03)


@pytest.mark.slow
@given(seed=st.integers(0, 10_000), gaps=st.sets(st.integers(0, 599), max_size=5))
def test_is_least_squares_over_the_rows_whose_past_has_no_gap(seed: int, gaps: set[int]) -> None:
    v = coloured(600, seed)
    v[sorted({300, *gaps})] = np.nan
    found = low_order_noise_model(v, 6)
    if found is None:  # one in a hundred
        return
    alpha, squares, rows = row_by_row(v, found.order, 6)
    np.testing.assert_allclose(found.alpha, alpha, atol=1e-6)
    np.testing.assert_allclose(found.covariance, squares / (rows - 2 * found.order), rtol=1e-6)
    scores = []
    for order in range(7):
        _, squares, rows = row_by_row(v, order, 6)
        scores.append(rows * np.linalg.slogdet(squares)[1] + 4 * order * np.log(rows))
    assert found.order == np.argmin(scores)


def test_irregular_sea_has_no_short_model() -> None:
    sea = np.column_stack([jonswap_moment(2500, 1, 1.0), jonswap_moment(2500, 2, 1.0)])
    v = sea + 0.01 * np.random.default_rng(3).standard_normal(sea.shape)
    assert low_order_noise_model(v, 120) is None


def test_order_that_is_not_below_the_highest_is_not_short() -> None:
    assert low_order_noise_model(coloured(2000, 4), 2) is None
    assert low_order_noise_model(coloured(2000, 4), 1) is None


@given(seed=st.integers(0, 10_000), order=st.integers(0, 4))
def test_whitening_leaves_a_spectrum_of_one(seed: int, order: int) -> None:
    rng = np.random.default_rng(seed)
    mixing = rng.standard_normal((2, 2)) + 3 * np.eye(2)
    noise = NoiseModel(0.2 * rng.standard_normal((order, 2, 2)), mixing @ mixing.T)
    taps = noise.whitening()
    assert taps.shape == (order + 1, 2, 2)
    for turn in np.exp(-1j * np.linspace(0, np.pi, 7)):
        gain = np.eye(2) - sum(a * turn ** (i + 1) for i, a in enumerate(noise.alpha))
        colour = np.linalg.inv(gain) @ mixing
        white = sum(tap * turn**i for i, tap in enumerate(taps)) @ colour
        np.testing.assert_allclose(white @ white.conj().T, np.eye(2), atol=1e-8)


@pytest.mark.parametrize("scale", [0.0, 1e-160, 1e-17])
def test_errors_that_are_rounding_or_twice_the_same_end_in_an_answer(scale: float) -> None:
    e = scale * np.random.default_rng(5).standard_normal(1000)
    found = low_order_noise_model(np.column_stack([e, e]), 10)
    assert found is None or np.isfinite(found.whitening()).all()


def test_stretches_no_longer_than_the_order_are_refused() -> None:
    v = coloured(100, 6)
    v[::20] = np.nan
    with pytest.raises(IdentificationError, match="no stretch"):
        low_order_noise_model(v, 20)
