"""Least squares of a `LagRegression` from its Gram matrix, as accurate as from the matrix itself.

The normal equations square the condition number. Here the Cholesky factor of the Gram matrix is
only a preconditioner: residuals are computed from the data, and corrections are solved for until
they converge (corrected seminormal equations; Bjoerck, Numerical Methods for Least Squares
Problems, 6.6.5).

Data that fit a model of lower order exactly do not determine all coefficients. A pivoted factor
reveals the rank, and the solution of minimum norm is taken, whose surplus poles lie inside the unit
circle. Noisy data with weak excitation in some directions use `shrinkage_estimate`; where that
fails, the slow singular value decomposition.
"""

from dataclasses import dataclass

import numpy as np
from scipy.linalg import cholesky, lapack, solve_triangular
from scipy.optimize import minimize_scalar

from utank_hil.base.arrays import FloatArray
from utank_hil.identification.lag_regression import LagRegression, input_excitation
from utank_hil.identification.record import IdentificationError

_NULL = 1e-12  # Smallest eigenvalue, relative to the largest.
_LOG_KAPPA = (-15.0, 30.0)  # The range is from zero input coefficients to plain least squares.


_RANK = 1e-12  # Smallest pivot of the Gram matrix, relative to the first.
_EXACT = 1e-10  # Relative residual of data without noise.
_CONVERGED = 1e-9  # The next correction is the square of this, far below rounding.
_CORRECTIONS = 6  # Largest number of corrections.
_INFLATION = 100.0  # Above this, noise in weak directions of the input exceeds shrinkage's bias.


def shrinkage_estimate(
    regression: LagRegression, gram: FloatArray, right: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return shrunk coefficients (n, m), and 1 / kappa for each output (m,).

    With a slow pump or a narrow-band input, the record does not determine the fast part of the
    pulse responses. Least squares then amplifies noise to hundreds of times the signal, and ERA
    realizes it. Here the input coefficients of each output have a Gaussian prior of zero mean and
    variance tau^2 (ridge regression), and kappa = tau^2 / sigma^2 maximizes the likelihood of the
    data (empirical Bayes, restricted likelihood; Pillonetto et al., Automatica 2014). With the
    Schur complement S = V diag(l) V^T of the inputs in the normal equations and its right-hand side
    c::

        beta = V kappa / (1 + kappa l) V^T c

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


@dataclass(frozen=True, slots=True, eq=False)
class Fit:
    """Solution of a regression."""

    coefficients: FloatArray  #: shape (n, m)
    #: shape (m, m): covariance of the equation errors, with rows minus rank as degrees of freedom.
    residual_covariance: FloatArray
    gram: FloatArray  #: shape (n, n): upper triangle of the Gram matrix.
    #: shape (m,): term of the shrinkage on the diagonal of the inputs' part; zero without
    #: shrinkage.
    penalty: FloatArray
    rank: int
    excitation_order: int  #: See `excitation_order`, for p + 1 lags.


def fit(regression: LagRegression) -> Fit:
    """Return the least-squares solution, of minimum norm if it is not unique.

    IdentificationError is raised if there are no more rows than columns.
    """
    if regression.rows <= regression.columns:
        raise IdentificationError(
            f"{regression.rows} usable rows cannot determine {regression.columns} coefficients "
            "an output; record longer or lower the order"
        )
    gram, right = regression.gram()
    excitation_order, inflation = input_excitation(regression, gram)
    penalty = np.zeros(regression.outputs)
    solver = _Cholesky(gram)
    coefficients, squares, converged = _corrected(regression, solver, right)
    rank = solver.rank
    exact = np.trace(squares) <= _EXACT**2 * regression.target_squares().sum()
    if not (converged and exact) and (
        inflation > _INFLATION or not converged or rank < regression.columns
    ):
        try:
            coefficients, penalty = shrinkage_estimate(regression, gram, right)
            rank = regression.columns
        except np.linalg.LinAlgError:  # The outputs are dependent, or there is hardly any noise.
            matrix, wanted = regression.matrix()
            solution = np.linalg.lstsq(matrix, wanted, rcond=None)
            coefficients = solution[0].astype(np.float64)
            rank = int(solution[2])
        squares = _squares(regression.residuals(coefficients))
    covariance = squares / (regression.rows - rank)
    return Fit(coefficients, covariance, gram, penalty, rank, excitation_order)


def _squares(errors: list[FloatArray]) -> FloatArray:
    """Sum of e e^T over the rows, shape (m, m)."""
    squares: FloatArray = np.sum([e @ e.T for e in errors], axis=0)
    return squares


def _corrected(
    regression: LagRegression, solver: "_Cholesky", right: FloatArray
) -> tuple[FloatArray, FloatArray, bool]:
    """Return the corrected solution, its residual squares (m, m), and whether it has converged."""
    coefficients = solver.solve(right)
    previous = np.inf
    converged = False
    for _ in range(_CORRECTIONS):
        errors = regression.residuals(coefficients)
        gradient = regression.transposed(errors)
        correction = solver.solve(gradient)
        coefficients += correction
        change = float(np.linalg.norm(correction)) / max(
            float(np.linalg.norm(coefficients)), 1e-300
        )
        converged = change < _CONVERGED
        if converged or not change < 0.5 * previous:
            break
        previous = change
    # The last correction changes the squares by a known amount.
    squares = _squares(errors) - correction.T @ gradient
    return coefficients, squares, converged


class _Cholesky:
    """P G P^T = L L^T of rank k, and the minimum-norm solution of G x = b from it."""

    def __init__(self, gram: FloatArray) -> None:
        size = len(gram)
        threshold = _RANK * gram.diagonal().max()
        self.rank = size
        self._pivots = np.arange(size)
        self._null: FloatArray | None = None
        # LAPACK's lower triangle in column order is the upper one in row order.
        factor, failed = lapack.dpotrf(np.array(gram.T, order="F"), lower=1, overwrite_a=1, clean=0)
        if failed or factor.diagonal().min() ** 2 < threshold:
            factor, pivots, rank, _ = lapack.dpstrf(gram.T, lower=1, tol=threshold)
            self.rank = int(rank)
            self._pivots = pivots - 1
        self._factor = factor[: self.rank, : self.rank]
        if self.rank < size:
            # With P G P^T = [L; M][L; M]^T the dependent columns are T = L^-T M^T of the chosen.
            self._null = solve_triangular(
                self._factor, factor[self.rank :, : self.rank].T, lower=True, trans=1
            )
            self._weight = np.linalg.inv(np.eye(self.rank) + self._null @ self._null.T)

    def solve(self, right: FloatArray) -> FloatArray:
        chosen = right[self._pivots[: self.rank]]
        for trans in (0, 1):
            chosen = solve_triangular(
                self._factor, chosen, lower=True, trans=trans, check_finite=False
            )
        solution = np.empty_like(right)
        if self._null is None:
            solution[self._pivots] = chosen
        else:
            chosen = self._weight @ chosen
            solution[self._pivots] = np.vstack([chosen, self._null.T @ chosen])
        return solution
