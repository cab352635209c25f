"""The best ARX predictor of given order for a plant with known noises.

A Kalman predictor uses the whole past, an ARX model of order p only p samples. The best one is the
Kalman predictor started p samples ago from the stationary distribution of the state. With K_j its
gains (oldest first) and F_j = A - K_j C::

    alpha_i = C F_p ... F_{p-i+2} K_{p-i+1},    beta_i = C F_p ... F_{p-i+2} (B - K_{p-i+1} D)

Truncating the stationary predictor to p samples is much worse where its memory is longer, as it is
with waves and a lightly damped tank.
"""

from typing import TYPE_CHECKING

import numpy as np

from utank_hil.base.arrays import FloatArray
from utank_hil.control.arx import ARX, discrete_matrices
from utank_hil.dynamics.sampling import LinearModel

if TYPE_CHECKING:
    from control import StateSpace


def finite_memory_arx(
    system: "StateSpace | LinearModel",
    process_covariance: FloatArray,
    measurement_covariance: FloatArray,
    order: int,
) -> ARX:
    """ARX model of least prediction error variance.

    ::

        x(k+1) = A x(k) + B u(k) + w(k),    y(k) = C x(k) + D u(k) + v(k)

    The model is discrete and stable, with n states and m outputs. The white noises w and v have the
    covariances `process_covariance`, shape (n, n), and `measurement_covariance`, shape (m, m),
    positive definite; `order` is p. ValueError is raised if the model is not discrete or not
    stable, or an argument has the wrong shape.
    """
    from scipy.linalg import solve_discrete_lyapunov

    a, b, c, d, sample_time_s = discrete_matrices(system)
    states, outputs = a.shape[0], c.shape[0]
    if order < 1:
        raise ValueError(f"ARX order must be at least 1, got {order}")
    if process_covariance.shape != (states, states):
        raise ValueError(f"process_covariance must have shape ({states}, {states})")
    if measurement_covariance.shape != (outputs, outputs):
        raise ValueError(f"measurement_covariance must have shape ({outputs}, {outputs})")
    if np.abs(np.linalg.eigvals(a)).max() >= 1:
        raise ValueError("the model must be stable: it has no stationary state to start from")
    covariance = solve_discrete_lyapunov(a, process_covariance)
    gains = []
    for _ in range(order):
        surprise = c @ covariance @ c.T + measurement_covariance
        gain = np.linalg.solve(surprise, c @ covariance @ a.T).T
        covariance = a @ covariance @ a.T - gain @ surprise @ gain.T + process_covariance
        covariance = (covariance + covariance.T) / 2
        gains.append(gain)
    alpha, beta, row = [], [d], c
    for gain in reversed(gains):
        alpha.append(row @ gain)
        beta.append(row @ (b - gain @ d))
        row = row @ (a - gain @ c)
    return ARX(np.array(alpha), np.array(beta), sample_time_s)
