"""Sums of one order: to rounding as numpy has them, to the bit as loops have them."""

import math

import mpmath
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from utank_hil.base.ordered_sums import exponential, orthogonal_triangle, product, solved

SIZES = st.integers(0, 300)
SEEDS = st.integers(0, 2**32 - 1)


def draw(seed, *shape):
    numbers = np.random.default_rng(seed)
    return numbers.standard_normal(shape) * 10.0 ** numbers.integers(-8, 8, shape)


def pairwise(terms):
    """The order that the module states, written out."""
    n = len(terms)
    if n < 8:
        total = 0.0
        for term in terms:
            total += term
        return total
    if n <= 128:
        lanes = terms[:8]
        whole = n - n % 8
        for i in range(8, whole, 8):
            lanes = [a + b for a, b in zip(lanes, terms[i : i + 8], strict=True)]
        total = ((lanes[0] + lanes[1]) + (lanes[2] + lanes[3])) + (
            (lanes[4] + lanes[5]) + (lanes[6] + lanes[7])
        )
        for term in terms[whole:]:
            total += term
        return total
    half = n // 2 - n // 2 % 8
    return pairwise(terms[:half]) + pairwise(terms[half:])


@given(SEEDS, st.integers(1, 6), SIZES, st.sampled_from("CFS"))
def test_a_product_with_a_vector_has_the_stated_order(seed, rows, size, memory):
    a, x = draw(seed, rows, size), draw(seed + 1, size)
    laid = {"C": a, "F": np.asfortranarray(a), "S": np.repeat(a, 2, axis=1)[:, ::2]}[memory]
    expected = [
        pairwise([p * q for p, q in zip(row, x.tolist(), strict=True)]) for row in a.tolist()
    ]
    assert product(laid, x).tolist() == expected
    assert float(product(laid[0], x)) == expected[0]


@given(SEEDS, st.integers(1, 4), st.integers(0, 40), st.integers(1, 4))
def test_a_product_with_a_matrix_has_it_for_each_element(seed, rows, size, columns):
    a, b = draw(seed, rows, size), draw(seed + 1, size, columns)
    found = product(np.asfortranarray(a), b)
    assert found.tolist() == [[float(product(row, column)) for column in b.T] for row in a]
    most = float((abs(a) @ abs(b)).max(initial=1e-300))
    np.testing.assert_allclose(found, a @ b, rtol=0, atol=1e-14 * most)


@given(arrays(np.float64, (4, 4), elements=st.floats(-20, 20)))
@settings(max_examples=20)
def test_exponential(a):
    with mpmath.workdps(60):  # scipy's is a hundred times less exact where all entries are equal
        exact = np.array(mpmath.expm(mpmath.matrix(a.tolist())).tolist(), dtype=float)
    most = np.exp(np.abs(a).sum(axis=1).max())
    np.testing.assert_allclose(exponential(a), exact, rtol=0, atol=1e-13 * most)


def test_exponential_of_a_rotation():
    c, s = math.cos(40.0), math.sin(40.0)
    turned = exponential(np.array([[0.0, 40.0], [-40.0, 0.0]]))
    np.testing.assert_allclose(turned, [[c, s], [-s, c]], atol=2e-14)


@pytest.mark.parametrize("condition", [1.0, 1e6, 1e12])
def test_orthogonal_columns_and_a_triangle(condition):
    a = draw(3, 60, 19) * np.geomspace(1, condition, 19)
    a[:, 5] = a[:, 4] * (1 + 1e-9 * draw(4, 60))  # nearly dependent
    orthogonal, triangle = orthogonal_triangle(a)
    np.testing.assert_allclose(orthogonal.T @ orthogonal, np.eye(19), atol=1e-14)
    np.testing.assert_allclose(orthogonal @ triangle, a, rtol=0, atol=1e-14 * np.abs(a).max())
    assert np.all(np.tril(triangle, -1) == 0)
    b = draw(5, 19, 3)
    x = solved(triangle, b)
    assert np.all(
        np.abs(triangle @ x - b) <= 1e-14 * (np.abs(triangle) @ np.abs(x))
    )  # backward error
