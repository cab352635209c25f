"""Frequencies of regular waves in records of the ship."""

import numpy as np
import pytest
from roll_plant import FAST_PUMP, SAMPLE_TIME_S, jonswap_moment, noisy, plant, pulses

from utank_hil.identification import find_disturbance_frequencies

pytestmark = pytest.mark.slow


def _record(*waves, noise=0.01):
    u = pulses(1, FAST_PUMP)
    time_s = np.arange(len(u)) * SAMPLE_TIME_S
    moment = np.sum([m * np.cos(w * time_s + w) for m, w in waves], axis=0) + 0 * u
    y = plant().respond(u, moment)
    return u, noisy(y, noise, 3) if noise else y


@pytest.mark.evidence("0.6-0.0", "0.6-0.01")
@pytest.mark.parametrize("noise", [0.0, 0.01, 0.03])
@pytest.mark.parametrize("omega", [0.6, 0.8377])
def test_one_wave_is_found_to_a_fraction_of_a_cycle(noise, omega):
    found = find_disturbance_frequencies(*_record((2e7, omega), noise=noise), SAMPLE_TIME_S)
    assert found == pytest.approx([omega], abs=3e-4)  # a cycle over the record is 0.0126 rad/s


def test_two_waves_are_found_apart():
    far = find_disturbance_frequencies(*_record((2e7, 0.6), (1e7, 0.733)), SAMPLE_TIME_S)
    assert sorted(far) == pytest.approx([0.6, 0.733], abs=3e-4)
    near = find_disturbance_frequencies(*_record((2e7, 0.6), (1e7, 0.62)), SAMPLE_TIME_S)
    assert sorted(near) == pytest.approx([0.6, 0.62], abs=1e-3)


def test_a_gap_does_not_hide_a_wave():
    u, y = _record((2e7, 0.6))
    y[700:800] = np.nan
    assert find_disturbance_frequencies(u, y, sample_time_s=SAMPLE_TIME_S) == pytest.approx(
        [0.6], abs=3e-4
    )


def test_no_line_is_invented_in_calm_or_irregular_sea():
    assert find_disturbance_frequencies(*_record(), SAMPLE_TIME_S) == ()
    assert find_disturbance_frequencies(*_record(noise=0), SAMPLE_TIME_S) == ()
    u = pulses(1)
    y = noisy(plant().respond(u, jonswap_moment(len(u), 5)), 0.01, 3)
    assert find_disturbance_frequencies(u, y, sample_time_s=SAMPLE_TIME_S) == ()


def test_band_must_lie_below_the_nyquist_frequency():
    u, y = _record()
    with pytest.raises(ValueError, match="band_rad_s must rise"):
        find_disturbance_frequencies(u, y, band_rad_s=(0.2, 20.0), sample_time_s=SAMPLE_TIME_S)
    with pytest.raises(ValueError, match="band_rad_s must rise"):
        find_disturbance_frequencies(u, y, band_rad_s=(0.0, 1.0), sample_time_s=SAMPLE_TIME_S)
