"""Two motion sensors side by side, to the update."""

import math
from dataclasses import replace

import pytest
from moving_ship import THRESHOLDS

from utank_hil.safety.monitors.finding import Finding
from utank_hil.safety.monitors.motion import MotionPair

PERIOD_S = 10.0
MOUNTED_RAD = math.radians(0.5)
# the noise of a sample takes as much of each limit as the mounting
BOUNDS = replace(
    THRESHOLDS,
    tank_period_s=PERIOD_S,
    roll_noise_rad=5 * MOUNTED_RAD / 3,
    rate_noise_rad_s=5 * 2 * (2 * math.pi / PERIOD_S) * MOUNTED_RAD / 3,
)
ROLL_LIMIT_RAD = 2 * MOUNTED_RAD
RATE_LIMIT_RAD_S = 4 * (2 * math.pi / PERIOD_S) * MOUNTED_RAD
APART_RAD = 2 * ROLL_LIMIT_RAD
DISAGREE = Finding.SENSORS_DISAGREE


def found(times, apart_rad, rate_rad_s=0.0, step_s=0.25):
    pair = MotionPair(BOUNDS, step_s)
    return [pair.update(apart_rad, rate_rad_s) for _ in range(times)]


@pytest.mark.parametrize("way", [-1, 1])
def test_roll_or_rate_apart_by_more_than_mounting_and_noise_disagree(way):
    for roll, rate, last in ((0.98, 0.98, 0), (1.02, 0.0, DISAGREE), (0.0, 1.02, DISAGREE)):
        assert found(20, way * roll * ROLL_LIMIT_RAD, way * rate * RATE_LIMIT_RAD_S)[-1] == last


@pytest.mark.parametrize(("step_s", "updates"), [(0.15, 2), (0.1, 3), (0.3, 1)])
def test_a_difference_counts_after_three_tenths_of_a_second(step_s, updates):
    # so far apart that the low-pass is over its limit from the first step on
    far = found(updates, 10 * ROLL_LIMIT_RAD, step_s=step_s)
    assert far == [0] * (updates - 1) + [DISAGREE]


def test_differences_are_smoothed_with_a_quarter_of_a_second():
    pair = MotionPair(BOUNDS, 0.05)
    beats = [pair.update(3 * ROLL_LIMIT_RAD * (-1) ** k, 0.0) for k in range(100)]
    assert not any(beats)
    assert pair._roll_rad < 0.4 * ROLL_LIMIT_RAD


def test_they_are_not_compared_while_one_is_silent():
    pair = MotionPair(BOUNDS, 0.1)
    assert [pair.update(APART_RAD * 9, 0.0) for _ in range(3)][-1] == DISAGREE
    assert pair.update(math.nan, math.nan) == 0
    assert [pair.update(APART_RAD * 9, 0.0) for _ in range(3)] == [0, 0, DISAGREE]
