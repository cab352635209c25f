"""The thesis's scenario (Fig. 3.11-3.15): the roll period falls from 12.5 s to 7.5 s, and the ship
is identified from 200 s to 700 s with random pulses under a regular beam sea."""

import numpy as np
import pytest
from roll_plant import SAMPLE_TIME_S, SLOW_PUMP, jonswap_moment, noisy, plant, pulses, realized

from utank_hil.identification import find_disturbance_frequencies, modal_parameters, okid

pytestmark = pytest.mark.slow


def _sea(kind, samples):
    time_s = 200.0 + np.arange(samples) * SAMPLE_TIME_S
    if kind == "regular":
        return 2e7 * np.cos(0.8 * time_s + 0.7)
    return jonswap_moment(samples, 11)


@pytest.mark.parametrize(
    ("outputs", "order", "sea", "frequency_error", "damping_error"),
    [
        (2, 120, "regular", 0.002, 0.001),
        (1, 200, "regular", 0.005, 0.003),
        (2, 120, "irregular", 0.06, 0.02),
    ],
)
def test_ship_is_found_again_after_loading(outputs, order, sea, frequency_error, damping_error):
    truth, u = plant(period_s=7.5), pulses(4, SLOW_PUMP)
    y = noisy(truth.respond(u, _sea(sea, len(u))), 0.01, 6)[:, :outputs]
    waves = find_disturbance_frequencies(u, y, sample_time_s=SAMPLE_TIME_S, most=1)
    assert waves == (pytest.approx((0.8,), abs=5e-4) if sea == "regular" else ())
    result = okid(u, y, order, disturbance_frequencies_rad_s=waves, sample_time_s=SAMPLE_TIME_S)
    modes = modal_parameters(realized(result, 4))
    right = truth.poles_rad_s()
    assert modes.frequency_rad_s == pytest.approx(np.abs(right), rel=frequency_error)
    damping = -right.real / np.abs(right)
    assert modes.damping_ratio == pytest.approx(damping, abs=damping_error)
