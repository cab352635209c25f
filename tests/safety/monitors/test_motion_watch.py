"""What is judged of one motion sensor."""

import math
from dataclasses import replace

import numpy as np
import pytest
from moving_ship import THRESHOLDS

from utank_hil.base.tick import TICK_S
from utank_hil.canbus.measurements import MotionSample
from utank_hil.safety.monitors.finding import Finding
from utank_hil.safety.monitors.motion import MotionWatch

STEP_S = 0.05
LOOSE = replace(THRESHOLDS, drift_rad=100.0, roll_noise_rad=100.0, rate_noise_rad_s=100.0)


def turn(watch, t, jerk=0.0):
    """Hold each rate of a roll that turns faster and faster for a tick; the roll at the end."""
    for k in range(1, 6):
        rate_rad_s = 0.1 + 0.02 * (t + k * TICK_S)
        watch.turn(MotionSample(0.0, rate_rad_s, round(1e9 * (t + k * TICK_S))), TICK_S)
    end_s = t + STEP_S
    roll_rad = 0.1 * end_s + 0.01 * end_s**2
    watch.update(MotionSample(roll_rad, 0.1 + 0.02 * end_s + jerk), STEP_S, stale=False)
    return roll_rad


def test_rates_held_for_a_tick_each_make_the_trapezoid_of_a_rate_that_grows_evenly():
    watch, last_rad = MotionWatch(LOOSE), 0.0
    assert watch.found == 0
    watch.update(MotionSample(0.0, 0.1), STEP_S, stale=False)
    for k in range(40):
        last_rad = turn(watch, k * STEP_S)
        assert watch.motion.unexplained_rad == pytest.approx(0.0, abs=1e-12)
    # what came while it was late is no part of the next step
    watch.turn(MotionSample(0.0, 77.0, -1), 1.0)
    watch.update(MotionSample(-9.0, 0.1 + 0.02 * 40 * STEP_S), STEP_S, stale=True)
    watch.update(MotionSample(last_rad, 0.1 + 0.02 * 40 * STEP_S), STEP_S, stale=False)
    turn(watch, 40 * STEP_S)
    assert watch.motion.unexplained_rad == pytest.approx(0.0, abs=1e-12)


@pytest.mark.parametrize(("share", "found"), [(0.97, 0), (1.03, Finding.NOISE)])
def test_noise_of_the_rate_is_its_second_difference_over_the_square_root_of_six(share, found):
    """Of a rate that goes to and fro by a it is 4 a."""
    watch = MotionWatch(replace(LOOSE, rate_noise_rad_s=0.1))
    a = share * math.sqrt(6) * 0.1 / 4
    for k in range(10):
        watch.update(MotionSample(0.0, a * (-1) ** k), 0.7, stale=False)
    assert watch.found == found
    assert watch.rate_noise.power == pytest.approx((4 * a) ** 2)
    # a gap is no noise, and found is only what is
    watch.update(MotionSample(0.0, 99.0), 0.7, stale=True)
    assert watch.found == 0
    for _ in range(2):
        watch.update(MotionSample(0.0, 50.0), 0.7, stale=False)
        assert watch.rate_noise.power == 0.0


def spiked(spikes, rate_noise_rad_s):
    watch = MotionWatch(replace(LOOSE, rate_noise_rad_s=rate_noise_rad_s))
    for k in range(4):
        sample = MotionSample(0.0, 0.1 * (-1) ** k, discarded=spikes)
        watch.update(sample, 0.1, stale=False)
    return watch.found


def test_spikes_of_its_gate_are_found_unless_they_are_noise():
    assert spiked(4, 100.0) == 0
    assert spiked(5, 100.0) == Finding.SPIKES
    assert spiked(4, 1e-3) == spiked(5, 1e-3) == Finding.NOISE


def test_what_the_roll_says_against_the_rate_is_found_beside_the_noise():
    watch = MotionWatch(replace(LOOSE, drift_rad=0.01, rate_noise_rad_s=0.1))
    for k in range(10):
        watch.update(MotionSample(0.1 * k, (-1) ** k), 0.7, stale=False)
    assert watch.found & Finding.DRIFT
    assert watch.found & Finding.NOISE
    watch.update(MotionSample(0.0, 0.0), 0.7, stale=True)
    watch.update(MotionSample(0.5, 0.0), 0.7, stale=False)
    watch.update(MotionSample(0.5, 0.0), 0.7, stale=False)
    assert not watch.found & Finding.DRIFT


@pytest.mark.parametrize("cycle_s", [0.05, 0.0505])
@pytest.mark.parametrize(("noise", "found"), [(1.0, 0), (12.0, Finding.NOISE)])
def test_a_sensor_of_20_hz_is_as_noisy_as_its_samples(cycle_s, noise, found):
    """A roll of 0.3 rad at 10 s; samples come up to 8 ms late, looks are each 50 ms."""
    watch, draw = MotionWatch(THRESHOLDS, 0.05), np.random.default_rng(2)
    w, next_s, sample = 2 * math.pi / 10, 0.0, MotionSample()
    seen = []
    for tick in range(6000):
        now_s = tick * TICK_S
        if now_s >= next_s + draw.uniform(0, 0.008):
            roll_rad = 0.3 * math.sin(w * next_s) + noise * 2e-4 * draw.standard_normal()
            rate_rad_s = 0.3 * w * math.cos(w * next_s) + 5e-4 * draw.standard_normal()
            sample = MotionSample(roll_rad, rate_rad_s, round(1e9 * now_s) + 1)
            next_s += cycle_s
        watch.turn(sample, TICK_S)
        if tick % 5 == 4:
            watch.update(sample, 0.05, stale=False)
            seen.append(watch.found & Finding.NOISE)
    assert set(seen[100:]) == {found}


def test_samples_that_are_not_equally_far_apart_are_no_noise():
    """A roll of 0.3 rad at 10 s, sound; a sample after 60 and 90 ms in turn, looks are each 50 ms.

    Its second difference by equal steps would be up to 0.03 s times the rate, 6 mrad.
    """
    watch, w, due_ticks, seen = MotionWatch(THRESHOLDS, 0.04), 2 * math.pi / 10, 0, set()
    sample = MotionSample()
    for tick in range(3000):
        if tick >= due_ticks:
            now_s = tick * TICK_S
            roll_rad, rate_rad_s = 0.3 * math.sin(w * now_s), 0.3 * w * math.cos(w * now_s)
            sample = MotionSample(roll_rad, rate_rad_s, round(1e9 * now_s) + 1)
            due_ticks = tick + (6, 9)[tick % 15 // 6 % 2]
        watch.turn(sample, TICK_S)
        if tick % 5 == 4:
            watch.update(sample, 0.05, stale=False)
            seen.add(watch.found)
    assert seen <= {0, Finding.DRIFT}


def test_the_rate_after_a_gap_counts_for_the_whole_gap():
    """As long as the roll of that sample is away from the one before."""
    watch = MotionWatch(LOOSE, 0.1)
    for tick, (roll_rad, rate_rad_s, heard) in enumerate(
        [(0.0, 0.0, 1)] * 10 + [(0.02, 0.2, 2)] * 10 + [(0.02, 0.0, 3)] * 10
    ):
        sample = MotionSample(roll_rad, rate_rad_s, heard * 100_000_000)
        watch.turn(sample, TICK_S)
        if tick % 10 == 0:
            watch.update(sample, 0.1, stale=False)
            # a trapezoid has half of it on either side
            due_rad = {0: 0.0, 10: 0.02 - 0.01, 20: 0.02 - 0.02}[tick]
            assert watch.motion.unexplained_rad == pytest.approx(due_rad, abs=3e-4)


def found_dead(samples, period_s=10.0, *, water_moves=True):
    """Time of the samples, 50 ms apart, until they are found to repeat themselves."""
    watch = MotionWatch(replace(LOOSE, tank_period_s=period_s))
    for k, (roll_rad, rate_rad_s) in enumerate(samples):
        sample = MotionSample(roll_rad, rate_rad_s)
        watch.update(sample, STEP_S, stale=False, water_moves=water_moves)
        if watch.found & Finding.ROLL_STUCK:
            return k * STEP_S
    return math.inf


@pytest.mark.parametrize(("period_s", "within_s"), [(22.0, 4.4), (10.0, 2.0), (3.0, 1.0)])
@pytest.mark.parametrize("at", [(0.0, 0.0), (0.1, -0.02)])
def test_a_sensor_that_repeats_itself_is_dead_after_a_fifth_of_a_period_or_a_second(
    period_s, within_s, at
):
    assert found_dead([at] * 100, period_s) == pytest.approx(within_s, abs=1.1 * STEP_S)
    assert found_dead([at] * 100, period_s, water_moves=False) == math.inf


def test_a_digit_of_either_signal_in_each_fifth_of_a_period_is_alive():
    for digit in ((1e-4, 0.0), (0.0, 3e-5)):
        assert found_dead(([(0.0, 0.0)] * 20 + [digit] * 20) * 9) == math.inf


def test_a_held_ship_has_a_sensor_with_noise():
    """Digits of SENSOR_MOTION: 1e-4 rad and 3.125e-5 rad/s."""
    draw = np.random.default_rng(4)
    noise = draw.standard_normal((36000, 2)) * [2e-4, 5e-4]
    assert found_dead([(round(a, 4), round(b / 3.125e-5)) for a, b in noise]) == math.inf
