import math
from dataclasses import replace

import numpy as np
import pytest
from moving_ship import THRESHOLDS

from utank_hil.safety.monitors.finding import Finding
from utank_hil.safety.monitors.level_stuck import Volume

LIMIT_M = 0.5
QUIET = replace(THRESHOLDS, volume_m=LIMIT_M, level_noise_m=100.0)


@pytest.mark.parametrize("way", [-1, 1])
def test_the_first_sum_is_taken_as_it_is_and_judged_by_the_limit_and_three_times_it(way):
    def first(sum_m):
        volume = Volume(QUIET)
        found = volume.update(7.0 * way, (sum_m - 7.0) * way, 0.1)
        assert volume.sum_m == sum_m * way
        return found

    assert math.isnan(Volume(QUIET).sum_m)
    assert first(LIMIT_M) == 0
    assert first(1.0625 * LIMIT_M) == Finding.VOLUME
    assert first(3 * LIMIT_M) == Finding.VOLUME
    assert first(3.0625 * LIMIT_M) == Finding.VOLUME | Finding.VOLUME_LASTS


def test_a_sum_that_jumps_follows_with_two_seconds():
    volume = Volume(QUIET)
    assert volume.update(4.0, -4.0, 0.1) == 0
    for k in range(1, 40):
        found = volume.update(2 * LIMIT_M - 3.0, 3.0, 0.1)
        sum_m = 2 * LIMIT_M * (1 - 0.95**k)
        assert volume.sum_m == pytest.approx(sum_m)
        assert found == (Finding.VOLUME if sum_m > LIMIT_M else 0)


def test_it_lasts_after_thirty_seconds_without_a_break():
    volume = Volume(QUIET)
    updates = [volume.update(0.0, 2 * LIMIT_M, 0.5) for _ in range(60)]
    assert updates == [Finding.VOLUME] * 60
    assert volume.update(0.0, 2 * LIMIT_M, 0.5) == Finding.VOLUME | Finding.VOLUME_LASTS
    while volume.update(0.0, 0.0, 0.5):
        pass
    while volume.update(0.0, 2 * LIMIT_M, 0.5) != Finding.VOLUME:
        pass
    updates = [volume.update(0.0, 2 * LIMIT_M, 0.5) for _ in range(60)]
    assert updates == [Finding.VOLUME] * 59 + [Finding.VOLUME | Finding.VOLUME_LASTS]


def test_noise_is_what_the_smoothed_sum_leaves_of_the_sum():
    volume = Volume(replace(QUIET, level_noise_m=0.5))
    assert volume.update(1.0, -1.0, 0.7) == 0
    assert volume.update(1.0, -0.5, 0.7) == 0  # just the limit
    assert volume.update(1.0, -0.25, 0.7) == Finding.NOISE
    volume = Volume(replace(QUIET, level_noise_m=0.5))
    volume.update(0.0, 0.0, 0.7)
    assert volume.update(1.0, 1.0, 0.7) == Finding.NOISE | Finding.VOLUME
    assert volume.update(8.0, 8.0, 0.7) == (Finding.NOISE | Finding.VOLUME | Finding.VOLUME_LASTS)


def volume_findings(port_error_m, seconds, noise_m=0.005, port_noise_m=0.0):
    random, volume = np.random.default_rng(1), Volume(THRESHOLDS)
    found = []
    for k in range(round(seconds / 0.1)):
        level = 2.0 * math.sin(0.06 * k)
        port, starboard = (max(noise_m, port_noise_m), noise_m) * random.standard_normal(2)
        found.append(volume.update(port_error_m - level + port, level + starboard, 0.1))
    return found


def test_levels_that_mirror_one_another_are_left_alone():
    assert not any(volume_findings(0.0, 600))
    assert not any(volume_findings(0.8 * THRESHOLDS.volume_m, 60)[30:])


def test_a_gauge_that_is_off_degrades_and_ends_if_it_lasts_or_is_far_off():
    little = volume_findings(1.5 * THRESHOLDS.volume_m, 60)
    assert little[50] & Finding.VOLUME
    assert not little[50] & Finding.VOLUME_LASTS
    assert little[-1] & Finding.VOLUME_LASTS
    assert volume_findings(8 * THRESHOLDS.volume_m, 5)[-1] & Finding.VOLUME_LASTS


def test_noise_of_one_gauge_is_seen_from_four_times_its_figure():
    found = volume_findings(0.0, 60.0, port_noise_m=0.0225)
    assert np.mean([bool(each & Finding.NOISE) for each in found]) > 0.6
    assert not any(volume_findings(0.0, 600.0, port_noise_m=0.0075))


def test_noise_of_the_gauges_is_seen_in_their_sum():
    assert volume_findings(0.0, 2.0, noise_m=0.05)[-1] & Finding.NOISE
