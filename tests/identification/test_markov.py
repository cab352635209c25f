"""Pulse responses of an ARX model."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from utank_hil.control import ARX
from utank_hil.identification import markov_parameters


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
