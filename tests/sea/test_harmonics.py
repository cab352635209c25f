import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from utank_hil.sea import Harmonics, Sea, jonswap


@pytest.fixture(scope="module")
def elevation():
    return Sea.irregular(jonswap(4.7, 10.0), seed=7).elevation


def test_direct_sum_is_the_definition():
    one = Harmonics(np.array([2.0, 0.5]), np.array([0.7, 1.3]), np.array([0.1, -2.0]))
    t = 3.7
    expected = 2.0 * math.cos(0.7 * t + 0.1) + 0.5 * math.cos(1.3 * t - 2.0)
    assert one.at(t) == pytest.approx(expected, rel=1e-14)
    assert one.at(np.full((2, 3), t)).shape == (2, 3)
    assert one.variance == pytest.approx((4 + 0.25) / 2)


def test_direct_sum_does_not_depend_on_how_it_is_cut(elevation):
    times = np.linspace(0, 500, 3001)  # several blocks
    np.testing.assert_allclose(elevation.at(times)[::1500], elevation.at(times[::1500]), rtol=1e-12)


@given(st.integers(0, 300), st.floats(1e-3, 10.0))
def test_series_is_the_direct_sum_on_any_grid(elevation, count, step):
    times = step * np.arange(count)
    assert np.max(np.abs(elevation.series(step, count) - elevation.at(times)), initial=0) < 1e-9


def test_an_hour_at_100_hz_is_exact(elevation):
    series = elevation.series(0.01, 360_000)
    sample = np.arange(0, 360_000, 997)
    assert np.max(np.abs(series[sample] - elevation.at(sample * 0.01))) < 1e-9


def test_phasors_turned_step_by_step_give_the_series(elevation):
    """The way of the plant emulator, as its interface promises."""
    phasor = elevation.amplitude * np.exp(1j * elevation.phase_rad)
    turn = np.exp(1j * elevation.frequency_rad_s * 0.01)
    stepped = np.empty(2000)
    for index in range(2000):
        stepped[index] = phasor.real.sum()
        phasor = phasor * turn
    np.testing.assert_allclose(stepped, elevation.series(0.01, 2000), atol=1e-9)


def test_bad_grids_are_refused(elevation):
    for step, count in ((0.0, 10), (-1.0, 10), (math.nan, 10), (0.1, -1)):
        with pytest.raises(ValueError, match="positive step"):
            elevation.series(step, count)
