import math

import numpy as np
import pytest

from utank_hil.sea import encounter_frequency


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
