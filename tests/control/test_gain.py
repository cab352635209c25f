"""A constant gain as a law of the loop: timing, reference, transfer matrix."""

import numpy as np
import pytest

from utank_hil.control.gain import GainLaw

LAW = GainLaw(np.array([[1.0, -2.0], [0.5, 3.0]]), 0.1)


def test_answer_is_minus_the_gain_times_measurement_less_reference():
    controller = LAW.controller()
    y = np.array([3.0, 1.0])
    np.testing.assert_array_equal(controller.step(y), [-1.0, -4.5])
    np.testing.assert_array_equal(controller.step(y, np.array([3.0, 0.0])), [2.0, -3.0])


def test_transfer_matrix_is_the_gain_one_sample_late_and_that_of_the_matrices():
    z = np.exp(1j * np.array([0.1, 1.0, 3.0]))
    a, b, c, d, dt = LAW.matrices()
    assert dt == LAW.sample_time_s == LAW.controller().sample_time_s
    for point, response in zip(z, LAW.response(z), strict=True):
        np.testing.assert_allclose(response, -LAW.gain / point)
        np.testing.assert_allclose(response, c @ np.linalg.solve(point * np.eye(2) - a, b) + d)


@pytest.mark.parametrize(
    ("gain", "sample_time_s", "message"),
    [
        ([[np.nan, 1.0]], 0.1, "gain must be a matrix of finite numbers"),
        ([[1.0, -np.inf]], 0.1, "gain must be"),
        ([1.0, 2.0], 0.1, "gain must be a matrix"),
        ([[1.0]], -0.1, "sample_time_s must be 0.001 to 10, got -0.1"),
        ([[1.0]], np.nan, "sample_time_s must be"),
    ],
)
def test_what_is_no_gain_or_no_time_is_refused_by_name(gain, sample_time_s, message):
    with pytest.raises(ValueError, match=message):
        GainLaw(np.array(gain), sample_time_s)
