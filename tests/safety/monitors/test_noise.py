import math
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from moving_ship import THRESHOLDS
from scipy import stats

from utank_hil.configuration import ControllerConfig, load_config
from utank_hil.safety.monitors.noise import (
    DerivativeFilter,
    Noise,
    SecondDifference,
    most_pushes_of_noise,
    within,
)
from utank_hil.safety.monitors.tank_equation import MEMORY_PERIODS, STILL_PUSHES
from utank_hil.safety.monitors.thresholds import thresholds_of

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


def pushes_of_noise(period_s, hours=10):
    """What gauges of unit push look like to a tank of this period: the greatest, two ways."""
    w0, step_s = 2 * math.pi / period_s, 0.1
    keep = math.exp(-step_s / (MEMORY_PERIODS * period_s))
    turn = keep * np.exp(1j * w0 * step_s)
    noise = DerivativeFilter(2 * w0, step_s)
    like_roll = power = most_power = 0.0
    now = 0j
    for sample in np.random.default_rng(71).normal(size=round(36e3 * hours)).tolist():
        push = noise.update(sample) / w0**2 + 0.2 * noise.rate / w0 + noise.value
        now = turn * now + push  # its product with a roll that is at its greatest now
        like_roll = max(like_roll, abs(now.real))
        power = keep * power + push * push
        most_power = max(most_power, power)
    return math.sqrt(2) * like_roll * (1 - keep), math.sqrt(most_power * (1 - keep))


@pytest.mark.parametrize("period_s", [3.2, 11.0])
def test_ten_hours_of_the_gauges_noise_stay_below_what_a_thousand_hours_may_reach(period_s):
    found = pushes_of_noise(period_s)
    most = most_pushes_of_noise(1.0, MEMORY_PERIODS * period_s / 0.1)
    assert 0.6 * most[0] < found[0] < most[0]
    assert 0.75 * most[1] < found[1] < most[1]


@pytest.mark.parametrize("name", ["gpc", "naval_constrained_gpc", "patti_b_constrained_gpc"])
def test_the_gauges_of_a_shipped_ship_hide_no_roll(name):
    config = load_config(Path(f"configs/controllers/{name}.yaml"), ControllerConfig)
    found = thresholds_of(config.plant, config.safety.roll_limit_rad, config.sensors)
    samples = MEMORY_PERIODS * found.tank_period_s / 0.1
    like_roll, whole = most_pushes_of_noise(found.gauge_push_m2_s2, samples)
    assert like_roll < found.least_roll_push_m2_s2
    assert whole < STILL_PUSHES * found.least_roll_push_m2_s2


@pytest.mark.parametrize("steps_s", [(0.05, 0.05), (0.04, 0.1), (0.1, 0.04)])
def test_the_second_difference_of_uneven_steps_leaves_no_line_and_noise_as_that_of_even_ones(
    steps_s,
):
    """Noise in each of the three samples counts by its weight: 1, -2, 1 make the square root of 6.

    A weight is what a sample of one among zeros leaves.
    """

    def left(*samples):
        bend = SecondDifference()
        assert bend.update_after(samples[0], 7.0) == 0.0
        assert bend.update_after(samples[1], steps_s[0]) == 0.0
        return bend.update_after(samples[2], steps_s[1])

    at = 0.0, steps_s[0], sum(steps_s)
    assert left(*(3.0 - 2.0 * each for each in at)) == pytest.approx(0.0, abs=1e-12)
    weights = np.array([left(1.0, 0.0, 0.0), left(0.0, 1.0, 0.0), left(0.0, 0.0, 1.0)])
    assert np.linalg.norm(weights) == pytest.approx(math.sqrt(6))
    assert weights @ at == pytest.approx(0.0, abs=1e-12)
    assert weights[2] > 0
    if steps_s[0] == steps_s[1]:
        assert weights == pytest.approx([1.0, -2.0, 1.0])


def test_after_a_gap_three_samples_are_needed_again():
    bend = SecondDifference()
    for k in range(3):
        bend.update_after(k**2, 0.1)
    bend.restart()
    assert [bend.update_after(k**2, 0.1) for k in (9, 11)] == [0.0, 0.0]
    assert bend.update_after(14, 0.1) != 0.0


@pytest.mark.parametrize("ratio", [0.5, 1.0])
def test_at_its_frequency_the_filter_leaves_one_over_twice_the_damping_ratio(ratio):
    found, w = DerivativeFilter(1.3, 0.01, ratio), 1.3
    assert (found.value, found.update(0.0)) == (0.0, 0.0)
    values, bends = [], []
    for k in range(1, 5000):
        bends.append(found.update(math.sin(w * 0.01 * k)))
        values.append(found.value)
    assert max(values[-1000:]) == pytest.approx(1 / (2 * ratio), rel=1e-3)
    assert max(bends[-1000:]) == pytest.approx(w**2 / (2 * ratio), rel=1e-2)


@pytest.mark.parametrize("samples", [5, 20, 43])
def test_most_of_the_noise_is_that_of_its_distribution(samples):
    """A part in phase is normal, a mean square chi-squared with two degrees a sample (scipy)."""
    tail = stats.norm.sf(5.4)
    like_roll, whole = most_pushes_of_noise(0.1, samples)
    assert like_roll == pytest.approx(stats.norm.isf(tail) * 1.2 * 0.1 / math.sqrt(samples))
    mean_square = stats.chi2.isf(tail, 2 * samples) / (2 * samples)
    assert whole == pytest.approx(
        4 * 0.1 * math.sqrt(mean_square), rel=0.005 if samples > 5 else 0.02
    )
