"""Pulse responses of an ARX model, and their gradient."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from utank_hil.control import ARX
from utank_hil.identification import markov_parameters
from utank_hil.identification.okid import markov_gradient


def _arx(seed):
    rng = np.random.default_rng(seed)
    p, m, r = (int(v) for v in rng.integers(1, [6, 4, 4]))
    return ARX(
        0.3 / (p * m) * rng.standard_normal((p, m, m)), rng.standard_normal((p + 1, m, r)), 0.2
    )


@given(st.integers(0, 2**31), st.integers(1, 40))
def test_markov_parameters_are_the_pulse_response(seed, count):
    arx = _arx(seed)
    markov, observer_gain = markov_parameters(arx, count)
    for j in range(arx.inputs):
        pulse = np.zeros((count, arx.inputs))
        pulse[0, j] = 1.0
        np.testing.assert_allclose(markov[:, :, j], arx.simulate(pulse), atol=1e-12)
    # to a pulse in the prediction error: the response of y to one in the output itself
    error = ARX(arx.alpha, np.concatenate([np.eye(arx.outputs)[None], 0 * arx.alpha]), 0.2)
    response, _ = markov_parameters(error, count)
    np.testing.assert_allclose(observer_gain, response[1:], atol=1e-12)


@given(st.integers(0, 2**31))
def test_gradient_is_the_finite_difference(seed):
    arx = _arx(seed)
    rng = np.random.default_rng(seed)
    markov, _ = markov_parameters(arx, 25)
    weights = rng.standard_normal(markov.shape) + 1j * rng.standard_normal(markov.shape)
    slope = markov_gradient(arx, markov, weights)
    d_alpha, d_beta = rng.standard_normal(arx.alpha.shape), rng.standard_normal(arx.beta.shape)
    step = 1e-6
    ahead, _ = markov_parameters(ARX(arx.alpha + step * d_alpha, arx.beta + step * d_beta, 0.2), 25)
    behind, _ = markov_parameters(
        ARX(arx.alpha - step * d_alpha, arx.beta - step * d_beta, 0.2), 25
    )
    by_lag = np.concatenate([np.zeros((1, arx.outputs, arx.outputs)), d_alpha])
    direction = np.concatenate([by_lag, d_beta], axis=2).transpose(0, 2, 1)
    direction = direction.reshape(-1, arx.outputs)[arx.outputs :]
    expected = np.sum(weights * (ahead - behind)) / (2 * step)
    np.testing.assert_allclose(np.sum(slope * direction), expected, rtol=1e-5, atol=1e-5)
