"""Shrinkage (ridge regression) of input coefficients that the input excites too weakly.

With a slow pump or a narrow-band input, the record does not determine the fast part of the pulse
responses. Least squares then amplifies noise to hundreds of times the signal, and ERA realizes it.
Here the input coefficients of each output have a Gaussian prior of zero mean and variance tau^2,
and kappa = tau^2 / sigma^2 maximizes the likelihood of the data (empirical Bayes, restricted
likelihood; Pillonetto et al., Automatica 2014). With the Schur complement S = V diag(l) V^T of the
inputs in the normal equations and its right-hand side c::

    beta = V kappa / (1 + kappa l) V^T c
"""

import numpy as np
from scipy.linalg import cholesky, solve_triangular
from scipy.optimize import minimize_scalar

from utank_hil.base.arrays import FloatArray
from utank_hil.identification.lag_regression import LagRegression

_NULL = 1e-12  # Smallest eigenvalue, relative to the largest.
_LOG_KAPPA = (-15.0, 30.0)  # The range is from zero input coefficients to plain least squares.


def shrinkage_estimate(
    regression: LagRegression, gram: FloatArray, right: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return shrunk coefficients (n, m), and 1 / kappa for each output (m,).

    `gram` (n, n) is the upper triangle of the Gram matrix, `right` the right side (n, m).
    numpy.linalg.LinAlgError is raised if the other columns of the regression are dependent.
    """
    full = np.triu(gram) + np.triu(gram, 1).T
    inputs = regression.input_rows
    others = np.setdiff1d(np.arange(len(full)), inputs)
    factor = cholesky(full[np.ix_(others, others)], lower=True)
    shared = solve_triangular(factor, full[np.ix_(others, inputs)], lower=True)
    known = solve_triangular(factor, right[others], lower=True)
    values, vectors = np.linalg.eigh(full[np.ix_(inputs, inputs)] - shared.T @ shared)
    kept = values > _NULL * values[-1]
    values, vectors = values[kept], vectors[:, kept]
    seen = vectors.T @ (right[inputs] - shared.T @ known)
    all_squares = regression.target_squares()
    squares = all_squares - np.sum(known**2, axis=0)
    freedom = regression.rows - len(others)
    coefficients = np.empty_like(right)
    penalty = np.empty(right.shape[1])
    for j, part in enumerate(seen.T):
        rounding = float(np.finfo(np.float64).eps * all_squares[j])
        kappa = _maximum_likelihood(values, part**2, float(squares[j]), freedom, rounding)
        beta = vectors @ (kappa * part / (1 + kappa * values))
        coefficients[inputs, j] = beta
        coefficients[others, j] = solve_triangular(
            factor, known[:, j] - shared @ beta, lower=True, trans=1
        )
        penalty[j] = 1 / kappa
    return coefficients, penalty


def _maximum_likelihood(
    values: FloatArray, squares: FloatArray, total: float, freedom: int, rounding: float
) -> float:
    """Return the kappa of maximum restricted likelihood, with residuals of at least rounding."""

    def cost(log_kappa: float) -> float:
        kappa = np.exp(log_kappa)
        left = max(total - np.sum(squares * kappa / (1 + kappa * values)), rounding)
        return float(freedom * np.log(left) + np.sum(np.log1p(kappa * values)))

    return float(np.exp(minimize_scalar(cost, bounds=_LOG_KAPPA, method="bounded").x))
