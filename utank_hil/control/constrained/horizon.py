"""Cost and predicted motions of a plan over a receding horizon.

The plan holds the command of one pump at a few future samples, its knots; between them the command
is linear, after the last one it is zero. For x(k+1) = A x(k) + B u(k), y(k) = C x(k) + D u(k) all
predictions are linear in the state x(k) and the plan z, and the cost is a sum of squares::

    y(k+q) = outputs_state[q] x + outputs_plan[q] z
    sum_{q >= first_output} |y_T(k+q) - y(k+q)|^2_W + Q sum_q u(k+q)^2 + |L x(k+N)|^2
        = |M z + E x - E_T y_T|^2

With a knot at each of the first hc samples, L = 0 and N = hp this is the cost of generalized
predictive control, thesis (3.8).
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from utank_hil.base.arrays import FloatArray
from utank_hil.base.ordered_sums import product
from utank_hil.dynamics.sampling import LinearModel


@dataclass(frozen=True, slots=True, eq=False)
class Horizon:
    """Cost and predictions over N samples; n states, m outputs, j knots."""

    #: shape (j,): samples of the horizon at which the plan holds the command.
    knots: npt.NDArray[np.int64]
    interpolation: FloatArray  #: shape (N, j): from the plan to the command at each sample.
    outputs_state: FloatArray  #: shape (N, m, n)
    outputs_plan: FloatArray  #: shape (N, m, j)
    outputs_held: FloatArray  #: shape (N, m): outputs due to one unit of constant command.
    hessian: FloatArray  #: shape (j, j): M'M.
    #: shape (j, n): without active limits the best plan is unlimited_state x + sum_q
    #: unlimited_target[q] y_T(k+q).
    unlimited_state: FloatArray
    unlimited_target: FloatArray  #: shape (N, j, m)
    #: output_weight, input_weight, first_output, terminal, correction: as in `condense`; no
    #: terminal cost has shape (0, n), no correction is zero.
    output_weight: FloatArray
    input_weight: float
    first_output: int
    terminal: FloatArray
    correction: FloatArray


class Predictions(NamedTuple):
    """What follows from model and knots alone; names and shapes as in `Horizon`."""

    interpolation: FloatArray
    outputs_state: FloatArray
    outputs_plan: FloatArray
    outputs_held: FloatArray


def predictions(model: LinearModel, knots: tuple[int, ...], samples: int) -> Predictions:
    """Predict the outputs over a horizon, with the same bits on every processor.

    Raises ValueError if the knots are out of their range, or the model has several inputs.
    """
    if not knots or knots[0] != 0 or np.any(np.diff(knots) < 1) or knots[-1] >= samples:
        raise ValueError(
            f"knots must increase from 0 and stay below the horizon of {samples} samples, "
            f"got {knots}"
        )
    if model.B.shape[1] != 1:
        raise ValueError(f"a plan is that of one pump, the model has {model.B.shape[1]} inputs")
    states, outputs = len(model.A), len(model.C)
    interpolation = _interpolation(knots, samples)
    by_state = np.empty((samples, outputs, states))
    pulse = np.empty((samples, outputs))
    by_state[0], pulse[0] = model.C, model.D[:, 0]
    for q in range(1, samples):
        by_state[q] = product(by_state[q - 1], model.A)
        pulse[q] = product(by_state[q - 1], model.B[:, 0])
    by_input = np.zeros((samples, outputs, samples))
    for j in range(samples):
        by_input[j:, :, j] = pulse[: samples - j]
    by_plan = product(by_input.reshape(-1, samples), interpolation)
    return Predictions(
        interpolation, by_state, by_plan.reshape(samples, outputs, -1), pulse.cumsum(axis=0)
    )


def condense(
    model: LinearModel,
    knots: tuple[int, ...],
    samples: int,
    output_weight: FloatArray,
    input_weight: float,
    *,
    first_output: int = 0,
    terminal: FloatArray | None = None,
    correction: FloatArray | None = None,
) -> Horizon:
    """Compute cost and predictions of a plan.

    ValueError is raised if the knots or a weight are out of their range.

    Parameters
    ----------
    model : LinearModel
        Discrete, one input, outputs y.
    knots : tuple of int
        Increasing, from 0; the last one below `samples`.
    samples : int
        N.
    output_weight : ndarray, shape (m,)
        Diagonal of W, zero or more.
    input_weight : float
        Q, positive.
    first_output : int
        Outputs before y(k + first_output) have no weight.
    terminal : ndarray, shape (t, n), optional
        L.
    correction : ndarray, shape (n,), optional
        From the state to an addition to each sample's command, which does not depend on commands.
    """
    weights = np.append(output_weight, input_weight)
    if not (np.isfinite(weights).all() and np.min(output_weight) >= 0 and input_weight > 0):
        raise ValueError(
            "output_weight must be zero or more, input_weight positive, and both finite, got "
            f"{output_weight} and {input_weight}"
        )
    states, outputs = len(model.A), len(model.C)
    predicted = predictions(model, knots, samples)
    interpolation, by_state, by_plan, held = predicted
    power = np.eye(states)
    added = np.zeros(states) if correction is None else correction
    corrections = np.empty((samples, states))
    reach = np.empty((states, samples))  # effect of u(k+q) on x(k+N)
    arrived = model.B[:, 0]
    for q in range(samples):
        corrections[q] = added @ power
        power = model.A @ power
        reach[:, samples - 1 - q] = arrived
        arrived = model.A @ arrived

    root = np.tile(np.sqrt(output_weight), samples)
    root[: first_output * outputs] = 0.0
    rest = np.zeros((0, states)) if terminal is None else terminal
    plan_rows = np.vstack(
        [
            root[:, None] * by_plan.reshape(-1, len(knots)),
            np.sqrt(input_weight) * interpolation,
            rest @ reach @ interpolation,
        ]
    )
    state_rows = np.vstack(
        [root[:, None] * by_state.reshape(-1, states), np.zeros((samples, states)), rest @ power]
    )
    # Solved as a least-squares problem, because the normal equations lose half the digits.
    orthogonal, triangle = np.linalg.qr(plan_rows)
    by_target = np.linalg.solve(triangle, orthogonal[: len(root)].T * root)
    return Horizon(
        knots=np.array(knots),
        interpolation=interpolation,
        outputs_state=by_state,
        outputs_plan=by_plan,
        outputs_held=held,
        hessian=plan_rows.T @ plan_rows,
        unlimited_state=corrections[list(knots)]
        - np.linalg.solve(triangle, orthogonal.T @ state_rows),
        unlimited_target=by_target.reshape(len(knots), samples, outputs).swapaxes(0, 1),
        output_weight=output_weight,
        input_weight=input_weight,
        first_output=first_output,
        terminal=rest,
        correction=added,
    )


def _interpolation(knots: tuple[int, ...], samples: int) -> FloatArray:
    """Hat functions over the knots; zero after the last one."""
    at = np.arange(samples)
    hats = np.array([np.interp(at, knots, row, right=0.0) for row in np.eye(len(knots))])
    return hats.T
