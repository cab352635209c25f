import math

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from utank_hil.sea import encounter_frequency, wave_frequencies


def test_ship_in_head_sea_meets_crests_at_the_rate_of_geometry():
    # wave length and phase speed in deep water, crests passed per second by closing speed
    omega, speed = 0.7, 8.0
    length = 2 * math.pi * 9.80665 / omega**2
    phase_speed = 9.80665 / omega
    closing = 2 * math.pi * (phase_speed + speed) / length
    assert encounter_frequency(np.array(omega), math.pi, speed) == pytest.approx(closing)
    overtaking = 2 * math.pi * (phase_speed - 30.0) / length
    assert overtaking < 0
    assert encounter_frequency(np.array(omega), 0.0, 30.0) == pytest.approx(overtaking)


def test_beam_sea_and_ship_at_rest_meet_the_wave_frequency():
    omega = np.linspace(0.2, 2, 10)
    np.testing.assert_allclose(encounter_frequency(omega, math.pi / 2, 10.0), omega)
    np.testing.assert_array_equal(encounter_frequency(omega, 0.3, 0.0), omega)


@given(st.floats(0.05, 3.0), st.floats(-math.pi, math.pi), st.floats(0.0, 20.0))
def test_every_wave_frequency_found_is_met_at_the_encounter_frequency(encounter, heading, speed):
    assume(abs(speed * math.cos(heading)) > 1e-6 or speed == 0)
    found = wave_frequencies(encounter, heading, speed)
    assert found
    assert list(found) == sorted(found)
    for omega in found:
        met = abs(float(encounter_frequency(np.array(omega), heading, speed)))
        assert met == pytest.approx(encounter, rel=1e-6)


@given(st.floats(0.1, 2.5), st.floats(0.0, 1.5), st.floats(0.5, 20.0))
def test_the_wave_itself_is_among_those_found_in_a_following_sea(omega, heading, speed):
    encounter = abs(float(encounter_frequency(np.array(omega), heading, speed)))
    assume(encounter > 1e-3)
    found = wave_frequencies(encounter, heading, speed)
    assert min(abs(other - omega) for other in found) < 1e-5


def test_following_sea_is_ambiguous_three_ways_and_head_sea_is_not():
    assert len(wave_frequencies(0.1, 0.0, 10.0)) == 3
    assert len(wave_frequencies(2.0, 0.0, 10.0)) == 1
    assert len(wave_frequencies(0.1, math.pi, 10.0)) == 1
    assert wave_frequencies(0.4, 0.0, 0.0) == (0.4,)
    with pytest.raises(ValueError, match="encounter_rad_s"):
        wave_frequencies(0.0, 0.0, 1.0)
