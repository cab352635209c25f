"""A constrained predictive law designed for ship, tank and expected sea.

A Kalman filter on the model of ship, tank, drive, waves and heel (`sea_plant`) estimates the state;
its wave forecast is part of every prediction. The cost is roll, level and pressure over the horizon
plus a terminal cost: roll and level with the tank passive, or the cost of the unlimited law, which
knows the sea, from there on. Without either, a plan that leaves the ship swinging would be cheap.
The part of the motion due to a steady heel is subtracted first.
"""

import math
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Annotated, Final, Literal

import numpy as np

from utank_hil.base.arrays import FloatArray
from utank_hil.base.parameters import (
    NotNegative,
    Positive,
    Range,
    SampleTime,
    Share,
    range_problems,
    refuse,
)
from utank_hil.control.constrained.horizon import condense
from utank_hil.control.constrained.law import ConstrainedLaw
from utank_hil.control.constrained.preview import Waves
from utank_hil.control.interface import BuiltLaw, DesignPlant, PumpLimits
from utank_hil.control.lqg import kalman_predictor
from utank_hil.control.predictive.design import measured_problems, per_output
from utank_hil.control.sea_model import SeaModel
from utank_hil.dynamics import RollShip
from utank_hil.dynamics.linear import STATES, state_matrices
from utank_hil.dynamics.sampling import LinearModel, noise_covariance

# A step must end well inside its tick for any measurement. With each of these at its limit, a sea
# model of the greatest order, and random measurements of up to 100 times any motion, which use up
# the iterations, the slowest of 1200 steps took 1.5 to 2.5 ms of one thread's time on a shared
# server (AMD EPYC); with 40 knots 0.9 ms, the median 0.24 ms. The default has 19.
MOST_KNOTS: Final = 60
MOST_HORIZON: Final = 400
MOST_ITERATIONS: Final = 200
LEAST_AHEAD: Final = 0.38
"""Least time over the roll period that a forecast must reach: of shorter ones, perfectly known, the
shipped laws can be unstable on a ship with 1.3 times its period (docs/control.md)."""
# A metre above the level limit costs as much as this roll over the whole horizon.
_PENALTY_ROLL_RAD = 0.05


def sea_plant(
    sea: SeaModel,
    plant: DesignPlant,
    *,
    sample_time_s: float,
    pressure_noise_pa_rt_s: float = 0.0,
    slope_noise_rad_rt_s: float = 0.0,
    heel_std_rad: float = 0.0,
    heel_time_s: float = 1.0,
) -> tuple[LinearModel, FloatArray, FloatArray, FloatArray]:
    """Sampled model of ship, tank, drive, waves and a slowly varying heeling moment.

    The waves are white noise through the shaping filter of a `SeaModel`, with a moment that is
    linear between two samples. The noises and the heel are those of `ConstrainedDesign`.

    Returns the model from the pump's command to `STATES`, its process covariance, shape (n, n), and
    row and noise of `Waves`, shape (n,). Its states are `STATES` (less the direct effect of the
    command), lag and past commands, waves, and last the heel.
    """
    a, b = state_matrices(plant.ship, plant.tank)
    pressure, slope = b[:, :1], b[:, 1:] * plant.ship.stiffness_nm_rad
    count = len(STATES)
    pump = plant.sampled(STATES, sample_time_s)
    before, after = _straight_line_effect(a, slope, sample_time_s)
    waves = sea.shaping_filter(sample_time_s)
    keep = np.exp(-sample_time_s / heel_time_s)

    inner, n = len(pump.A), len(pump.A) + len(waves.A) + 1
    sea_states, heel = slice(inner, n - 1), n - 1
    whole = np.zeros((n, n))
    whole[:inner, :inner] = pump.A
    whole[sea_states, sea_states] = waves.A
    whole[heel, heel] = keep
    whole[:count, sea_states] = before @ waves.C + after @ waves.C @ waves.A
    whole[:count, heel] = (before + after * keep)[:, 0]
    noise = np.zeros((n, 2))
    noise[sea_states, :1] = waves.B
    noise[:count, :1] = after @ waves.C @ waves.B
    noise[heel, 1] = heel_std_rad * np.sqrt(1 - keep**2)
    noise[:count, 1] = after[:, 0] * noise[heel, 1]
    covariance = noise @ noise.T
    white = np.hstack([pressure * pressure_noise_pa_rt_s, slope * slope_noise_rad_rt_s])
    covariance[:count, :count] += noise_covariance(a, white, sample_time_s)
    rest = np.zeros((n - inner, 1))
    model = LinearModel(
        whole,
        np.vstack([pump.B, rest]),
        np.hstack([pump.C, np.zeros((count, n - inner))]),
        pump.D,
        sample_time_s,
    )
    row = np.zeros(n)
    row[sea_states] = waves.C[0]
    return model, covariance, row, noise[:, 0]


def _straight_line_effect(
    a: FloatArray, b: FloatArray, time_s: float
) -> tuple[FloatArray, FloatArray]:
    """Effect of the first and the last value of a linearly varying input, after a time."""
    from scipy.linalg import expm

    n = len(a)
    block = np.zeros((n + 2, n + 2))
    block[:n, :n], block[:n, n : n + 1] = a * time_s, b * time_s
    block[n, n + 1] = 1.0
    whole = expm(block)
    after = whole[:n, n + 1 :]
    return whole[:n, n : n + 1] - after, after


@dataclass(frozen=True, slots=True)
class ConstrainedDesign:
    """Parameters of a constrained predictive law."""

    kind: Literal["constrained_gpc"]
    sea: SeaModel  #: Expected sea.
    #: Measured outputs, in order, the level among them; names of `STATES`.
    measured: tuple[str, ...] = ("roll_rad", "roll_rate_rad_s", "level_m")
    #: Standard deviation of the white noise on each, in its unit.
    measurement_std: tuple[Positive, ...] = (2e-4, 5e-4, 3.5e-3)
    #: Root of the two-sided density of a white pressure disturbance, which stands for model errors.
    pressure_noise_pa_rt_s: NotNegative = 10e3
    #: Root of the two-sided density of a white roll moment, per roll stiffness.
    slope_noise_rad_rt_s: NotNegative = 2.5e-3
    #: Samples of the horizon at which the plan holds the command, increasing from 0; 60 at most.
    knots: tuple[Annotated[int, Range()], ...] = (
        *(0, 1, 2, 3, 4, 6, 8, 10, 13, 16, 19, 23, 27, 31, 36, 41, 46, 51, 56),
    )
    #: Samples N that are planned, 400 at most.
    horizon: Annotated[int, Range(least=1, most=MOST_HORIZON)] = 60
    #: Square of the roll angle that costs as much as the greatest pressure throughout.
    pressure_weight_rad2: Positive = 2.1e-4
    #: Square of the roll angle that costs as much as a level of one metre.
    level_weight_rad2_m2: NotNegative = 3e-5
    #: Distance of the plan from the limit on the level; None for the standard deviation of the
    #: level's forecast one sample ahead, the error that a plan cannot know.
    level_margin_m: NotNegative | None = None
    #: Standard deviation and time constant of a slowly varying heel.
    heel_std_rad: NotNegative = 0.01
    heel_time_s: Positive = 50e3  #: Standard deviation and time constant of a slowly varying heel.
    #: Part of that heel which the tank removes, 0 to 1. With 0 the pump holds no steady pressure
    #: and the roll about the heel is controlled; the level limit still includes the level due to
    #: the heel.
    heel_share: Share = 0.0
    #: Limit on the iterations of a quadratic programme, 200 at most.
    iteration_limit: Annotated[int, Range(least=1, most=MOST_ITERATIONS)] = 60
    sample_time_s: SampleTime = 0.2

    def __post_init__(self) -> None:
        problems = [*measured_problems(self.measured, "roll_rad", "level_m"), *range_problems(self)]
        if len(self.measurement_std) != len(self.measured):
            problems.append(per_output("measurement_std", self.measurement_std, self.measured))
        if len(self.knots) > MOST_KNOTS:
            reason = f"must be {MOST_KNOTS} at most, or a step may outlast its tick"
            problems.append(("knots", f"{reason}, got {len(self.knots)}"))
        rising = all(early < late for early, late in pairwise(self.knots))
        if not (self.knots and self.knots[0] == 0 and rising and self.knots[-1] < self.horizon):
            reason = f"must increase from 0 and stay below the horizon of {self.horizon} samples"
            problems.append(("knots", f"{reason}, got {self.knots}"))
        refuse("constrained design", problems)

    def law(self, plant: DesignPlant) -> ConstrainedLaw:
        """Design the law for a plant; it plans within the plant's limits."""
        limits = plant.limits
        whole, covariance, row, noise = sea_plant(
            self.sea,
            plant,
            pressure_noise_pa_rt_s=self.pressure_noise_pa_rt_s,
            slope_noise_rad_rt_s=self.slope_noise_rad_rt_s,
            heel_std_rad=self.heel_std_rad,
            heel_time_s=self.heel_time_s,
            sample_time_s=self.sample_time_s,
        )
        variance = np.square(self.measurement_std)
        rows = [STATES.index(name) for name in self.measured]
        model = whole._replace(C=whole.C[rows], D=whole.D[rows])
        observer_gain, surprise = kalman_predictor(model, covariance, np.diag(variance))
        level, margin_m = self.measured.index("level_m"), self.level_margin_m
        if margin_m is None:
            margin_m = float(np.sqrt(surprise[level, level]))
        if not margin_m < limits.level_m:
            reason = (
                f"{margin_m:g} leaves nothing of the level limit {limits.level_m} m: "
                "lower it, or raise the limit"
            )
            refuse("constrained design", [("level_margin_m", reason)])
        weights = {"roll_rad": 1.0, "level_m": self.level_weight_rad2_m2}
        weight = np.array([weights.get(name, 0.0) for name in self.measured])
        horizon = condense(
            model,
            self.knots,
            self.horizon,
            weight,
            self.pressure_weight_rad2 / limits.pressure_pa**2,
            terminal=_cost_of_law(model, weight, self.pressure_weight_rad2, limits.pressure_pa),
        )
        steady_state, steady_command = _steady(whole, self.heel_share)
        return ConstrainedLaw(
            model=model,
            observer_gain=observer_gain,
            horizon=horizon,
            limits=PumpLimits(
                limits.pressure_pa, limits.rate_pa_s, limits.level_m - margin_m, limits.power_w
            ),
            level_output=level,
            level_penalty=_PENALTY_ROLL_RAD**2 * self.horizon,
            reservoir_area_m2=plant.tank.reservoir_area_m2,
            steady_state=steady_state,
            steady_command=steady_command,
            iteration_limit=self.iteration_limit,
            waves=Waves(row, noise, covariance, variance),
        )

    def build(self, plant: DesignPlant) -> BuiltLaw:
        """Design the law for a plant."""
        law = self.law(plant)
        return BuiltLaw(law.controller, self.measured, law)


def previewed(law: BuiltLaw, ship: RollShip) -> BuiltLaw:
    """The law taking forecasts of the waves, if it is one that can (`ConstrainedLaw`)."""
    linear = law.linear
    if not isinstance(linear, ConstrainedLaw) or law.controller != linear.controller:
        return law
    foreseeing = linear.previewed(LEAST_AHEAD * 2 * math.pi / ship.natural_frequency_rad_s)
    return replace(law, controller=foreseeing.controller, linear=foreseeing)


def _cost_of_law(
    model: LinearModel, weight: FloatArray, pressure_weight: float, unit_pa: float
) -> FloatArray:
    """Factor L with |L x|^2 the least cost from the state x on, less the heel, its last element."""
    from scipy.linalg import solve_discrete_are

    n = len(model.A)
    a, c = model.A[:-1, :-1], model.C[:, :-1]
    b, d = unit_pa * model.B[:-1], unit_pa * model.D
    weighed = weight[:, None]
    cost = solve_discrete_are(
        a, b, c.T @ (weighed * c), pressure_weight + d.T @ (weighed * d), s=c.T @ (weighed * d)
    )
    return np.hstack([_root(cost), np.zeros((n - 1, 1))])


def _root(cost: FloatArray) -> FloatArray:
    values, vectors = np.linalg.eigh((cost + cost.T) / 2)
    root: FloatArray = np.sqrt(np.maximum(values, 0.0))[:, None] * vectors.T
    return root


def _steady(plant: LinearModel, share: float) -> tuple[FloatArray, FloatArray]:
    """Equilibrium under the heel, the last state, with that share of it removed by the pump."""
    n = len(plant.A)
    motion = slice(0, n - 1)
    rest = np.eye(n - 1) - plant.A[motion, motion]
    by_heel = np.linalg.solve(rest, plant.A[motion, -1])
    by_pump = np.linalg.solve(rest, plant.B[motion, 0])
    roll = STATES.index("roll_rad")
    roll_by_heel = plant.C[roll, motion] @ by_heel
    roll_by_pump = plant.C[roll, motion] @ by_pump + plant.D[roll, 0]
    command = -share * roll_by_heel / roll_by_pump
    state, steady_command = np.zeros((n, n)), np.zeros(n)
    state[motion, -1] = by_heel + by_pump * command
    state[-1, -1] = 1.0
    steady_command[-1] = command
    return state, steady_command
