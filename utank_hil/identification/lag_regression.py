"""The least-squares problem of an ARX model, and its solution.

::

    y(k) = sum_{i=1..p} alpha_i y(k-i) + sum_{i=0..p} beta_i u(k-i) + c psi(k) + e(k)

Rows with a NaN divide a record into segments, and a window of lags never spans a gap. Data that fit
a model of lower order exactly do not determine all coefficients: the solution of minimum norm is
taken, whose surplus poles lie inside the unit circle. Noisy data with weak excitation in some
directions use `shrinkage_estimate`.
"""

from contextlib import suppress
from dataclasses import dataclass

import numpy as np
from scipy.linalg import cholesky, lapack, lstsq, qr, solve_triangular
from scipy.optimize import minimize_scalar

from utank_hil.base.arrays import FloatArray
from utank_hil.identification.record import IdentificationError

_EXCITED = 1e-10  # Smallest pivot of the lagged inputs' Gram matrix: singular values of 1e-5.
_NULL = 1e-12  # Smallest eigenvalue, relative to the largest.
_LOG_KAPPA = (-15.0, 30.0)  # The range is from zero input coefficients to plain least squares.
_RANK = 1e-10  # Inverse of the largest condition number that determines all coefficients.
_EXACT = 1e-10  # Relative residual of data without noise.
_MOST = 12_000_000  # Largest number of elements of a regression: some 450 MB with its solution.
_INFLATION = 100.0  # Above this, noise in weak directions of the input exceeds shrinkage's bias.


class LagRegression:
    """Regression of the outputs on their past, the inputs and a disturbance basis.

    `matrix`, shape (rows, n), times the coefficients gives `targets`, shape (rows, m).
    Coefficients have shape (n, m), n = r + p q + d: beta_0 transposed, then alpha_i and beta_i
    transposed for each lag i = 1..p, then the rows of the basis. `at`, shape (rows,), are the
    samples of the rows, and `ends` the rows after which a new segment begins.

    `z`, shape (N, q), holds outputs and inputs, the outputs first; a row with a value that is not
    finite is a gap. `basis`, shape (d, N), is the disturbance basis at every sample.
    IdentificationError is raised if no segment is longer than the order.
    """

    def __init__(self, z: FloatArray, outputs: int, order: int, basis: FloatArray) -> None:
        self.outputs = outputs
        self.order = order
        self.channels = z.shape[1]
        self.basis_size = len(basis)
        bounds = [(start, stop) for start, stop in segment_bounds(z) if stop - start > order]
        if not bounds:
            raise IdentificationError(
                f"no stretch of the record without gaps is longer than the order {order}; "
                "record longer, mend the gaps or lower the order"
            )
        rows, lags = sum(stop - start - order for start, stop in bounds), (order + 1) * z.shape[1]
        if rows * lags > _MOST:
            raise IdentificationError(
                f"{rows} samples of order {order} take more memory than is given to them; take a "
                f"part of {_MOST // lags} samples at most (--from, --to), or lower the order"
            )
        lagged = [
            np.lib.stride_tricks.sliding_window_view(z[start:stop], order + 1, axis=0)
            for start, stop in bounds
        ]
        self.ends = np.cumsum([len(each) for each in lagged])[:-1]
        self.at = np.concatenate([np.arange(start + order, stop) for start, stop in bounds])
        newest_first = np.vstack(lagged)[:, :, ::-1].transpose(0, 2, 1)
        whole = np.hstack([newest_first.reshape(len(self.at), -1), basis[:, self.at].T])
        self.targets, self.matrix = whole[:, :outputs], whole[:, outputs:]
        self.rows, self.columns = self.matrix.shape

    @property
    def input_rows(self) -> np.ndarray:
        """Row indices of the input coefficients, beta_0 first."""
        q, m = self.channels, self.outputs
        index: np.ndarray = np.arange(self.order + 1)[:, None] * q + np.arange(q - m)
        return index.ravel()

    def residuals(self, coefficients: FloatArray) -> FloatArray:
        """One-step prediction errors, shape (rows, m)."""
        errors: FloatArray = self.targets - self.matrix @ coefficients
        return errors


def segment_bounds(z: FloatArray) -> list[tuple[int, int]]:
    """Start and stop index of each segment: consecutive rows of finite values."""
    good = np.isfinite(z).all(axis=1)
    edges = np.flatnonzero(np.diff(np.concatenate([[0], good.view(np.int8), [0]])))
    return [(int(a), int(b)) for a, b in edges.reshape(-1, 2)]


def input_excitation(regression: LagRegression, gram: FloatArray) -> tuple[int, float]:
    """Return persistent excitation and variance inflation, from a regression's Gram matrix.

    The first is an order: the rank of the Gram matrix of the lagged inputs, to numerical precision,
    per input. A model of n states needs 2 n or more; all coefficients of an ARX model of order p
    need p + 1. A narrow-band signal has a low order for any number of lines. The second is the mean
    variance of the input coefficients relative to white inputs of the same power, infinite if the
    order is less than the number of lags.
    """
    index = regression.input_rows
    lagged = gram[np.ix_(index, index)]
    power = lagged.diagonal()
    factor, _, rank, _ = lapack.dpstrf(lagged, lower=1, tol=_EXCITED * power.max())
    inputs = regression.channels - regression.outputs
    if rank < len(index):
        return int(rank) // inputs, np.inf
    inverse, _ = lapack.dtrtri(factor, lower=1)
    # The routine dpstrf leaves the other triangle unchanged.
    inflation = np.sum(np.tril(inverse) ** 2) * power.mean() / len(index)
    return int(rank) // inputs, float(inflation)


def shrinkage_estimate(
    regression: LagRegression, gram: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return shrunk coefficients (n, m), and 1 / kappa for each output (m,).

    With a slow pump or a narrow-band input, the record does not determine the fast part of the
    pulse responses. Least squares then amplifies noise to hundreds of times the signal. Here the
    input coefficients of each output have a Gaussian prior of zero mean and variance tau^2 (ridge
    regression), and kappa = tau^2 / sigma^2 maximizes the likelihood of the data (empirical Bayes,
    restricted likelihood; Pillonetto et al., Automatica 2014). With the Schur complement
    S = V diag(l) V^T of the inputs in the normal equations and its right-hand side c::

        beta = V kappa / (1 + kappa l) V^T c

    `gram` is the Gram matrix (n, n). numpy.linalg.LinAlgError is raised if the other columns of the
    regression are dependent.
    """
    right = regression.matrix.T @ regression.targets
    inputs = regression.input_rows
    others = np.setdiff1d(np.arange(len(gram)), inputs)
    factor = cholesky(gram[np.ix_(others, others)], lower=True)
    shared = solve_triangular(factor, gram[np.ix_(others, inputs)], lower=True)
    known = solve_triangular(factor, right[others], lower=True)
    values, vectors = np.linalg.eigh(gram[np.ix_(inputs, inputs)] - shared.T @ shared)
    kept = values > _NULL * values[-1]
    values, vectors = values[kept], vectors[:, kept]
    seen = vectors.T @ (right[inputs] - shared.T @ known)
    all_squares = np.sum(regression.targets**2, axis=0)
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


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Fit:
    """Solution of a regression."""

    coefficients: FloatArray  #: shape (n, m)
    #: shape (m, m): covariance of the one-step prediction errors, with rows minus rank as degrees
    #: of freedom.
    residual_covariance: FloatArray
    #: shape (m,): term of the shrinkage on the diagonal of the inputs' part; zero without
    #: shrinkage.
    penalty: FloatArray
    rows: int  #: Number of equations, without gaps.
    columns: int  #: Number n of coefficients of each output.
    rank: int  #: Below n if the data fit exactly or the input does not excite.
    #: Order of persistent excitation of the input, at most p + 1. A system of order n needs 2 n or
    #: more.
    excitation_order: int


def fit(regression: LagRegression) -> Fit:
    """Solve, with minimum norm; IdentificationError if there are no more rows than columns."""
    if regression.rows <= regression.columns:
        raise IdentificationError(
            f"{regression.rows} usable rows cannot determine {regression.columns} coefficients "
            "an output; record longer or lower the order"
        )
    matrix, targets = regression.matrix, regression.targets
    gram = matrix.T @ matrix
    excitation_order, inflation = input_excitation(regression, gram)
    penalty = np.zeros(regression.outputs)
    # The triangle of both, as the normal equations lose half the digits.
    triangle = qr(np.hstack([matrix, targets]), overwrite_a=True, mode="r", check_finite=False)[0]
    rank = len(gram)
    factor, shared = triangle[:rank, :rank], triangle[:rank, rank:]
    if lapack.dtrcon(factor)[0] > _RANK:
        coefficients = solve_triangular(factor, shared)
    else:
        coefficients, _, rank, _ = lstsq(matrix, targets, cond=_RANK, lapack_driver="gelsy")
    exact = np.sum(regression.residuals(coefficients) ** 2) <= _EXACT**2 * np.sum(targets**2)
    if not exact and (inflation > _INFLATION or rank < regression.columns):
        with suppress(np.linalg.LinAlgError):  # The outputs are dependent, or hardly any noise.
            coefficients, penalty = shrinkage_estimate(regression, gram)
            rank = regression.columns
    errors = regression.residuals(coefficients)
    return Fit(
        coefficients=coefficients,
        residual_covariance=errors.T @ errors / (regression.rows - rank),
        penalty=penalty,
        rows=regression.rows,
        columns=regression.columns,
        rank=int(rank),
        excitation_order=excitation_order,
    )
