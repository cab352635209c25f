"""Low-order autoregressive model of coloured errors, if one explains them.

::

    v(k) = alpha_1 v(k-1) + ... + alpha_p v(k-p) + e(k),    e white, of covariance S_p

Least squares for all orders at once. With the Gram matrix of past and present values, nearest lags
first, factored as R^T R, the last columns of R are each lag's contribution to the present, and
N S_p = T_p^T T_p, where T_p are their rows from lag p + 1 on. Schwarz's criterion (BIC), which is
consistent for a finite order, minimizes ::

    N log det S_p + p m^2 log N

over all orders on the same N rows. The order is then tested against the highest order P by the
likelihood ratio (Anderson, An Introduction to Multivariate Statistical Analysis, 8.4-8.5): with
j = (P - p) m omitted lags,

    (N - P m + (j - m - 1) / 2) log (det S_p / det S_P)

is chi-square distributed with j m degrees of freedom if they have no effect. Sensor noise passes
the test. An irregular sea does not: each lower order that was tried for it gave worse models of the
ship than OKID's own.
"""

from dataclasses import dataclass

import numpy as np
from scipy.linalg import cholesky, solve_triangular
from scipy.special import chdtrc

from utank_hil.base.arrays import FloatArray
from utank_hil.identification.lag_regression import LagRegression

_ROUNDING = 1e-12  # smallest significant innovation, relative to the errors' power
_SIGNIFICANCE = 0.01  # a less probable ratio rejects the order


@dataclass(frozen=True, slots=True, eq=False)
class NoiseModel:
    """An autoregression of m channels.

    Parameters
    ----------
    alpha : ndarray, shape (p, m, m)
        Empty for white noise.
    covariance : ndarray, shape (m, m)
        Covariance of e, positive definite.
    """

    alpha: FloatArray
    covariance: FloatArray

    @property
    def order(self) -> int:
        """Number p of past samples."""
        return len(self.alpha)

    def whitening(self) -> FloatArray:
        """Coefficients W_0 ... W_p of the whitening filter, to unit covariance.

        Returns
        -------
        ndarray, shape (p + 1, m, m)
        """
        whiten = np.linalg.inv(np.linalg.cholesky(self.covariance))
        taps: FloatArray = whiten @ np.concatenate([np.eye(len(whiten))[None], -self.alpha])
        return taps


def low_order_noise_model(errors: FloatArray, highest_order: int) -> NoiseModel | None:
    """Autoregression that explains the errors of a model; None if no low order does.

    Parameters
    ----------
    errors : ndarray, shape (N, m)
        Rows with a NaN are gaps.
    highest_order : int
        Order P of the reference model, 1 or more.

    Raises
    ------
    IdentificationError
        If no segment without gaps is longer than the highest order.
    """
    m = errors.shape[1]
    regression = LagRegression(errors, m, highest_order, np.zeros((0, len(errors))))
    rows, lags = regression.rows, m * highest_order
    present = [s.channels[:, highest_order:] for s in regression.segments]
    past, both = regression.gram()
    gram = np.block([[past, both], [both.T, sum(part @ part.T for part in present)]])
    # regularized: errors may be rounding only, or equal in two outputs
    floor = _ROUNDING * gram.diagonal().max() + np.finfo(np.float64).tiny
    factor = cholesky(gram + floor * np.eye(len(gram)), check_finite=False)
    explained = factor[:, lags:].reshape(highest_order + 1, m, m)
    by_lag = explained.transpose(0, 2, 1) @ explained
    squares = np.cumsum(by_lag[::-1], axis=0)[::-1]  # N S_p
    log_det = np.linalg.slogdet(squares)[1]
    used = m * np.arange(highest_order + 1)
    order = int(np.argmin(rows * log_det + m * used * np.log(rows)))
    omitted = lags - used[order]
    ratio = (rows - lags + (omitted - m - 1) / 2) * (log_det[order] - log_det[-1])
    if order == highest_order or chdtrc(omitted * m, max(ratio, 0.0)) < _SIGNIFICANCE:
        return None
    end = used[order]
    alpha = solve_triangular(factor[:end, :end], factor[:end, lags:])
    return NoiseModel(alpha.reshape(order, m, m).transpose(0, 2, 1), squares[order] / (rows - end))
