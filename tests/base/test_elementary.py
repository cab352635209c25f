"""Portable elementary functions against fifty digits, and their bits against kept ones."""

import hashlib
import math
from collections.abc import Callable

import mpmath
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from utank_hil.base import elementary
from utank_hil.dynamics.jit import njit

mpmath.mp.dps = 50


def sine(x):
    return elementary.sine_cosine(x)[0]


def cosine(x):
    return elementary.sine_cosine(x)[1]


def arctan2(x):
    return elementary.arctan2(x, 1.7 - x)


def ulps(found, exact):
    return abs(float((found - exact) / math.ulp(float(exact))))


@given(st.floats(-708, 709))
def test_exp(x):
    assert ulps(elementary.exp(x), mpmath.exp(x)) < 1


@given(st.floats(1e-300, 1e300))
def test_log(x):
    assert elementary.log(x) == pytest.approx(math.log(x), rel=3e-16, abs=0)


@given(st.floats(-20, 20))
def test_tanh(x):
    assert elementary.tanh(x) == pytest.approx(math.tanh(x), rel=6e-16, abs=0)


@given(st.floats(-1e5, 1e5))
def test_sine_and_cosine(x):
    assert abs(sine(x) - mpmath.sin(x)) < 2e-16
    assert abs(cosine(x) - mpmath.cos(x)) < 2e-16


@given(st.floats(1e9, 1e16), st.sampled_from([-1, 1]))
def test_sine_and_cosine_of_large_angles(size, sign):
    x = sign * size
    assert abs(sine(x) - math.sin(x)) < 4e-17 * size + 4e-16
    assert abs(cosine(x) - math.cos(x)) < 4e-17 * size + 4e-16


@given(st.floats(allow_nan=False, allow_infinity=False))
def test_sine_and_cosine_of_any_finite_angle_are_a_point_of_the_circle(x):
    assert sine(x) ** 2 + cosine(x) ** 2 == pytest.approx(1, abs=1e-7)


@given(st.floats(-1e6, 1e6), st.floats(-1e6, 1e6))
def test_arctan2(y, x):
    assert elementary.arctan2(y, x) == pytest.approx(math.atan2(y, x), rel=6e-16, abs=1e-300)


@pytest.mark.parametrize(
    ("x", "expected"),
    [(0.0, 1.0), (710.0, math.inf), (-746.0, 0.0), (math.inf, math.inf), (-math.inf, 0.0)],
)
def test_exp_at_its_ends(x, expected):
    assert elementary.exp(x) == expected


def test_no_number_stays_none():
    assert math.isnan(elementary.exp(math.nan))
    assert math.isnan(elementary.tanh(math.nan))
    assert math.isnan(sine(math.nan))
    assert math.isnan(cosine(math.inf))


POINTS = np.linspace(-7.3, 7.9, 4001)
PLAIN: dict[str, Callable[[float], float]] = {
    "exp": elementary.exp,
    "log": elementary.log,
    "tanh": elementary.tanh,
    "sine": sine,
    "cosine": cosine,
    "arctan2": arctan2,
}
BITS = {
    "exp": "bff8438c1a4c5df1",
    "log": "57fa4aa0b370fdd4",
    "tanh": "fb889cb5b0c810ee",
    "sine": "43bcf39935204a2f",
    "cosine": "9795a6d6242782c2",
    "arctan2": "82c9906db0738d85",
}
"""Made on an AMD processor of 2020; any other one must give the same."""


@pytest.mark.parametrize("name", PLAIN)
def test_every_machine_gives_these_bits(name):
    found = elementary.each(PLAIN[name], np.abs(POINTS) if name == "log" else POINTS)
    assert hashlib.sha256(found.astype("<f8").tobytes()).hexdigest()[:16] == BITS[name]


@pytest.mark.parametrize("name", ["exp", "sine_cosine"])
def test_numba_gives_the_bits_of_plain_python(name):
    plain = getattr(elementary, name)
    compiled = njit(error_model="numpy")(plain)
    assert [compiled(x) for x in POINTS.tolist()] == [plain(x) for x in POINTS.tolist()]


def test_numba_gives_the_bits_of_plain_python_at_large_angles():
    compiled = njit(error_model="numpy")(elementary.sine_cosine)
    angles = [sign * 10.0**power for power in range(9, 309) for sign in (1, -1)]
    assert [compiled(x) for x in angles] == [elementary.sine_cosine(x) for x in angles]
