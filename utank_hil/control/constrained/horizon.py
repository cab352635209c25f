"""Cost and predicted motions of a plan over a receding horizon.

The plan holds the command of one pump at a few future samples, its knots; between them the command
is linear, after the last one it is zero. For x(k+1) = A x(k) + B u(k), y(k) = C x(k) + D u(k) all
predictions are linear in the state x(k) and the plan z, and the cost is a sum of squares::

    y(k+q) = outputs_state[q] x + outputs_plan[q] z
    sum_{q >= first_output} |y_T(k+q) - y(k+q)|^2_W + Q sum_q u(k+q)^2 + |L x(k+N)|^2
        = |M z + E x - E_T y_T|^2

With a knot at each of the first hc samples, L = 0 and N = hp this is the cost of generalized
predictive control, thesis (3.8).

Within limits the plan follows from a quadratic programme, built once. There the plan z is the
command at the knots less a steady part c. In units of the greatest pressure, with a slack s by
which the level may exceed its limit::

    minimize    1/2 z'H z + f'z + penalty (s + s^2 / 2)
    subject to  low <= c + z <= high,    |z_j - z_{j-1}| <= rate Ts (samples between),
                -h_max - s <= level <= h_max + s,    s >= 0
"""

from dataclasses import dataclass
from typing import NamedTuple

import daqp
import numpy as np
import numpy.typing as npt

from utank_hil.base.arrays import FloatArray
from utank_hil.base.ordered_sums import product
from utank_hil.control.interface import PumpLimits
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
    """Predict the outputs with the same bits everywhere; ValueError for knots out of range."""
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
    """Compute cost and predictions of a plan for a discrete model of one input and outputs y.

    The `knots` increase from 0 and stay below the `samples`, N. `output_weight`, shape (m,), is the
    diagonal of W, zero or more, `input_weight` is Q, positive; outputs before y(k + `first_output`)
    have no weight. `terminal` is L, shape (t, n). `correction`, shape (n,), leads from the state to
    an addition to each sample's command, which does not depend on commands. ValueError is raised if
    the knots or a weight are out of their range.
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


_OPTIMAL = 1  #: Exit flag of DAQP.


LEVEL_SPACING = 3  # the level is constrained at every third sample
_FREE = 1e30  #: Bound that DAQP takes for none.


class ActiveSetSolver:
    """Warm-started solver of one family of programmes.

    ::

        minimize 1/2 x'H x + f'x    subject to    lower <= (x, G x) <= upper

    A dual active-set method is exact to rounding, needs few iterations when it starts from the
    active set of the last solution, and allocates no memory during a solution (DAQP: Arnström,
    Bemporad, Axehill, IEEE Transactions on Automatic Control 67 (2022) 4362-4369).

    `hessian` is H, shape (n, n), positive definite, and `rows` is G, shape (m, n);
    `iteration_limit` is that of a solution. ValueError is raised if the programme cannot be set up.
    """

    def __init__(self, hessian: FloatArray, rows: FloatArray, iteration_limit: int) -> None:
        bounds = len(hessian) + len(rows)
        self._model = daqp.Model()
        self._cold = np.zeros(bounds, dtype=np.int32)
        self._warm = True
        self.iterations = 0  #: Iterations of the last solution.
        flag, _ = self._model.setup(
            hessian, np.zeros(len(hessian)), rows, np.ones(bounds), -np.ones(bounds), self._cold
        )
        if flag < 0:
            raise ValueError(f"the quadratic programme cannot be set up (DAQP flag {flag})")
        self._model.settings = {"iter_limit": iteration_limit}

    @property
    def iteration_limit(self) -> int:
        """Limit on the iterations of a solution."""
        return int(self._model.settings["iter_limit"])

    def forget(self) -> None:
        """Discard the active set of the last solution."""
        self._warm = False

    def solve(
        self, gradient: FloatArray, lower: FloatArray, upper: FloatArray
    ) -> FloatArray | None:
        """Return the minimizer, or None if the iteration limit was reached.

        `gradient` has shape (n,); `lower` and `upper`, shape (n + m,), bound the variables, then
        the rows.
        """
        sense = None if self._warm else self._cold
        self._model.update(f=gradient, bupper=upper, blower=lower, sense=sense)
        x, _, flag, info = self._model.solve()
        self.iterations = int(info["iterations"])
        self._warm = flag == _OPTIMAL
        return np.array(x) if self._warm else None


class PlanProgramme:
    """Programme of a horizon in Pa, with j knots, within limits.

    `level_output` is the index of the level among the outputs; None leaves the level free.
    `level_penalty` is the cost of a metre above the limit, in the unit of the horizon's cost.
    """

    def __init__(
        self,
        horizon: Horizon,
        limits: PumpLimits,
        sample_time_s: float,
        level_output: int | None,
        level_penalty: float,
        iteration_limit: int,
    ) -> None:
        knots, samples = len(horizon.knots), len(horizon.interpolation)
        end = 0 if level_output is None else samples
        #: shape (l,): samples of the horizon at which the level is constrained.
        self.held = np.arange(LEVEL_SPACING - 1, end, LEVEL_SPACING)
        levels = len(self.held)
        self._by_plan: FloatArray = horizon.outputs_plan[self.held, level_output or 0]
        self.level_m = limits.level_m
        self._rise_pa = limits.rate_pa_s * sample_time_s * np.diff(horizon.knots, prepend=-1)

        self._unit_pa = limits.pressure_pa
        cost = self._cost(horizon.hessian)
        penalty = level_penalty / cost
        self._gradient_scale = limits.pressure_pa / cost
        self._knots = knots
        self._gradient = np.full(knots + 1, penalty)
        self._lower = np.full(2 * knots + 1 + 2 * levels, -_FREE)
        self._upper = np.full(len(self._lower), _FREE)
        self._lower[knots] = 0.0
        self._rates = slice(knots + 1, 2 * knots + 1)
        self._low_side = slice(2 * knots + 1 + levels, None)
        self._high_side = slice(2 * knots + 1, 2 * knots + 1 + levels)
        self._solver = self._set_up(horizon.hessian, iteration_limit)

    def rebuild(self, hessian: FloatArray) -> None:
        """Rebuild the solver for another cost and the programme's present numbers."""
        self._solver = self._set_up(hessian, self._solver.iteration_limit)
        self.forget()

    def _cost(self, hessian: FloatArray) -> float:
        return float(np.trace(hessian * (self._unit_pa * self._unit_pa))) / len(hessian)

    def _set_up(self, hessian: FloatArray, iteration_limit: int) -> ActiveSetSolver:
        """Return the solver, in units of the greatest pressure."""
        unit, knots, levels = self._unit_pa, len(hessian), len(self.held)
        whole = np.zeros((knots + 1, knots + 1))
        whole[:knots, :knots] = hessian * (unit * unit) / self._cost(hessian)
        whole[knots, knots] = self._gradient[knots]
        slack = np.ones((levels, 1))
        by_plan = self._by_plan * unit
        steps = np.eye(knots) - np.eye(knots, k=-1)
        rows = np.block([[steps, np.zeros((knots, 1))], [by_plan, -slack], [by_plan, slack]])
        return ActiveSetSolver(whole, rows, iteration_limit)

    def forget(self) -> None:
        """Discard the active set of the last solution."""
        self._solver.forget()

    def respects(
        self, plan: FloatArray, low: FloatArray, high: FloatArray, last: float, levels: FloatArray
    ) -> bool:
        """Whether a plan keeps all limits; arguments as for `solve`."""
        if (plan < low).any() or (plan > high).any():
            return False
        steps = np.diff(plan, prepend=last)
        if (np.abs(steps) > self._rise_pa).any():
            return False
        return bool((np.abs(levels + product(self._by_plan, plan)) <= self.level_m).all())

    def solve(
        self,
        gradient: FloatArray,
        low: FloatArray,
        high: FloatArray,
        last: float,
        levels: FloatArray,
    ) -> FloatArray | None:
        """Return the best plan in Pa, shape (j,), or None if the iteration limit was reached.

        `gradient` is f, per Pa; the plan is within `low` and `high`, all of shape (j,). `last` is
        the last sent command, less the steady part; `levels`, shape (l,), are those at the samples
        `held` with the steady command alone.
        """
        unit, knots = self._unit_pa, self._knots
        lower, upper = self._lower, self._upper
        self._gradient[:knots] = gradient * self._gradient_scale
        lower[:knots], upper[:knots] = low / unit, high / unit
        rates = self._rise_pa / unit
        lower[self._rates], upper[self._rates] = -rates, rates
        lower[self._rates.start] += last / unit
        upper[self._rates.start] += last / unit
        upper[self._high_side] = self.level_m - levels
        lower[self._low_side] = -self.level_m - levels
        solution = self._solver.solve(self._gradient, lower, upper)
        return None if solution is None else solution[:knots] * unit
