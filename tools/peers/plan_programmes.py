"""Programmes of the constrained controller in the storm, set up by hand from its horizon.

The shipped controller sails through the measured storm hour; each step in which a limit bends its
plan is one programme, as `utank_hil.control.constrained.plan_programme` defines it::

    minimize    1/2 z'H z + f'z + penalty (s + s^2 / 2)
    subject to  |z| <= 1,    |z_j - z_{j-1}| <= rate Ts (samples between),
                -h_max - s <= level <= h_max + s,    s >= 0

with pressures in units of the greatest one and the cost divided by the mean of H's diagonal. What
is here follows the formulas, not the code, of the project, so that it is a check on it.
"""

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from utank_hil.analysis.loop.loop_simulation import passive_motion, simulate_loop
from utank_hil.base.arrays import FloatArray
from utank_hil.base.tick import TICK_S
from utank_hil.configuration import ControllerConfig, load_config
from utank_hil.control.constrained.design import ConstrainedDesign
from utank_hil.control.constrained.law import ConstrainedController, ConstrainedLaw
from utank_hil.control.constrained.plan_programme import LEVEL_SPACING
from utank_hil.sea import EffectiveSlope, Sea, load_ndbc

CONFIGS = Path(__file__).resolve().parents[2] / "configs"
CONTROLLER = CONFIGS / "controllers" / "constrained_gpc.yaml"
STORM = CONFIGS / "seas" / "ndbc_41010_2019-02_spectral_density.txt"
HOUR = "2019-02-10T05:40"


@dataclass(frozen=True, slots=True, eq=False)
class Step:
    """What the controller knew in one step, and what it answered.

    Attributes
    ----------
    measured : ndarray, shape (m,)
    applied_pa : float or None
        Mean of the commands that left since the step before; None in the first step.
    state : ndarray, shape (n,)
        Of the predictor, with `measured` in it.
    last_pa : float
        The command that left last.
    limited : bool
        Whether a limit bent the plan.
    first_pa : float
        First command of the plan.
    """

    measured: FloatArray
    applied_pa: float | None
    state: FloatArray
    last_pa: float
    limited: bool
    first_pa: float


@dataclass(frozen=True, slots=True, eq=False)
class Programme:
    """One programme over (z, s), and the same in terms of the state.

    Attributes
    ----------
    gradient : ndarray, shape (j + 1,)
    lower, upper : ndarray, shape (j + 1 + r,)
        Of the unknowns, then of the rows.
    state : ndarray, shape (n,)
        Less the part that a steady heel explains.
    last : float
        The command that left last, of the greatest pressure.
    level_offset_m : ndarray, shape (N,)
        Level along the horizon that is not in `state`.
    """

    gradient: FloatArray
    lower: FloatArray
    upper: FloatArray
    state: FloatArray
    last: float
    level_offset_m: FloatArray


def constrained_design(every_sample: bool = False) -> tuple[ConstrainedDesign, ControllerConfig]:
    """The shipped design and its configuration; on demand with a knot at every sample."""
    config = load_config(CONTROLLER, ControllerConfig)
    design = config.law
    if not isinstance(design, ConstrainedDesign):
        raise ValueError(f"{CONTROLLER}: a law of kind constrained_gpc is needed")
    if np.isfinite(config.limits.power_w) or design.heel_share:
        raise ValueError(
            f"{CONTROLLER}: the comparison is made for a law without power limit and heel_share, "
            f"got power_w {config.limits.power_w} and heel_share {design.heel_share}"
        )
    if every_sample:
        design = replace(design, knots=tuple(range(design.horizon)))
    return design, config


def constrained_law(design: ConstrainedDesign, config: ControllerConfig) -> ConstrainedLaw:
    """The law of a design on the configured vessel."""
    return design.law(config.plant)


class _Recording(ConstrainedController):
    """Keeps what it was told and what it planned."""

    def __init__(self, law: ConstrainedLaw) -> None:
        self.steps: list[Step] = []
        self._told: float | None = None
        super().__init__(law)

    def applied(self, u: FloatArray) -> None:
        self._told = float(u[0])
        super().applied(u)

    def step(self, y: FloatArray, reference: FloatArray | None = None) -> FloatArray:
        self._measured = y.copy()
        return super().step(y, reference)

    def _plan(self, best: FloatArray, steady_pa: float) -> FloatArray:
        plan = super()._plan(best, steady_pa)
        self.steps.append(
            Step(
                self._measured,
                self._told,
                self._state.copy(),
                self._last_pa,
                self.limited,
                float(plan[0]),
            )
        )
        return plan


def sail(
    law: ConstrainedLaw, config: ControllerConfig, measured: tuple[str, ...], seconds: float
) -> list[Step]:
    """Every step of the controller in the storm, seed 1."""
    ship, tank = config.vessel.ship, config.vessel.tank
    sea = Sea.irregular(load_ndbc(STORM).at(HOUR), seed=1)
    moment = sea.roll_moment(ship.stiffness_nm_rad, EffectiveSlope(0.5))
    waves = passive_motion(ship, tank, moment, TICK_S, round(seconds / TICK_S))
    controller = _Recording(law)
    simulate_loop(config.plant, waves, controller, measured, seed=1)
    return controller.steps


class ProgrammeFamily:
    """All programmes of a law: the matrices, and the vectors of a step.

    Parameters
    ----------
    law : ConstrainedLaw
        Without power limit and steady command.

    Attributes
    ----------
    hessian : ndarray, shape (j + 1, j + 1)
    rows : ndarray, shape (r, j + 1)
    held : ndarray of int
        Samples of the horizon at which the level is held.
    rise : ndarray, shape (j,)
        How far the command may move up to each knot, of the greatest pressure.
    penalty : float
        Of the slack; cost in units of `cost`.
    cost : float
        Unit of the cost, rad^2.
    """

    def __init__(self, law: ConstrainedLaw) -> None:
        horizon, limits = law.horizon, law.limits
        self._law, self._unit_pa = law, limits.pressure_pa
        knots = len(horizon.knots)
        hessian = horizon.hessian * self._unit_pa**2
        self.cost = float(np.mean(np.diag(hessian)))
        self.penalty = law.level_penalty / self.cost
        self.level_m = limits.level_m
        self.held = np.arange(LEVEL_SPACING - 1, len(horizon.interpolation), LEVEL_SPACING)
        gaps = np.diff(horizon.knots, prepend=-1)
        self.rise = gaps * limits.rate_pa_s * law.sample_time_s / self._unit_pa
        output = self._level_output()
        by_plan = horizon.outputs_plan[self.held, output] * self._unit_pa
        none, one = np.zeros((knots, 1)), np.ones((len(self.held), 1))
        self.hessian = np.block(
            [[hessian / self.cost, none], [none.T, np.full((1, 1), self.penalty)]]
        )
        change = np.eye(knots) - np.eye(knots, k=-1)
        self.rows = np.block([[change, none], [by_plan, -one], [by_plan, one]])

    def _level_output(self) -> int:
        if self._law.level_output is None:
            raise ValueError("the law must hold the level")
        return self._law.level_output

    def programme(self, step: Step) -> Programme:
        """The programme of a step."""
        law, horizon = self._law, self._law.horizon
        state = step.state - law.steady_state @ step.state
        last = step.last_pa / self._unit_pa
        best = horizon.unlimited_state @ state / self._unit_pa
        gradient = np.append(-self.hessian[:-1, :-1] @ best, self.penalty)
        level = horizon.outputs_state[:, self._level_output()]
        free = level[self.held] @ step.state
        knots, rise = len(best), self.rise.copy()
        first = np.zeros(knots)
        first[0] = last
        infinite = np.full(len(self.held), np.inf)
        return Programme(
            gradient=gradient,
            lower=np.concatenate(
                [-np.ones(knots), [0.0], first - rise, -infinite, -self.level_m - free]
            ),
            upper=np.concatenate(
                [np.ones(knots), [np.inf], first + rise, self.level_m - free, infinite]
            ),
            state=state,
            last=last,
            level_offset_m=level @ (step.state - state),
        )
