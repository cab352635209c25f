"""What a plan is told by a forecast of the waves: the design of a `Foresight`."""

import numpy as np

from utank_hil.control.constrained.preview import Foresight, Waves
from utank_hil.dynamics.sampling import LinearModel


def foreseen(
    waves: Waves, model: LinearModel, samples: int, least: int
) -> tuple[LinearModel, Foresight]:
    """Return the model with the noises to come as states, and what a forecast tells its plan."""
    from scipy.linalg import block_diag, solve_discrete_are, solve_discrete_lyapunov

    own, n = len(waves.row), len(model.A)
    a, c = model.A[:own, :own], model.C[:, :own]
    error = solve_discrete_are(a.T, c.T, waves.process_covariance, np.diag(waves.variance))
    noise = np.zeros((n, samples))
    noise[:own, 0] = waves.noise
    ahead = LinearModel(
        np.block([[model.A, noise], [np.zeros((samples, n)), np.eye(samples, k=1)]]),
        np.vstack([model.B, np.zeros((samples, 1))]),
        np.hstack([model.C, np.zeros((len(c), samples))]),
        model.D,
        model.dt,
    )
    moment = np.empty((samples, n + samples))
    moment[0] = np.append(waves.row, np.zeros(n - own + samples))
    for q in range(1, samples):
        moment[q] = moment[q - 1] @ ahead.A
    learnt = block_diag(error, np.zeros((n - own, n - own)), np.eye(samples)) @ moment.T
    stationary = solve_discrete_lyapunov(a, np.outer(waves.noise, waves.noise))
    covariance = moment[:, :own] @ stationary @ waves.row
    return ahead, Foresight(moment[:, :n], moment @ learnt, learnt, covariance, least)
