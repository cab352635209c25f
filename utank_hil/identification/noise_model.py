"""What colours the errors of a model: a short autoregression, if that is what they follow.

::

    v(k) = alpha_1 v(k-1) + ... + alpha_p v(k-p) + e(k),    e white, of covariance S_p

Least squares for all orders at once. With the Gram matrix of past and present values, nearest lags
first, factored as R^T R, the last columns of R hold what each lag explains of the present, and
N S_p = T_p^T T_p, T_p being their rows from lag p + 1 on. Schwarz's criterion, which finds a finite
order if there is one, takes the least of ::

    N log det S_p + p m^2 log N

all orders judged on the same N rows. Whether there is one, the likelihood ratio against the highest
order P tells (Anderson, An Introduction to Multivariate Statistical Analysis, 8.4-8.5): with
j = (P - p) m lags left out,

    (N - P m + (j - m - 1) / 2) log (det S_p / det S_P)

is chi-square of j m degrees of freedom if they say nothing. Sensors' noise passes; an irregular sea
does not: each shorter order tried for it made for worse models of the ship than OKID's own.
"""

from dataclasses import dataclass

import numpy as np
from scipy.linalg import cholesky, solve_triangular
from scipy.special import chdtrc

from utank_hil.arrays import FloatArray
from utank_hil.identification.lag_regression import LagRegression

_ROUNDING = 1e-12  # of the errors' power: an innovation below is not told from none
_REFUTED = 0.01  # so improbable a ratio says that the order is too low


@dataclass(frozen=True, slots=True, eq=False)
class NoiseModel:
    """An autoregression of m channels.

    Parameters
    ----------
    alpha : ndarray, shape (p, m, m)
        Empty for white noise.
    covariance : ndarray, shape (m, m)
        Of e, positive definite.
    """

    alpha: FloatArray
    covariance: FloatArray

    @property
    def order(self) -> int:
        """Number p of past samples."""
        return len(self.alpha)

    def whitening(self) -> FloatArray:
        """Taps W_0 ... W_p of the filter that makes the noise white and of unit covariance.

        Returns
        -------
        ndarray, shape (p + 1, m, m)
        """
        whiten = np.linalg.inv(np.linalg.cholesky(self.covariance))
        taps: FloatArray = whiten @ np.concatenate([np.eye(len(whiten))[None], -self.alpha])
        return taps


def short_noise_model(errors: FloatArray, highest_order: int) -> NoiseModel | None:
    """Autoregression that the errors of a model follow; None if no short one explains them.

    Parameters
    ----------
    errors : ndarray, shape (N, m)
        Rows with a NaN are gaps, which no lag reaches across.
    highest_order : int
        P, 1 or more: of the model that a shorter one must match.

    Returns
    -------
    NoiseModel or None

    Raises
    ------
    IdentificationError
        If no stretch without gaps is longer than the highest order.
    """
    m = errors.shape[1]
    regression = LagRegression(errors, m, highest_order, np.zeros((0, len(errors))))
    rows, lags = regression.rows, m * highest_order
    present = [s.channels[:, highest_order:] for s in regression.segments]
    past, both = regression.gram()
    gram = np.block([[past, both], [both.T, sum(part @ part.T for part in present)]])
    # errors may be nothing but rounding, or the same in two outputs
    floor = _ROUNDING * gram.diagonal().max() + np.finfo(np.float64).tiny
    factor = cholesky(gram + floor * np.eye(len(gram)), check_finite=False)
    explained = factor[:, lags:].reshape(highest_order + 1, m, m)
    by_lag = explained.transpose(0, 2, 1) @ explained
    squares = np.cumsum(by_lag[::-1], axis=0)[::-1]  # N S_p
    misfit = np.linalg.slogdet(squares)[1]
    used = m * np.arange(highest_order + 1)
    order = int(np.argmin(rows * misfit + m * used * np.log(rows)))
    out = lags - used[order]
    ratio = (rows - lags + (out - m - 1) / 2) * (misfit[order] - misfit[-1])
    if order == highest_order or chdtrc(out * m, max(ratio, 0.0)) < _REFUTED:
        return None
    end = used[order]
    alpha = solve_triangular(factor[:end, :end], factor[:end, lags:])
    return NoiseModel(alpha.reshape(order, m, m).transpose(0, 2, 1), squares[order] / (rows - end))
