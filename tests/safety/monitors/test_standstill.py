"""A gauge that had noise and sends one level only; one without noise may stand still."""

import math

import numpy as np
import pytest

from utank_hil.safety.monitors.standstill import Standstill, gauges_stand_still

STEP_S = 0.02


def levels(seconds: float, noise_m: float, swing_m: float, omega_rad_s: float) -> list[float]:
    """Water that swings, as a gauge sends it: in millimetres."""
    time_s = np.arange(0.0, seconds, STEP_S)
    draw = np.random.default_rng(1)
    level_m = swing_m * np.sin(omega_rad_s * time_s) + noise_m * draw.standard_normal(len(time_s))
    return [float(each) for each in np.round(level_m, 3)]


def taken(samples: list[float]) -> tuple[Standstill, list[int]]:
    gauge = Standstill()
    seen = []
    for level_m in samples:
        gauge.take(level_m)
        seen.append(gauge.still)
    return gauge, seen


@pytest.mark.parametrize("noise_m", [3e-3, 5e-3, 2e-2])
@pytest.mark.parametrize("swing_m", [0.0, 0.05, 1.0])
def test_a_gauge_with_noise_stands_still_after_ten_levels_that_are_the_same(
    noise_m: float, swing_m: float
) -> None:
    gauge, seen = taken(levels(120.0, noise_m, swing_m, 0.8))
    assert not any(seen)
    last_m = 3.0
    gauge.take(last_m)
    for same in range(1, 100):
        gauge.take(last_m)
        assert gauge.still == (same if same >= 10 else 0)
    gauge.take(last_m + 1e-3)
    assert gauge.still == 0


@pytest.mark.parametrize("omega_rad_s", [0.2, 0.5, 1.0, 2.0])
@pytest.mark.parametrize("swing_m", [0.0, 0.01, 0.1, 0.5, 1.5])
def test_without_noise_it_does_not_nor_where_the_water_stands_still(
    swing_m: float, omega_rad_s: float
) -> None:
    still = [0.3] * 500
    _, seen = taken(levels(600.0, 0.0, swing_m, omega_rad_s) + still)
    assert not any(seen)


def test_noise_of_less_than_a_step_of_the_message_says_nothing() -> None:
    _, seen = taken([*levels(600.0, 3e-4, 0.3, 0.5), *([0.3] * 500)])
    assert not any(seen)


def test_a_gauge_that_sends_each_level_twice_or_five_times_does_not_stand_still() -> None:
    for times in (2, 5):
        repeated = [each for each in levels(300.0, 5e-3, 0.3, 0.5) for _ in range(times)]
        assert not any(taken(repeated)[1])


def test_at_the_start_nothing_is_known_of_its_noise() -> None:
    assert not any(taken([math.nan, *([0.1] * 100)])[1])


@pytest.mark.parametrize(("noisy_of_20", "still"), [(13, False), (17, True)])
def test_two_of_three_levels_off_the_line_are_too_few_and_five_of_six_enough(
    noisy_of_20: int, still: bool
) -> None:
    gauge, level_m = Standstill(), 0.0
    for k in range(2000):
        # the step from the last one is off by 2 mm, or the same again
        step_m = 1e-3 * (-1) ** k if k % 20 < noisy_of_20 else gauge._step_m
        level_m += step_m
        gauge.take(level_m)
    for _ in range(10):
        gauge.take(level_m)
    assert bool(gauge.still) == still


@pytest.mark.parametrize(("jerk_m", "still"), [(1.48e-3, False), (1.52e-3, True)])
def test_noise_is_off_the_line_by_more_than_a_step_of_the_message(
    jerk_m: float, still: bool
) -> None:
    gauge = Standstill()
    for k in range(2000):
        gauge.take(jerk_m / 2 * (k % 2))
    for _ in range(10 + 1):
        gauge.take(jerk_m)
    assert bool(gauge.still) == still


def test_noise_counts_after_a_second_and_a_half() -> None:
    for levels_before, still in ((110, False), (140, True)):
        gauge = Standstill()
        for k in range(levels_before):
            gauge.take(5e-3 * (k % 2))
        for _ in range(10 + 1):
            gauge.take(0.0)
        assert bool(gauge.still) == still


def test_both_have_to_or_one_for_twice_as_long() -> None:
    for one, other, found in (
        (0, 0, False), (10, 0, False), (10, 10, True),
        (14 - 1, 0, False), (14, 0, True), (0, 14, True),
        (0, 14 - 1, False),
    ):  # fmt: skip
        assert gauges_stand_still(one, other) == found
