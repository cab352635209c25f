import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from moving_ship import THRESHOLDS

from utank_hil.safety.monitors.noise import Noise, SecondDifference, within

LIMIT = 0.5


@given(st.floats(-1.0, 1.0), st.floats(0.01, 0.6), st.integers(1, 50))
def test_power_of_a_residual_follows_with_seven_tenths_of_a_second(residual, step_s, steps):
    noise = Noise(LIMIT)
    assert (noise.power, noise.found) == (0.0, False)
    for _ in range(steps):
        found = noise.update(residual, step_s)
    power = residual**2 * (1 - (1 - step_s / 0.7) ** steps)
    assert noise.power == pytest.approx(power, abs=1e-12)
    assert found is noise.found is (noise.power > LIMIT**2)


@pytest.mark.parametrize("step_s", [0.7, 1.0, 5.0])
def test_a_step_longer_than_its_memory_leaves_the_last_residual_alone(step_s):
    noise = Noise(LIMIT)
    assert noise.update(2 * LIMIT, step_s)
    assert noise.power == 4 * LIMIT**2
    assert not noise.update(-LIMIT, step_s)
    assert noise.power == LIMIT**2


@pytest.mark.parametrize("jump", [-1e9, -1.01, 1.01, 1e9])
def test_one_jump_counts_as_twice_the_limit(jump):
    noise = Noise(LIMIT)
    noise.update(jump, 0.07)
    assert noise.power == pytest.approx(0.1 * (2 * LIMIT) ** 2)
    assert not noise.found


@given(st.floats(-10, 10), st.floats(0, 5))
def test_a_value_is_cut_to_its_bounds(value, most):
    assert within(value, most) == min(max(value, -most), most)


@given(st.floats(-1, 1), st.floats(-1, 1), st.floats(-1, 1))
def test_second_difference_is_the_curvature_of_a_parabola_and_none_before_its_third_sample(a, b, c):
    bend = SecondDifference()
    for _ in range(2):
        values = [bend.update(a + b * k + c * k**2) for k in range(6)]
        assert values == pytest.approx([0, 0, 2 * c, 2 * c, 2 * c, 2 * c], abs=1e-12)
        bend.restart()


@pytest.mark.parametrize(("times", "expected"), [(1, False), (2, False), (10, True), (100, True)])
def test_noise_ten_times_the_figure_is_found_within_two_seconds(times, expected):
    random = np.random.default_rng(1)
    noise, smooth = Noise(math.sqrt(6) * THRESHOLDS.rate_noise_rad_s), SecondDifference()
    found = False
    for k in range(40):
        rate = 0.06 * math.sin(0.6 * 0.05 * k) + times * 5e-4 * random.standard_normal()
        found |= noise.update(smooth.update(rate), 0.05)
    assert found is expected
