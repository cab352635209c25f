"""Predictive control that plans within the limits of pump and tank.

Each sample it finds the plan of least cost (`utank_hil.control.constrained.horizon`) with::

    |P| <= pressure limit          at every knot
    P At h' <= power limit         at every knot, with the water's speed h' of the last plan
    |P(q+1) - P(q)| <= rate Ts     along the plan, and from the last sent command
    |h| <= level limit + s         s >= 0, at a cost

The pressure can always be brought to zero at its rate limit and s is unbounded, so a plan exists
for any level and waves. As long as the analytic optimum, linear in the state, keeps all limits, it
is the plan; else a quadratic programme is solved (`utank_hil.control.constrained.horizon`).
If this reaches its iteration limit, the last plan continues; a plan ends in the steady command,
zero without a heel correction, so the tank is passive if that persists.
"""

import math
from dataclasses import dataclass, replace
from typing import Annotated

import numpy as np

from utank_hil.base.arrays import MOST_MEASURED, ComplexArray, FloatArray
from utank_hil.base.ordered_sums import product
from utank_hil.base.parameters import Checked, Positive, Problem, Range
from utank_hil.control.constrained.foresight import foreseen
from utank_hil.control.constrained.horizon import Horizon, PlanProgramme, condense
from utank_hil.control.constrained.preview import Foresight, Preview, Waves
from utank_hil.control.interface import PumpLimits, WaveForecast
from utank_hil.control.lqg import SHARES, GentleController, LQGLaw
from utank_hil.dynamics.sampling import LinearModel

_GRID_BITS = 20
"""Binary digits of a command along a limit; 2^-20 is the tolerance of the solver.

A plan often follows a limit, at a round pressure or a whole number of steps from one, where a
comparison or the rounding of a message depends on its last digit, which differs between processors.
Rounding to a grid makes it equal on all.
"""
_FOLLOWED = 0.02  # over the greatest pressure; a mean command this near the plan's counts as it


@dataclass(frozen=True, slots=True, eq=False)
class ConstrainedLaw(Checked, owner="constrained law"):
    """Parameters of a `ConstrainedController`; a linear law while no limit is active.

    ValueError is raised if a value is out of its range, or the power is limited and no level is
    measured.
    """

    model: LinearModel  #: Discrete, from the pump's command to the m measured outputs.
    #: shape (n, m): l of ``x(k+1) = A x(k) + B u(k) + L (y(k) - C x(k) - D u(k))``.
    observer_gain: FloatArray
    horizon: Horizon  #: Cost and predictions of `model`.
    limits: PumpLimits  #: Its pressure, rate, level and power are used.
    #: Index of the level among the outputs; None leaves level and power unlimited.
    level_output: int | None
    #: Cost of a metre above the level limit, in the unit of the horizon's cost.
    level_penalty: Positive
    reservoir_area_m2: Positive  #: At, for the power.
    #: shape (n, n): from the state to its part due to a steady heel, which the cost leaves out.
    steady_state: FloatArray
    #: shape (n,): from the state to the command that belongs to that part.
    steady_command: FloatArray
    iteration_limit: Annotated[int, Range(least=1)] = 60  #: Limit on the iterations of a programme.
    waves: Waves | None = None  #: In the first states of `model`; None if it has none.
    #: How a plan uses forecasts; its horizon then has N more states, the noises to come.
    foresight: Foresight | None = None
    #: shape (len(SHARES) - 1, n): gains of the linear law for less pressure (`GentleController`);
    #: without them it takes shares of its gain.
    gentler: FloatArray | None = None
    #: Most by which a plan's first pressure differs from the linear law's within the limits, over
    #: the greatest pressure; None for any difference.
    leeway: Annotated[float, Range(above=0)] | None = None

    def _problems(self) -> list[Problem]:
        problems, outputs = [], len(self.model.C)
        if self.level_output is not None and not 0 <= self.level_output < outputs:
            reason = f"must be one of the {outputs} outputs, 0 to {outputs - 1}"
            problems.append(("level_output", f"{reason}, got {self.level_output}"))
        if self.level_output is None and self.limits.power_w < math.inf:
            reason = (
                f"{self.limits.power_w:g} can't be kept without the water's speed: name the "
                "level_output, or set power_w to infinity"
            )
            problems.append(("limits.power_w", reason))
        return problems

    @property
    def sample_time_s(self) -> float:
        """Time between two steps."""
        return self.model.dt

    def controller(self) -> "ConstrainedController":
        """Return a new steppable controller, at rest."""
        return ConstrainedController(self)

    def matrices(self) -> LinearModel:
        """State-space model from y to u while no limit is active."""
        return self.unlimited().matrices()

    def response(self, z: ComplexArray) -> ComplexArray:
        """Transfer matrix without active limits at the points `z`, shape (N,); shape (N, 1, m)."""
        return self.unlimited().response(z)

    def following(self, law: LQGLaw) -> "ConstrainedLaw":
        """Return the law that commands what a linear law does while no limit is active.

        Both estimates run side by side. The plan is that of this law plus, at each sample, the
        difference between the two commands. Without innovations the difference decays as the linear
        law's estimate converges to the plan's. `law` has the same outputs, and a model whose
        estimate follows the same commands.
        """
        from scipy.linalg import block_diag

        own, other = self.model, law.model
        f = len(other.A)

        def padded(matrix: FloatArray) -> FloatArray:
            return np.hstack([matrix, np.zeros((len(matrix), f))])

        expected = np.hstack([law.observer_gain @ own.C, other.A - law.observer_gain @ other.C])
        whole = LinearModel(
            np.vstack([padded(own.A), expected]),
            np.vstack([own.B, other.B]),
            padded(own.C),
            own.D,
            own.dt,
        )
        return replace(
            self,
            model=whole,
            observer_gain=np.vstack([self.observer_gain, law.observer_gain]),
            horizon=self._horizon(whole, np.append(self.unlimited().gain, -law.gain)),
            steady_state=block_diag(self.steady_state, np.zeros((f, f))),
            steady_command=np.append(self.steady_command, np.zeros(f)),
        )

    def previewed(self, least_ahead_s: float = 0.0) -> "ConstrainedLaw":
        """The law that takes forecasts of waves; ValueError if it has no model of them."""
        from scipy.linalg import block_diag

        if self.waves is None:
            raise ValueError("a law without a model of the sea can't weigh a forecast of the waves")
        samples = len(self.horizon.interpolation)
        least = min(max(math.ceil(least_ahead_s / self.sample_time_s), 1), samples)
        ahead, foresight = foreseen(self.waves, self.model, samples, least)

        def padded(row: FloatArray) -> FloatArray:
            return np.append(row, np.zeros(samples))

        return replace(
            self,
            horizon=self._horizon(ahead, padded(self.horizon.correction)),
            steady_state=block_diag(self.steady_state, np.zeros((samples, samples))),
            steady_command=padded(self.steady_command),
            foresight=foresight,
        )

    def foreseeing(self, samples: int) -> LQGLaw:
        """Linear law by a perfect forecast of so many samples; ValueError if it takes none."""
        if self.foresight is None:
            raise ValueError("the law takes no forecasts: it is not previewed")
        n, at = len(self.model.A), np.arange(samples)
        weights, by_state = self.foresight.weights(at, 0.0), self.foresight.by_state[at]
        state: FloatArray = -self.foresight.learnt[:, at] @ np.linalg.solve(weights, by_state)
        state[:n] += np.eye(n)
        return LQGLaw(self.model, product(self._gain, state), self.observer_gain)

    def _horizon(self, model: LinearModel, correction: FloatArray) -> Horizon:
        """Return the horizon for a model with more states, which the terminal cost leaves out."""
        horizon = self.horizon
        more = len(model.A) - horizon.terminal.shape[1]
        return condense(
            model,
            tuple(horizon.knots.tolist()),
            len(horizon.interpolation),
            horizon.output_weight,
            horizon.input_weight,
            first_output=horizon.first_output,
            terminal=np.pad(horizon.terminal, ((0, 0), (0, more))),
            correction=correction,
        )

    def unlimited(self) -> LQGLaw:
        """Linear law that the controller follows while no limit is active."""
        return LQGLaw(self.model, self._gain[:, : len(self.model.A)], self.observer_gain)

    @property
    def _gain(self) -> FloatArray:
        """From the state, and the noises to come, to the pressure: u = -K x."""
        rest = np.eye(len(self.steady_state)) - self.steady_state
        return -(product(self.horizon.unlimited_state[:1], rest) + self.steady_command)

    def clipped(self) -> GentleController:
        """Return a new controller of the linear law; it takes shares of the pressure."""
        law, gains = self.unlimited(), self.gentler
        if gains is None:
            gains = np.multiply.outer(np.array(SHARES[1:]), law.gain[0])
        return GentleController(law, gains)


class ConstrainedController:
    """Stepping of a `ConstrainedLaw`.

    `limited` says whether a limit changed the last plan; `fallbacks` is the number of programmes
    that reached their iteration limit.
    """

    def __init__(self, law: ConstrainedLaw) -> None:
        model, horizon, limits = law.model, law.horizon, law.limits
        self.sample_time_s = model.dt
        self._a, self._b, self._c, self._d = model.A, model.B[:, 0], model.C, model.D[:, 0]
        self._observer_gain = law.observer_gain
        self._plan_gain = product(
            horizon.unlimited_state, np.eye(len(law.steady_state)) - law.steady_state
        )
        self._target_gains = horizon.unlimited_target
        self._constant_target_gain: FloatArray = horizon.unlimited_target.sum(axis=0)
        self._hessian = horizon.hessian
        self._steady_command = law.steady_command
        self._interpolation = horizon.interpolation
        self._programme = PlanProgramme(
            horizon, limits, model.dt, law.level_output, law.level_penalty, law.iteration_limit
        )
        output = law.level_output or 0
        held = horizon.outputs_held[:, output]
        self._levels_state = horizon.outputs_state[:, output] + held[:, None] * law.steady_command
        self._levels_plan = horizon.outputs_plan[:, output]
        self._held_state = self._levels_state[self._programme.held]
        self._pressure_pa = self._allowed_pa = limits.pressure_pa
        self._grid_pa = math.ldexp(1.0, math.frexp(limits.pressure_pa)[1] - _GRID_BITS)
        self._step_pa = limits.rate_pa_s * model.dt
        self._reach_pa = self._step_pa * (horizon.knots + 1.0)
        samples = len(horizon.interpolation)
        self._next = np.minimum(horizon.knots + 1, samples - 1)
        self._knots = np.minimum(horizon.knots, samples - 2)
        power_pa_m_s = limits.power_w / law.reservoir_area_m2
        self._power_pa_m_s = math.inf if law.level_output is None else power_pa_m_s
        self._leeway_pa = None if law.leeway is None else law.leeway * limits.pressure_pa
        self._preview = None if law.foresight is None else Preview(law.foresight, model.dt)
        self.reset()

    def derive(self) -> None:
        """Rebuild the programme after numbers of the controller were replaced."""
        self._programme.rebuild(self._hessian)

    def reset(self) -> None:
        """Set state, plan and command to zero."""
        self._state = np.zeros(len(self._a))
        self._plan_pa = np.zeros(len(self._interpolation))
        self._command_pa = 0.0  # the last returned command
        self._before_pa = 0.0  # the sent command before it
        self._mean_pa = 0.0  # mean of the commands sent since then
        self._mean_before_pa = 0.0
        self._last_pa = 0.0  # the last sent command
        self.limited = False
        self.fallbacks = 0
        self._programme.forget()
        if self._preview is not None:
            self._preview.reset()

    def preview(self, forecast: WaveForecast | None) -> None:
        """Take a forecast of the waves for the next step; only a `previewed` law uses it."""
        if self._preview is not None:
            self._preview.take(forecast)

    @property
    def doubts_forecasts(self) -> bool:
        """Whether forecasts are ignored, as they do not agree with the motion."""
        return self._preview is not None and self._preview.doubted

    def step(self, y: FloatArray, reference: FloatArray | None = None) -> FloatArray:
        """Take the newest measurement, shape (m,), and return the command, shape (1,).

        `reference`, shape (m,) or (N, m), is the target of the outputs: one for the whole horizon,
        or one for each sample of it.
        """
        self.observe(y)
        state = self._state if self._preview is None else self._preview.expected(self._state)
        best = product(self._plan_gain, state)
        if reference is not None:
            if reference.ndim == 1:
                best += product(self._constant_target_gain, reference)
            else:
                gains = self._target_gains.swapaxes(0, 1).reshape(len(best), -1)
                best += product(gains, reference.ravel())
        self._plan_pa = self._plan(best, state, float(product(self._steady_command, state)))
        # The solver keeps its bounds only to a tolerance.
        low, high = self._last_pa - self._step_pa, self._last_pa + self._step_pa
        command = min(max(float(self._plan_pa[0]), low), high)
        command = min(max(command, -self._pressure_pa), self._pressure_pa)
        if self.limited:
            command = self._on_grid(command)
        self._before_pa = self._last_pa
        self._command_pa = self._mean_pa = self._last_pa = command
        return np.array([command])

    def allow(self, share: float) -> None:
        """Set the share of the pressure limit that the next plan may use."""
        self._allowed_pa = share * self._pressure_pa

    def observe(self, y: FloatArray) -> None:
        """Update the estimate by a measurement as `step` does, without planning.

        A measurement with any output that is none (`MOST_MEASURED`) corrects nothing.
        """
        state, mean = self._state, self._mean_pa
        surprise = y - product(self._c, state) - self._d * mean
        if not np.abs(y).max() < MOST_MEASURED:  # so for NaN, too
            surprise = np.zeros(len(surprise))
        ahead = product(self._a, state) + self._b * mean
        self._state = ahead + product(self._observer_gain, surprise)
        self._mean_before_pa = mean

    def applied(self, u: FloatArray) -> None:
        """Take the mean of the commands sent since the last step, shape (1,).

        The last of them follows from it: the value that the returned command would reach, at once
        or at the rate limit, if the mean agrees with that, else a linear extrapolation from the
        mean.
        """
        mean = float(u[0])
        change = self._command_pa - self._before_pa
        ramped = self._command_pa - change * abs(change) / (2 * self._step_pa)
        near = _FOLLOWED * self._pressure_pa
        if abs(mean - self._command_pa) < near or abs(mean - ramped) < near:
            last = self._command_pa
        else:
            last = mean + (mean - self._mean_before_pa) / 2
        self._mean_pa = mean
        self._last_pa = min(max(last, -self._pressure_pa), self._pressure_pa)

    def _on_grid(self, command: float) -> float:
        """Round to the nearest command of the grid, or to the limit if that is nearer."""
        command = float(np.rint(command / self._grid_pa)) * self._grid_pa + 0.0  # not -0.0
        if 0 < abs(command) - self._allowed_pa < self._grid_pa:
            return math.copysign(self._allowed_pa, command)
        return command

    def _plan(self, best: FloatArray, state: FloatArray, steady_pa: float) -> FloatArray:
        """Commands at each sample of the horizon; `best` is the analytic plan."""
        low, high = self._bounds(state, steady_pa, best)
        last = self._last_pa - steady_pa
        levels = product(self._held_state, state)
        plan: FloatArray | None = best
        self.limited = not self._programme.respects(best, low, high, last, levels)
        if self.limited:
            plan = self._programme.solve(-product(self._hessian, best), low, high, last, levels)
        if plan is None:
            self.fallbacks += 1
            return np.append(self._plan_pa[1:], steady_pa)
        return product(self._interpolation, plan) + steady_pa

    def _rises_too_far(self, state: FloatArray, plan: FloatArray) -> float:
        """Rise to starboard in the next sample beyond the level's limit; zero if it is within."""
        levels = product(self._levels_state, state) + product(self._levels_plan, plan)
        if float(np.abs(levels).max()) <= self._programme.level_m:
            return 0.0
        return float(levels[1] - levels[0])

    def _bounds(
        self, state: FloatArray, steady_pa: float, best: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        """Least and greatest pressure at the knots, less the steady command, about a plan."""
        high = np.full(len(self._knots), self._allowed_pa)
        low = -high
        if self._power_pa_m_s < math.inf:
            plan = self._plan_pa[self._next] - steady_pa
            levels = product(self._levels_state, state) + product(self._levels_plan, plan)
            speed = np.diff(levels)[self._knots] / self.sample_time_s
            share = self._power_pa_m_s / np.maximum(np.abs(speed), 1e-9)
            high = np.where(speed > 0, np.minimum(high, share), high)
            low = np.where(speed < 0, np.maximum(low, -share), low)
        if self._leeway_pa is not None:
            near_pa = min(max(best[0] + steady_pa, low[0]), high[0])
            rising = self._rises_too_far(state, np.clip(best, low - steady_pa, high - steady_pa))
            if rising <= 0:
                low[0] = max(low[0], near_pa - self._leeway_pa)
            if rising >= 0:
                high[0] = min(high[0], near_pa + self._leeway_pa)
        # a bound is relaxed to what the rate limit can reach
        high = np.maximum(high, self._last_pa - self._reach_pa)
        low = np.minimum(low, self._last_pa + self._reach_pa)
        return low - steady_pa, high - steady_pa
