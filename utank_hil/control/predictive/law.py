"""Linear law with constant gains on past inputs and outputs, the result of predictive design."""

from dataclasses import dataclass

import numpy as np

from utank_hil.base.arrays import ComplexArray, FloatArray, plausible
from utank_hil.base.ordered_sums import product
from utank_hil.dynamics.sampling import LinearModel


@dataclass(frozen=True, slots=True, eq=False)
class PredictiveLaw:
    """Fixed-gain law on the past, newest first.

    ::

        u(k) = sum_i input_gains[i-1] u(k-i) + sum_i output_gains[i-1] y(k-i)
               + sum_q reference_gains[q] y_T(k+q)
    """

    input_gains: FloatArray  #: shape (p, r, r)
    output_gains: FloatArray  #: shape (p, r, m)
    reference_gains: FloatArray  #: shape (hp, r, m): on the target y_T(k) ... y_T(k + hp - 1).
    sample_time_s: float

    def controller(self, washout_share: float = 0.0) -> "PredictiveController":
        """Return a new controller at rest; `washout_share` as in `WashoutLaw.share`."""
        return PredictiveController(self, washout_share)

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
        """State-space model from y to u with p r states (block observer form)."""
        p, r, m = self.output_gains.shape
        a = np.eye(p * r, k=r)
        a[:, :r] += self.input_gains.reshape(p * r, r)
        b = self.output_gains.reshape(p * r, m)
        return LinearModel(a, b, np.eye(r, p * r), np.zeros((r, m)), self.sample_time_s)


class PredictiveController:
    """Stepping of a `PredictiveLaw`.

    The past is kept as rows [u(k-i), y(k-i)], newest first, in a buffer much longer than the
    window of the gains. The window moves one row towards the front each step, and its rows are
    copied back to the end once in many steps. A step is then one product.

    With a washout the law uses d(k) = keep (d(k-1) + y(k) - y(k-1)), keep = 1 - share, in place of
    y(k). Its result a(k) less keep a(k-1) does not contain d, only y and one more past sample::

        a(k) = keep a(k-1) + sum_i (Gu_i - keep Gu_{i-1}) u(k-i)
                           + sum_i keep (Gy_i - Gy_{i-1}) y(k-i)

    i = 1 ... p + 1, with zero gains beyond 1 ... p. So the last result stands in front of the rows,
    and a step is still one product. References and the commands of `applied` are not part of a.

    `washout_share` is the weight of the newest sample in the mean that is subtracted from the
    outputs (`WashoutLaw`); 0 for no washout.
    """

    _ROOM = 512  # steps between two copies

    def __init__(self, law: PredictiveLaw, washout_share: float = 0.0) -> None:
        inputs, outputs = law.output_gains.shape[1:]
        self.sample_time_s = law.sample_time_s
        gains = np.concatenate([law.input_gains, law.output_gains], axis=2)  # (p, r, r + m)
        answer_gain = np.zeros((inputs, 0))
        if washout_share:
            keep = 1 - washout_share
            before = np.concatenate([np.zeros((1, *gains.shape[1:])), gains])
            gains = np.concatenate([gains, np.zeros((1, *gains.shape[1:]))])
            gains[:, :, :inputs] -= keep * before[:, :, :inputs]
            gains[:, :, inputs:] -= before[:, :, inputs:]
            gains[:, :, inputs:] *= keep
            answer_gain = keep * np.eye(inputs)
        taps = gains.transpose(1, 0, 2).reshape(inputs, -1)
        self._gains = np.ascontiguousarray(np.hstack([answer_gain, taps]))
        self._reference_gains = law.reference_gains
        self._constant_reference_gain: FloatArray = law.reference_gains.sum(axis=0)
        self._answers, self._inputs, self._width = answer_gain.shape[1], inputs, inputs + outputs
        self._window = taps.shape[1]
        self._flat = np.zeros(self._answers + self._window + self._ROOM * self._width)
        self.reset()

    def reset(self) -> None:
        """Forget all past inputs and outputs."""
        self._flat[:] = 0.0
        self._newest = self._flat.size - self._window  # index of the newest row

    def step(self, y: FloatArray, reference: FloatArray | None = None) -> FloatArray:
        """Take y(k-1), the newest measurement, shape (m,), and return u(k), shape (r,).

        `reference`, shape (m,) or (hp, m), is the target of the outputs: one for the whole horizon,
        or one for each sample of it. With a washout it is relative to the mean.
        """
        flat, newest, answers, width = self._flat, self._newest, self._answers, self._width
        flat[newest + self._inputs : newest + width] = plausible(y)
        u = product(self._gains, flat[newest - answers : newest + self._window])
        if newest < width + answers:
            kept = self._window - width
            flat[flat.size - kept :] = flat[newest : newest + kept]
            newest = flat.size - kept
        newest -= width
        if answers:
            flat[newest - answers : newest] = u
        if reference is not None:
            if reference.ndim == 1:
                u += product(self._constant_reference_gain, reference)
            else:
                gains = self._reference_gains.swapaxes(0, 1).reshape(len(u), -1)
                u += product(gains, reference.ravel())
        flat[newest : newest + self._inputs] = u
        self._newest = newest
        return u

    def applied(self, u: FloatArray) -> None:
        """Replace the newest past input by the actual command, shape (r,)."""
        self._flat[self._newest : self._newest + self._inputs] = u
