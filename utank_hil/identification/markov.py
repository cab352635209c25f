"""Markov parameters (pulse response) of an ARX model.

::

    Y_0 = beta_0,    Y_k  = beta_k + sum_{i=1..min(k,p)} alpha_i Y_{k-i}
                     Yo_k = alpha_k + sum_{i=1..min(k-1,p)} alpha_i Yo_{k-i}

Y_k = C A^(k-1) B are the system's Markov parameters and Yo_k = C A^(k-1) K those of its observer
x(k+1) = A x + B u + K (y - C x - D u); K is -G of the thesis (3.10). Juang, Applied System
Identification, 6.3. Beyond p the terms beta_k and alpha_k are zero.
"""

import numpy as np

from utank_hil.base.arrays import FloatArray
from utank_hil.control.arx import ARX


def markov_parameters(arx: ARX, count: int) -> tuple[FloatArray, FloatArray]:
    """Return K = `count` Markov parameters of the system and of the observer gain.

    The parameters of the system, shape (K, m, r), are D, then C A^(k-1) B; those of the observer,
    shape (K - 1, m, m), C A^(k-1) K.
    """
    p, m, r = arx.order, arx.outputs, arx.inputs
    # Both recursions run at once, newest first, so that the last p responses are contiguous.
    newest_first = np.zeros((count + p, m, r + m))
    known = min(count, p + 1)
    newest_first[count - known : count, :, :r] = arx.beta[:known][::-1]
    newest_first[count - known : count - 1, :, r:] = arx.alpha[: known - 1][::-1]
    alphas = np.ascontiguousarray(arx.alpha.transpose(1, 0, 2).reshape(m, p * m))
    past = newest_first.reshape(-1, r + m)
    for k in range(1, count):
        first = count - k  # This is the row block of response k - 1.
        newest_first[first - 1] += alphas @ past[first * m : (first + p) * m]
    responses = newest_first[:count][::-1]
    return responses[:, :, :r].copy(), responses[1:, :, r:].copy()


def markov_gradient(arx: ARX, markov: FloatArray, weights: np.ndarray) -> np.ndarray:
    """Gradient of sum_k <weights_k, Y_k> with respect to the ARX coefficients.

    One backward pass through the recursion (adjoint method) is made. `markov` and the real or
    complex `weights` have shape (K, m, r), the gradient (r + p (m + r), m) in the order of
    `LagRegression`, without the disturbance basis.
    """
    p, m, r = arx.order, arx.outputs, arx.inputs
    count = len(weights)
    adjoint = np.zeros((count + p, m, r), dtype=weights.dtype)
    adjoint[:count] = weights
    transposed = np.ascontiguousarray(arx.alpha.transpose(2, 0, 1).reshape(m, p * m))
    rows = adjoint.reshape(-1, r)
    for k in range(count - 1, -1, -1):
        adjoint[k] += transposed @ rows[(k + 1) * m : (k + 1 + p) * m]
    result = np.zeros((p + 1, m + r, m), dtype=weights.dtype)
    reach = min(p + 1, count)
    result[:reach, m:] = adjoint[:reach].transpose(0, 2, 1)
    for i in range(1, reach):
        result[i, :m] = np.einsum("kar,kbr->ba", adjoint[i:count], markov[: count - i])
    return result.reshape(-1, m)[m:]
