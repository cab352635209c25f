"""Predictive laws: generalized predictive control (3.9) and deadbeat predictive control (3.6).

The result is a linear law with constant gains on past inputs and outputs.
"""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from utank_hil.base.arrays import ComplexArray, FloatArray, plausible
from utank_hil.base.ordered_sums import product
from utank_hil.control.arx import ARX
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


# Singular values below this share of the greatest are rounding errors. numpy's default keeps them
# and ruins the deadbeat law as soon as its target window is longer than the model's order.
_RANK_CUTOFF = 1e-10


@dataclass(frozen=True, slots=True, eq=False)
class Prediction:
    """Coefficients of y(k) ... y(k + hp - 1) on past (newest first) and future.

    ::

        y(k+q) = sum_i outputs[q, i-1] y(k-i) + sum_i inputs[q, i-1] u(k-i)
                 + sum_{j=0..q} markov[q-j] u(k+j)
    """

    outputs: FloatArray  #: shape (hp, p, m, m)
    inputs: FloatArray  #: shape (hp, p, m, r)
    #: shape (hp, m, r): response of the output q samples after a unit pulse of an input.
    markov: FloatArray

    def future_inputs(self, control_horizon: int) -> FloatArray:
        """Matrix tau_c, shape (hp m, hc r): effect of u(k) ... u(k + hc - 1), zero after."""
        horizon, outputs, inputs = self.markov.shape
        tau = np.zeros((horizon, outputs, control_horizon, inputs))
        for j in range(min(control_horizon, horizon)):
            tau[j:, :, j, :] = self.markov[: horizon - j]
        return tau.reshape(horizon * outputs, control_horizon * inputs)


def predict(arx: ARX, horizon: int) -> Prediction:
    """Run the recursions under (3.7) over `horizon` samples."""
    if horizon < 1:
        raise ValueError(f"prediction horizon must be at least 1, got {horizon}")
    outputs = np.empty((horizon, *arx.alpha.shape))
    inputs = np.empty((horizon, *arx.beta[1:].shape))
    markov = np.empty((horizon, *arx.beta[0].shape))
    outputs[0], inputs[0], markov[0] = arx.alpha, arx.beta[1:], arx.beta[0]
    for q in range(1, horizon):
        newest = outputs[q - 1, 0]
        markov[q] = inputs[q - 1, 0] + newest @ arx.beta[0]
        outputs[q] = newest @ arx.alpha
        outputs[q, :-1] += outputs[q - 1, 1:]
        inputs[q] = newest @ arx.beta[1:]
        inputs[q, :-1] += inputs[q - 1, 1:]
    return Prediction(outputs, inputs, markov)


def design_gpc(
    arx: ARX,
    control_horizon: int = 50,
    prediction_horizon: int = 50,
    output_weight: npt.ArrayLike = 1e14,
    input_weight: npt.ArrayLike = 1.0,
    first_output: int = 0,
) -> PredictiveLaw:
    """Generalized predictive control, thesis (3.8), (3.9).

    Minimizes ``sum_q |y_T - y|^2_R + sum_j |u|^2_Q`` over the next `control_horizon` inputs, and
    applies the first of them.

    Parameters
    ----------
    control_horizon : int
        hc, number of free inputs; zero input after them.
    prediction_horizon : int
        hp >= hc, number of weighted outputs y(k) ... y(k + hp - 1).
    output_weight : float or array_like, shape (m,)
        Diagonal of R, zero or more, the same at each future sample; 1 / (unit of y)^2.
    input_weight : float or array_like, shape (r,)
        Diagonal of Q, positive; 1 / (unit of u)^2.
    first_output : int
        Outputs before y(k + first_output) have no weight.
    """
    if not 1 <= control_horizon <= prediction_horizon:
        raise ValueError(
            "the horizons must hold 1 <= control_horizon <= prediction_horizon, got "
            f"{control_horizon} and {prediction_horizon}"
        )
    r_root = np.sqrt(_weights(output_weight, arx.outputs, "output_weight"))
    q_root = np.sqrt(_weights(input_weight, arx.inputs, "input_weight"))
    if not (q_root > 0).all():
        raise ValueError("input_weight must be positive")
    if not 0 <= first_output < prediction_horizon:
        raise ValueError(
            f"first_output must be 0 to {prediction_horizon - 1}, the last sample of the "
            f"prediction horizon, got {first_output}"
        )
    prediction = predict(arx, prediction_horizon)
    rows = np.tile(r_root, prediction_horizon)
    rows[: first_output * arx.outputs] = 0.0
    # Solved as a least-squares problem, because tau^T R tau + Q loses half the digits.
    stacked = np.vstack(
        [
            rows[:, None] * prediction.future_inputs(control_horizon),
            np.diag(np.tile(q_root, control_horizon)),
        ]
    )
    orthogonal, triangle = np.linalg.qr(stacked)
    first = np.linalg.solve(triangle.T, np.eye(control_horizon * arx.inputs, arx.inputs)).T
    return _law(arx, prediction, first @ orthogonal[: len(rows)].T * rows)


def design_dpc(
    arx: ARX,
    control_horizon: int = 50,
    prediction_horizon: int = 54,
    output_weight: npt.ArrayLike | None = None,
) -> PredictiveLaw:
    """Deadbeat predictive control, thesis 3.6.

    Brings the outputs y(k + hc) ... y(k + hp - 1) to their target (zero) with the smallest
    inputs u(k) ... u(k + hc - 1), and applies the first of them. When the window hp - hc holds
    the model's order, the outputs also stay there.

    Parameters
    ----------
    control_horizon : int
        hc; a longer one needs less pressure.
    prediction_horizon : int
        hp > hc.
    output_weight : float or array_like, shape (m,), optional
        Relaxes the deadbeat: the weighted squares of the outputs in the window are traded against
        the squares of the inputs. Outputs that the inputs cannot bring to zero, such as those due
        to a continuing wave, then cause no excessive effort.
    """
    if not 1 <= control_horizon < prediction_horizon:
        raise ValueError(
            "the horizons must hold 1 <= control_horizon < prediction_horizon, got "
            f"{control_horizon} and {prediction_horizon}"
        )
    if output_weight is not None:
        return design_gpc(
            arx, control_horizon, prediction_horizon, output_weight, first_output=control_horizon
        )
    prediction = predict(arx, prediction_horizon)
    window = prediction.future_inputs(control_horizon)[control_horizon * arx.outputs :]
    # Outputs are scaled by the inputs' effect, so that the cut-off does not depend on units.
    size = np.abs(prediction.markov).max(axis=(0, 2))
    size[size == 0] = 1.0
    rows = np.tile(1 / size, prediction_horizon - control_horizon)
    inverse = np.linalg.pinv(rows[:, None] * window, rcond=_RANK_CUTOFF)[: arx.inputs] * rows
    plan = np.zeros((arx.inputs, prediction_horizon * arx.outputs))
    plan[:, control_horizon * arx.outputs :] = inverse
    return _law(arx, prediction, plan)


def _law(arx: ARX, prediction: Prediction, plan: FloatArray) -> PredictiveLaw:
    """Law u(k) = plan (y_T - predicted y without new inputs); `plan` has shape (r, hp m)."""
    by_sample = plan.reshape(arx.inputs, -1, arx.outputs)
    return PredictiveLaw(
        input_gains=-np.einsum("rqm,qpms->prs", by_sample, prediction.inputs),
        output_gains=-np.einsum("rqm,qpms->prs", by_sample, prediction.outputs),
        reference_gains=by_sample.transpose(1, 0, 2),
        sample_time_s=arx.sample_time_s,
    )


def _weights(value: npt.ArrayLike, channels: int, name: str) -> FloatArray:
    weights = np.asarray(value, dtype=np.float64)
    if weights.shape not in ((), (channels,)):
        raise ValueError(
            f"{name} must be a number or have shape ({channels},), got {weights.shape}"
        )
    if not (np.isfinite(weights).all() and (weights >= 0).all()):
        raise ValueError(f"{name} must be zero or more and finite, got {weights}")
    return np.broadcast_to(weights, (channels,))
