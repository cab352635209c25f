"""The law that predictive design ends in: fixed gains on past inputs and outputs."""

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from utank_hil.arrays import ComplexArray, FloatArray
from utank_hil.dynamics.sampling import LinearModel

if TYPE_CHECKING:
    from control import StateSpace


@dataclass(frozen=True, slots=True, eq=False)
class PredictiveLaw:
    """Fixed-gain law on the past, newest first.

    ::

        u(k) = sum_i input_gains[i-1] u(k-i) + sum_i output_gains[i-1] y(k-i)
               + sum_q reference_gains[q] y_T(k+q)

    Attributes
    ----------
    input_gains : ndarray, shape (p, r, r)
    output_gains : ndarray, shape (p, r, m)
    reference_gains : ndarray, shape (hp, r, m)
        On the target y_T(k) ... y_T(k + hp - 1).
    sample_time_s : float
    """

    input_gains: FloatArray
    output_gains: FloatArray
    reference_gains: FloatArray
    sample_time_s: float

    def controller(self) -> "PredictiveController":
        """A new steppable controller, at rest."""
        return PredictiveController(self)

    def response(self, z: ComplexArray) -> ComplexArray:
        """Transfer matrix from y to u at the points `z`, shape (N,); shape (N, r, m)."""
        powers = np.asarray(z)[:, None] ** -np.arange(1, len(self.input_gains) + 1)
        left = np.eye(self.input_gains.shape[1]) - np.einsum(
            "ni,irs->nrs", powers, self.input_gains
        )
        solved: ComplexArray = np.linalg.solve(
            left, np.einsum("ni,irm->nrm", powers, self.output_gains)
        )
        return solved

    def matrices(self) -> LinearModel:
        """The law from y to u, p r states (block observer form)."""
        p, r, m = self.output_gains.shape
        a = np.eye(p * r, k=r)
        a[:, :r] += self.input_gains.reshape(p * r, r)
        b = self.output_gains.reshape(p * r, m)
        return LinearModel(a, b, np.eye(r, p * r), np.zeros((r, m)), self.sample_time_s)

    def to_state_space(self) -> "StateSpace":
        """The law from y to u as control.StateSpace."""
        from control import ss  # here, because importing it brings plotting into the process

        return ss(*self.matrices())


class PredictiveController:
    """Steps a `PredictiveLaw`.

    The past is kept as rows [u(k-i), y(k-i)], newest first, in a buffer much longer than the
    window that the gains look at; the window moves one row towards the front each step, and what
    it still needs is copied back to the end once in many steps. A step is then one product.

    Parameters
    ----------
    law : PredictiveLaw
    """

    _ROOM = 512  # steps between two copies

    def __init__(self, law: PredictiveLaw) -> None:
        taps, self._inputs, self._outputs = law.output_gains.shape
        self.sample_time_s = law.sample_time_s
        gains = np.concatenate([law.input_gains, law.output_gains], axis=2)  # (p, r, r + m)
        self._gains = np.ascontiguousarray(gains.transpose(1, 0, 2).reshape(self._inputs, -1))
        self._reference_gains = law.reference_gains
        self._constant_reference_gain: FloatArray = law.reference_gains.sum(axis=0)
        self._width = self._inputs + self._outputs
        self._window = taps * self._width
        self._flat = np.zeros(self._window + self._ROOM * self._width)
        self._start = 0
        self.reset()

    def reset(self) -> None:
        """Forget all past inputs and outputs."""
        self._flat[:] = 0.0
        self._start = self._flat.size - self._window

    def step(self, y: FloatArray, reference: FloatArray | None = None) -> FloatArray:
        """Take y(k-1), the newest measurement, and return u(k).

        Parameters
        ----------
        y : ndarray, shape (m,)
        reference : ndarray, shape (m,) or (hp, m), optional
            Target of the outputs: one for the whole horizon, or one for each sample of it.

        Returns
        -------
        ndarray, shape (r,)
        """
        flat, start, width = self._flat, self._start, self._width
        flat[start + self._inputs : start + width] = y
        u: FloatArray = self._gains.dot(flat[start : start + self._window])
        if reference is not None:
            if reference.ndim == 1:
                u += self._constant_reference_gain @ reference
            else:
                u += np.einsum("qrm,qm->r", self._reference_gains, reference)
        if start < width:
            kept = self._window - width
            flat[flat.size - kept :] = flat[start : start + kept]
            start = flat.size - kept
        start -= width
        flat[start : start + self._inputs] = u
        flat[start + self._inputs : start + width] = 0.0
        self._start = start
        return u

    def applied(self, u: FloatArray) -> None:
        """Replace the newest input of the past by what was really commanded, shape (r,)."""
        self._flat[self._start : self._start + self._inputs] = u
