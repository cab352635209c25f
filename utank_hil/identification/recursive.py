"""Recursive least squares of an ARX model, with forgetting, in square-root form.

The covariance P = S S^T is updated by its root (Potter 1963; Bierman 1977)::

    f = S^T phi,  a = lambda + f^T f,  theta += S f e^T / a
    S = (S - S f f^T / (a + sqrt(a lambda))) / sqrt(lambda)

So it stays symmetric and positive definite, and rounding errors are forgotten like the data.
Forgetting stops while the covariance is as large as at the start. Otherwise it would grow without
bound in still water (covariance wind-up).
"""

import math

import numpy as np

from utank_hil.base.arrays import FloatArray
from utank_hil.control.arx import ARX

_START = 1e3  # root of the initial covariance, for scaled coefficients
_LARGEST = 1e6  # relative to the usual magnitude; larger values are gaps
_RECOUNT = 1000  # updates after which the trace of P is recomputed


class RecursiveArx:
    """Recursive least squares for an ARX model.

    Parameters
    ----------
    order : int
        Order p.
    output_scale, input_scale : array_like, shape (m,) and (r,)
        Typical magnitudes of outputs and inputs, such as 0.05 rad and 20 kPa.
    forgetting : float
        Forgetting factor lambda, above 0 and at most 1, for a memory of 1 / (1 - lambda) samples.

    Raises
    ------
    ValueError
        If a parameter is out of its range.
    """

    def __init__(
        self,
        order: int,
        output_scale: FloatArray,
        input_scale: FloatArray,
        sample_time_s: float,
        forgetting: float = 0.999,
    ) -> None:
        y_scale, u_scale = np.atleast_1d(output_scale), np.atleast_1d(input_scale)
        scale = np.concatenate([y_scale, u_scale]).astype(np.float64)
        if not (np.isfinite(scale).all() and (scale > 0).all()):
            raise ValueError(f"scales must be positive and finite, got {scale}")
        if order < 1:
            raise ValueError(f"order must be at least 1, got {order}")
        if not 0 < forgetting <= 1:
            raise ValueError(f"forgetting must be above 0 and at most 1, got {forgetting}")
        if not (math.isfinite(sample_time_s) and sample_time_s > 0):
            raise ValueError(f"sample_time_s must be positive, got {sample_time_s}")
        self.order = order
        self.sample_time_s = sample_time_s
        self.forgetting = forgetting
        self.updates = 0
        self._outputs = len(y_scale)
        self._scale = scale
        size = (order + 1) * len(scale) - self._outputs
        self._coefficients = np.zeros((size, self._outputs))
        self._root = _START * np.eye(size)
        self._most = size * _START**2
        self._trace = self._most
        self._window = np.zeros((order + 1, len(scale)))  # newest first
        self._filled = 0

    def update(self, u: FloatArray, y: FloatArray) -> FloatArray:
        """Update the estimate with one sample.

        Parameters
        ----------
        u : array_like, shape (r,)
        y : array_like, shape (m,)
            A sample that is not finite, or a million times its scale, is a gap: there is no update
            until `order` samples after it.

        Returns
        -------
        ndarray, shape (m,)
            Innovation (prior prediction error); NaN while the regressor is incomplete.
        """
        m = self._outputs
        measured = np.concatenate([np.atleast_1d(y), np.atleast_1d(u)])
        usable = bool((np.abs(measured) <= _LARGEST * self._scale).all())
        sample = measured / self._scale if usable else np.full(len(measured), np.nan)
        self._window[1:] = self._window[:-1]
        self._window[0] = sample
        if not usable:
            self._filled = 0
            return np.full(m, np.nan)
        self._filled += 1
        if self._filled <= self.order:
            return np.full(m, np.nan)
        regressor = self._window.ravel()[m:]
        error: FloatArray = sample[:m] - regressor @ self._coefficients
        self._update_estimate(regressor, error)
        return error * self._scale[:m]

    @property
    def arx(self) -> ARX:
        """The present estimate."""
        m = self._outputs
        lagged = np.vstack([np.zeros((m, m)), self._coefficients]).reshape(self.order + 1, -1, m)
        lagged = lagged.transpose(0, 2, 1) * self._scale[:m, None] / self._scale
        return ARX(lagged[1:, :, :m], lagged[:, :, m:], self.sample_time_s)

    def _update_estimate(self, regressor: FloatArray, error: FloatArray) -> None:
        forgetting = self.forgetting if self._trace < self._most else 1.0
        projected = regressor @ self._root
        gain = self._root @ projected
        total = forgetting + projected @ projected
        self._coefficients += np.outer(gain / total, error)
        self._root -= np.outer(gain / (total + math.sqrt(total * forgetting)), projected)
        if forgetting < 1:
            self._root /= math.sqrt(forgetting)
        self._trace = float(self._trace - gain @ gain / total) / forgetting
        self.updates += 1
        if self.updates % _RECOUNT == 0:
            self._trace = float(np.sum(self._root**2))
