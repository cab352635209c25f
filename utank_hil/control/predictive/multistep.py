"""Multi-step output prediction with an ARX model, thesis (3.7)."""

from dataclasses import dataclass

import numpy as np

from utank_hil.base.arrays import FloatArray
from utank_hil.control.arx import ARX


@dataclass(frozen=True, slots=True, eq=False)
class Prediction:
    """Coefficients of y(k) ... y(k + hp - 1) on past (newest first) and future.

    ::

        y(k+q) = sum_i outputs[q, i-1] y(k-i) + sum_i inputs[q, i-1] u(k-i)
                 + sum_{j=0..q} markov[q-j] u(k+j)
    """

    outputs: FloatArray  #: shape (hp, p, m, m)
    inputs: FloatArray  #: shape (hp, p, m, r)
    #: shape (hp, m, r): response of the output q samples after a unit pulse of an input.
    markov: FloatArray

    def future_inputs(self, control_horizon: int) -> FloatArray:
        """Matrix tau_c, shape (hp m, hc r): effect of u(k) ... u(k + hc - 1), zero after."""
        horizon, outputs, inputs = self.markov.shape
        tau = np.zeros((horizon, outputs, control_horizon, inputs))
        for j in range(min(control_horizon, horizon)):
            tau[j:, :, j, :] = self.markov[: horizon - j]
        return tau.reshape(horizon * outputs, control_horizon * inputs)


def predict(arx: ARX, horizon: int) -> Prediction:
    """Run the recursions under (3.7) over `horizon` samples."""
    if horizon < 1:
        raise ValueError(f"prediction horizon must be at least 1, got {horizon}")
    outputs = np.empty((horizon, *arx.alpha.shape))
    inputs = np.empty((horizon, *arx.beta[1:].shape))
    markov = np.empty((horizon, *arx.beta[0].shape))
    outputs[0], inputs[0], markov[0] = arx.alpha, arx.beta[1:], arx.beta[0]
    for q in range(1, horizon):
        newest = outputs[q - 1, 0]
        markov[q] = inputs[q - 1, 0] + newest @ arx.beta[0]
        outputs[q] = newest @ arx.alpha
        outputs[q, :-1] += outputs[q - 1, 1:]
        inputs[q] = newest @ arx.beta[1:]
        inputs[q, :-1] += inputs[q - 1, 1:]
    return Prediction(outputs, inputs, markov)
