"""The quadratic programme of a constrained plan, built once.

The plan z is the command at the knots less a steady part c. In units of the greatest pressure, with
a slack s by which the level may exceed its limit::

    minimize    1/2 z'H z + f'z + penalty (s + s^2 / 2)
    subject to  low <= c + z <= high,    |z_j - z_{j-1}| <= rate Ts (samples between),
                -h_max - s <= level <= h_max + s,    s >= 0
"""

import daqp
import numpy as np

from utank_hil.base.arrays import FloatArray
from utank_hil.base.ordered_sums import product
from utank_hil.control.constrained.horizon import Horizon
from utank_hil.control.interface import PumpLimits

_OPTIMAL = 1


LEVEL_SPACING = 3  # the level is constrained at every third sample
_FREE = 1e30


class ActiveSetSolver:
    """Warm-started solver of one family of programmes.

    ::

        minimize 1/2 x'H x + f'x    subject to    lower <= (x, G x) <= upper

    A dual active-set method is exact to rounding, needs few iterations when it starts from the
    active set of the last solution, and allocates no memory during a solution (DAQP: Arnström,
    Bemporad, Axehill, IEEE Transactions on Automatic Control 67 (2022) 4362-4369).

    `hessian` is H, shape (n, n), positive definite, and `rows` is G, shape (m, n). ValueError is
    raised if the programme cannot be set up.

    Parameters
    ----------
    hessian : ndarray, shape (n, n)
        H, positive definite.
    rows : ndarray, shape (m, n)
        G.
    iteration_limit : int
        Limit on the iterations of a solution.
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
    """Programme of a horizon within limits.

    Parameters
    ----------
    horizon : Horizon
        In Pa; j knots.
    level_output : int or None
        Index of the level among the outputs; None leaves the level free.
    level_penalty : float
        Cost of a metre above the limit, in the unit of the horizon's cost.
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
        self._level_m = limits.level_m
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
        return bool((np.abs(levels + product(self._by_plan, plan)) <= self._level_m).all())

    def solve(
        self,
        gradient: FloatArray,
        low: FloatArray,
        high: FloatArray,
        last: float,
        levels: FloatArray,
    ) -> FloatArray | None:
        """Return the best plan in Pa, shape (j,), or None if the iteration limit was reached.

        Parameters
        ----------
        gradient : ndarray, shape (j,)
            f, per Pa.
        low, high : ndarray, shape (j,)
            Bounds of the plan.
        last : float
            The last sent command, less the steady part.
        levels : ndarray, shape (l,)
            Levels at the samples `held` with the steady command alone.
        """
        unit, knots = self._unit_pa, self._knots
        lower, upper = self._lower, self._upper
        self._gradient[:knots] = gradient * self._gradient_scale
        lower[:knots], upper[:knots] = low / unit, high / unit
        rates = self._rise_pa / unit
        lower[self._rates], upper[self._rates] = -rates, rates
        lower[self._rates.start] += last / unit
        upper[self._rates.start] += last / unit
        upper[self._high_side] = self._level_m - levels
        lower[self._low_side] = -self._level_m - levels
        solution = self._solver.solve(self._gradient, lower, upper)
        return None if solution is None else solution[:knots] * unit
