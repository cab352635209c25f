"""ERA on exact Markov parameters, and on those that noise has touched."""

import control
import numpy as np
import pytest
from roll_plant import noisy, plant, pulses, response_error

from utank_hil.identification import IdentificationError, era, okid


def _noisy_markov(seed, order=60):
    u, truth = pulses(seed), plant()
    y = noisy(truth.respond(u, np.zeros_like(u)), 0.02, seed)
    return okid(u, y, order, sample_time_s=0.2).markov


def test_exact_markov_parameters_give_the_system_back():
    truth = plant()
    assert response_error(era(truth.markov(401), 4, sample_time_s=0.2), truth).max() < 1e-9
    assert response_error(era(truth.markov(150), sample_time_s=0.2), truth).max() < 1e-9


def test_feed_through_and_any_shape_come_through():
    rng = np.random.default_rng(4)
    system = control.ss(
        np.diag([0.9, -0.5, 0.3]),
        rng.standard_normal((3, 2)),
        rng.standard_normal((3, 3)),
        rng.standard_normal((3, 2)),
        0.5,
    )
    markov = np.array(
        [system.D]
        + [
            system.C @ np.diag([0.9, -0.5, 0.3]) ** k @ system.B
            if k == 0
            else system.C @ np.diag(np.array([0.9, -0.5, 0.3]) ** k) @ system.B
            for k in range(40)
        ]
    )
    markov[1] = system.C @ system.B
    found = era(markov, 3, sample_time_s=0.5)
    assert found.dt == 0.5
    np.testing.assert_allclose(np.sort(found.poles().real), [-0.5, 0.3, 0.9], atol=1e-10)
    np.testing.assert_allclose(found.dcgain(), system.dcgain(), atol=1e-9)


def test_singular_values_tell_the_order():
    for markov in (plant().markov(401), _noisy_markov(1)):
        assert era(markov, sample_time_s=0.2).nstates == 4


def test_window_shorter_than_a_roll_period_is_worse():
    markov = _noisy_markov(1)
    wide = response_error(era(markov, 4, sample_time_s=0.2), plant()).max()
    narrow = response_error(era(markov[:31], 4, sample_time_s=0.2), plant()).max()
    assert narrow > 5 * wide


def test_scaling_of_outputs_and_inputs_does_not_matter():
    markov = _noisy_markov(1)
    factors = np.array([[1e6], [1e-3]])
    one, other = era(markov, 4, sample_time_s=0.2), era(markov * factors, 4, sample_time_s=0.2)
    np.testing.assert_allclose(np.sort_complex(one.poles()), np.sort_complex(other.poles()))


def test_bad_requests_are_refused():
    markov = plant().markov(101)
    with pytest.raises(ValueError, match="from 1 to 4"):
        era(markov, 5, sample_time_s=0.2)
    with pytest.raises(ValueError, match="from 1 to 4"):
        era(markov, 0, sample_time_s=0.2)
    with pytest.raises(ValueError, match=r"shape \(K, m, r\)"):
        era(markov[:, :, 0], sample_time_s=0.2)
    with pytest.raises(ValueError, match="finite"):
        era(markov * np.nan, sample_time_s=0.2)
    with pytest.raises(IdentificationError, match="moves no output"):
        era(np.zeros((10, 1, 1)), 1, sample_time_s=0.2)
