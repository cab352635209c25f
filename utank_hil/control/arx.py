"""The ARX model, thesis (3.6), from which the predictive laws are designed.

::

    y(k) = sum_{i=1..p} alpha_i y(k-i) + sum_{i=0..p} beta_i u(k-i)

In a model of `utank_hil.dynamics.sampling.sampled_model`, u(k) is the command computed at t_{k-1},
which acts over [t_{k-1} + d, t_k + d), with d the delay from sensor to pump. So y(k) depends on
u(k) when d is shorter than the sample time (beta_0 is not zero), and a law that computes u(k) from
y(k-1), y(k-2), ... uses the newest measurement.
"""

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from utank_hil.base.arrays import FloatArray
from utank_hil.dynamics.sampling import LinearModel

if TYPE_CHECKING:
    from control import StateSpace


_EXACT = 1e-7  # relative residual above which past outputs do not determine the state


@dataclass(frozen=True, slots=True, eq=False)
class ARX:
    """ARX model; ValueError for unlike shapes, no finite numbers, or no positive sample time."""

    alpha: FloatArray  #: shape (p, m, m): output coefficients alpha_1 ... alpha_p.
    #: shape (p + 1, m, r): input coefficients beta_0 ... beta_p; beta_0 acts at once.
    beta: FloatArray
    sample_time_s: float

    def __post_init__(self) -> None:
        alpha = np.array(self.alpha, dtype=np.float64)
        beta = np.array(self.beta, dtype=np.float64)
        if alpha.ndim != 3 or alpha.shape[0] < 1 or alpha.shape[1] != alpha.shape[2]:
            raise ValueError(f"ARX alpha must have shape (p, m, m), got {alpha.shape}")
        if beta.ndim != 3 or beta.shape[:2] != (alpha.shape[0] + 1, alpha.shape[1]):
            raise ValueError(
                f"ARX beta must have shape (p + 1, m, r) = ({alpha.shape[0] + 1}, "
                f"{alpha.shape[1]}, r), got {beta.shape}"
            )
        if beta.shape[2] < 1:
            raise ValueError("ARX beta must have at least one input")
        if not (np.isfinite(alpha).all() and np.isfinite(beta).all()):
            raise ValueError("ARX coefficients must be finite")
        if not (math.isfinite(self.sample_time_s) and self.sample_time_s > 0):
            raise ValueError(f"ARX sample_time_s must be positive, got {self.sample_time_s}")
        for name, array in (("alpha", alpha), ("beta", beta)):
            array.flags.writeable = False
            object.__setattr__(self, name, array)

    @property
    def order(self) -> int:
        """Number p of past samples."""
        return int(self.alpha.shape[0])

    @property
    def outputs(self) -> int:
        """Number m of outputs."""
        return int(self.alpha.shape[1])

    @property
    def inputs(self) -> int:
        """Number r of inputs."""
        return int(self.beta.shape[2])

    @classmethod
    def from_state_space(cls, system: "StateSpace | LinearModel", order: int) -> "ARX":
        """Convert a discrete state-space model to its exact ARX form.

        The past `order` outputs and inputs determine the state (a deadbeat observer), so the
        model predicts the response of `system` exactly. Of several solutions, the output
        coefficients of least norm are taken.

        ValueError is raised if the model is not discrete, or `order` past outputs do not determine
        its state.

        Parameters
        ----------
        system : control.StateSpace or LinearModel
            Discrete, with n states and m outputs.
        order : int
            p, with p m >= n.
        """
        a, b, c, d, sample_time_s = discrete_matrices(system)
        states, outputs, inputs = a.shape[0], c.shape[0], b.shape[1]
        if order < 1 or order * outputs < states:
            raise ValueError(
                f"ARX order {order} with {outputs} outputs cannot hold {states} states; "
                f"use order {max(1, math.ceil(states / outputs))} or more"
            )
        if states == 0:
            a, b, c = np.zeros((1, 1)), np.zeros((1, inputs)), np.zeros((outputs, 1))
        blocks = [c]
        for _ in range(order):
            blocks.append(blocks[-1] @ a)
        scale = np.linalg.norm(np.vstack(blocks), axis=0)
        scale[scale == 0] = 1.0
        past, now = np.vstack(blocks[:order]) / scale, blocks[order] / scale
        # With y(k-p) ... y(k-1) = past x(k-p) + ..., the alphas solve alphas past = now.
        alphas = np.linalg.lstsq(past.T, now.T, rcond=None)[0].T
        if np.abs(alphas @ past - now).max() > _EXACT:
            raise ValueError(
                f"the outputs of {order} past samples do not determine the model's state; "
                "raise the ARX order or measure more"
            )
        alpha = alphas.reshape(outputs, order, outputs).transpose(1, 0, 2)[::-1]
        markov = [d] + [block @ b for block in blocks[:order]]
        beta = np.array(markov)
        for i in range(1, order + 1):
            for j in range(i):  # subtract each input's effect through the past outputs
                beta[i] -= alpha[i - j - 1] @ markov[j]
        return cls(alpha, beta, sample_time_s)

    def predict(self, u: FloatArray, y: FloatArray) -> FloatArray:
        """Predict each sample of a record, (N, r) and (N, m), by those before it, zero at first."""
        u, y = self._record(u, y)
        predicted: FloatArray = u @ self.beta[0].T
        for i in range(1, min(self.order, len(y) - 1) + 1):
            predicted[i:] += y[:-i] @ self.alpha[i - 1].T + u[:-i] @ self.beta[i].T
        return predicted

    def simulate(self, u: FloatArray) -> FloatArray:
        """Free response to the inputs `u`, shape (N, r), from rest; shape (N, m)."""
        forced = self.predict(u, np.zeros((len(u), self.outputs)))
        oldest_first = self.alpha[::-1].transpose(1, 0, 2).reshape(self.outputs, -1)
        history = np.zeros((self.order + len(forced), self.outputs))
        for k, term in enumerate(forced):
            history[k + self.order] = oldest_first @ history[k : k + self.order].ravel() + term
        return history[self.order :]

    def matrices(self) -> LinearModel:
        """Equivalent state-space model with p m states (block observer form).

        State i is the prediction of y(k + i) from the past, i = 0 ... p - 1, with zero future
        inputs.
        """
        size = self.order * self.outputs
        a = np.eye(size, k=self.outputs)
        a[:, : self.outputs] += self.alpha.reshape(size, self.outputs)
        b = (self.beta[1:] + self.alpha @ self.beta[0]).reshape(size, self.inputs)
        return LinearModel(a, b, np.eye(self.outputs, size), self.beta[0], self.sample_time_s)

    def _record(self, u: FloatArray, y: FloatArray) -> tuple[FloatArray, FloatArray]:
        u, y = np.asarray(u, dtype=np.float64), np.asarray(y, dtype=np.float64)
        if u.ndim != 2 or u.shape[1] != self.inputs:
            raise ValueError(f"u must have shape (N, {self.inputs}), got {u.shape}")
        if y.shape != (len(u), self.outputs):
            raise ValueError(f"y must have shape ({len(u)}, {self.outputs}), got {y.shape}")
        return u, y


def discrete_matrices(
    system: "StateSpace | LinearModel",
) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray, float]:
    """Matrices and sample time of a discrete state-space model."""
    sample_time = system.dt
    if sample_time is None or isinstance(sample_time, bool) or not sample_time > 0:
        raise ValueError(
            f"the model must be discrete with a sample time in seconds, its dt is {sample_time}; "
            "sample it first (utank_hil.dynamics.sampling.sampled_model)"
        )
    parts = (system.A, system.B, system.C, system.D)
    a, b, c, d = (np.asarray(part, dtype=np.float64) for part in parts)
    return a, b, c, d, float(sample_time)
