"""A predictive law designed for ship, tank and sea.

The predictor is designed for the plant of the loop: ship and tank, the drive's lag, the delay from
sensor to pump, and the waves. A wave moment in groups around a peak is modelled as white noise
through a lightly damped oscillator::

    K'' + 2 zeta wp K' + wp^2 K = noise

A white disturbance of the pump's pressure stands for all model errors: the greater it is, the less
the predictor relies on its model, and the greater the margins.
"""

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated, Final, Literal, Protocol

import numpy as np

from utank_hil.base.arrays import ComplexArray, FloatArray
from utank_hil.base.elementary import tanh
from utank_hil.base.parameters import (
    NotNegative,
    Positive,
    Problem,
    Range,
    SampleTime,
    range_problems,
    refuse,
)
from utank_hil.control.arx import ARX, discrete_matrices
from utank_hil.control.interface import BuiltLaw, Controller, DesignPlant, LinearLaw
from utank_hil.control.predictive.law import PredictiveLaw, design_dpc, design_gpc
from utank_hil.dynamics.linear import STATES, state_matrices
from utank_hil.dynamics.sampling import LinearModel, noise_covariance, sample
from utank_hil.dynamics.ship import RollShip


class WashableLaw(LinearLaw, Protocol):
    """A linear law whose controller can subtract the mean of its outputs itself."""

    def controller(self, washout_share: float = 0.0) -> Controller:
        """Return a new controller at rest; `washout_share` as in `WashoutLaw.share`."""


@dataclass(frozen=True, slots=True)
class WashoutLaw:
    """A law on outputs without their mean.

    Wind, cargo and turning cause a list that the tank should not oppose: the pump would hold
    pressure for hours and leave less level for the waves. The mean of each output is subtracted::

        s(k) = s(k-1) + (1 - exp(-w0 Ts)) (y(k) - s(k-1)),    the law gets y(k) - s(k)
    """

    law: WashableLaw
    corner_rad_s: float  #: w0, far below the ship's roll frequency.

    def __post_init__(self) -> None:
        if not (math.isfinite(self.corner_rad_s) and self.corner_rad_s > 0):
            raise ValueError(f"washout corner_rad_s must be positive, got {self.corner_rad_s}")

    @property
    def sample_time_s(self) -> float:
        """Time between two steps."""
        return self.law.sample_time_s

    @property
    def share(self) -> float:
        """Weight of the newest sample in the mean."""
        half = tanh(self.corner_rad_s * self.sample_time_s / 2)
        return 2 * half / (1 + half)

    def controller(self) -> Controller:
        """Return a new controller at rest; a reference is relative to the mean."""
        return self.law.controller(self.share)

    def response(self, z: ComplexArray) -> ComplexArray:
        """Transfer matrix at the points `z`, shape (N,); shape (N, r, m)."""
        mean = self.share / (1 - (1 - self.share) / np.asarray(z))
        return self.law.response(z) * (1 - mean)[:, None, None]

    def matrices(self) -> LinearModel:
        """State-space model from y to u: the law's own states, then the means."""
        law, share = self.law.matrices(), self.share
        states, outputs = law.B.shape
        keep = 1 - share
        a = np.block(
            [[law.A, -keep * law.B], [np.zeros((outputs, states)), keep * np.eye(outputs)]]
        )
        b = np.vstack([keep * law.B, share * np.eye(outputs)])
        c = np.hstack([law.C, -keep * law.D])
        return LinearModel(a, b, c, keep * law.D, law.dt)


if TYPE_CHECKING:
    from control import StateSpace


MOST_ORDER: Final = 500
"""Limit on the order of a predictor; its law has as many states per output, and the cost of judging
it grows with their cube."""
MOST_SAMPLES: Final = 1000  #: Limit on a horizon, far beyond the range of a wave forecast.
WASHOUT_SHARE: Final = 0.25
"""Greatest corner frequency of a washout over the ship's roll frequency. There it removes 3 % of
the roll and turns its phase by 14 degrees; above, it removes the roll itself."""


def finite_memory_arx(
    system: "StateSpace | LinearModel",
    process_covariance: FloatArray,
    measurement_covariance: FloatArray,
    order: int,
) -> ARX:
    """ARX model of least prediction error variance.

    A Kalman predictor uses the whole past, an ARX model of order p only p samples. The best one is
    the Kalman predictor started p samples ago from the stationary distribution of the state. With
    K_j its gains (oldest first) and F_j = A - K_j C::

        alpha_i = C F_p ... F_{p-i+2} K_{p-i+1},    beta_i = C F_p ... F_{p-i+2} (B - K_{p-i+1} D)

    Truncating the stationary predictor to p samples is much worse where its memory is longer, as it
    is with waves and a lightly damped tank.

    ::

        x(k+1) = A x(k) + B u(k) + w(k),    y(k) = C x(k) + D u(k) + v(k)

    The model is discrete and stable, with n states and m outputs. The white noises w and v have the
    covariances `process_covariance`, shape (n, n), and `measurement_covariance`, shape (m, m),
    positive definite; `order` is p. ValueError is raised if the model is not discrete or not
    stable, or an argument has the wrong shape.
    """
    from scipy.linalg import solve_discrete_lyapunov

    a, b, c, d, sample_time_s = discrete_matrices(system)
    states, outputs = a.shape[0], c.shape[0]
    if order < 1:
        raise ValueError(f"ARX order must be at least 1, got {order}")
    if process_covariance.shape != (states, states):
        raise ValueError(f"process_covariance must have shape ({states}, {states})")
    if measurement_covariance.shape != (outputs, outputs):
        raise ValueError(f"measurement_covariance must have shape ({outputs}, {outputs})")
    if np.abs(np.linalg.eigvals(a)).max() >= 1:
        raise ValueError("the model must be stable: it has no stationary state to start from")
    covariance = solve_discrete_lyapunov(a, process_covariance)
    gains = []
    for _ in range(order):
        surprise = c @ covariance @ c.T + measurement_covariance
        gain = np.linalg.solve(surprise, c @ covariance @ a.T).T
        covariance = a @ covariance @ a.T - gain @ surprise @ gain.T + process_covariance
        covariance = (covariance + covariance.T) / 2
        gains.append(gain)
    alpha, beta, row = [], [d], c
    for gain in reversed(gains):
        alpha.append(row @ gain)
        beta.append(row @ (b - gain @ d))
        row = row @ (a - gain @ c)
    return ARX(np.array(alpha), np.array(beta), sample_time_s)


def measured_problems(measured: tuple[str, ...], *needed: str) -> list[Problem]:
    """Find errors in names of outputs, of which the `needed` ones must be present."""
    if measured and set(needed) <= set(measured) <= set(STATES):
        return []
    besides = f", {' and '.join(needed)} with them" if needed else ""
    return [("measured", f"must name outputs among {', '.join(STATES)}{besides}, got {measured}")]


def weight_problems(name: str, weight: tuple[float, ...]) -> list[Problem]:
    """Find the error of weights that are all zero, for which the best law is none."""
    if any(each > 0 for each in weight):
        return []
    return [(name, f"must have a positive number: with {weight} the law does nothing")]


def washed(law: WashableLaw, washout_rad_s: float, ship: RollShip) -> LinearLaw:
    """Return a law with its washout, or unchanged for a corner of zero.

    ValueError is raised if the corner is so near to the roll frequency that the washout removes the
    roll, too.
    """
    if washout_rad_s == 0:
        return law
    most = WASHOUT_SHARE * ship.natural_frequency_rad_s
    if washout_rad_s > most:
        reason = (
            f"must be {most:.3g} at most, a quarter of the ship's roll frequency, or the law does "
            f"not see the roll; got {washout_rad_s:g}"
        )
        refuse("design", [("washout_rad_s", reason)])
    return WashoutLaw(law, washout_rad_s)


def per_output(name: str, values: tuple[float, ...], measured: tuple[str, ...]) -> Problem:
    """Error of a parameter that does not have one value for each output."""
    return (name, f"must have one value per measured output, {len(measured)} of them, got {values}")


@dataclass(frozen=True, slots=True)
class Predictor:
    """Parameters of the predictor; with a ship and tank they determine its ARX model."""

    #: Outputs, in order: ``"roll_rad"``, ``"roll_rate_rad_s"``, ``"level_m"``,
    #: ``"level_rate_m_s"``.
    measured: tuple[str, ...]
    #: Standard deviation of the white noise on each, in its unit.
    measurement_std: tuple[Positive, ...]
    order: Annotated[int, Range(least=1, most=MOST_ORDER)]  #: Number p of past samples.
    #: Peak frequency wp of the wave moment, below half the sampling frequency.
    wave_peak_rad_s: Positive
    wave_damping_ratio: Positive  #: zeta; small for long groups.
    #: RMS of the effective wave slope, wave moment per roll stiffness of the ship.
    wave_slope_rad: Positive
    #: Root of the two-sided density of the white pressure disturbance.
    pressure_noise_pa_rt_s: NotNegative
    sample_time_s: SampleTime = 0.2

    def __post_init__(self) -> None:
        problems = [*measured_problems(self.measured), *range_problems(self)]
        if len(self.measurement_std) != len(self.measured):
            problems.append(per_output("measurement_std", self.measurement_std, self.measured))
        nyquist_rad_s = np.pi / self.sample_time_s if self.sample_time_s > 0 else np.inf
        if self.wave_peak_rad_s >= nyquist_rad_s:
            reason = (
                f"must be below {nyquist_rad_s:.3g}, half the frequency of the samples, or the law "
                f"never sees the waves; got {self.wave_peak_rad_s:g}"
            )
            problems.append(("wave_peak_rad_s", reason))
        refuse("predictor", problems)


@dataclass(frozen=True, slots=True)
class PredictiveDesign:
    """Parameters of a predictive law."""

    kind: Literal["gpc", "dpc"]  #: Type of the law.
    predictor: Predictor
    control_horizon: Annotated[int, Range(least=1, most=MOST_SAMPLES)]
    prediction_horizon: Annotated[int, Range(least=1, most=MOST_SAMPLES)]
    #: One for each measured output. None, for DPC alone, is the exact deadbeat.
    output_weight: tuple[NotNegative, ...] | None = None
    first_output: Annotated[int, Range(least=0)] = 0  #: See `design_gpc`; for GPC alone.
    #: Corner frequency of the washout that removes the steady list (`WashoutLaw`), at most a
    #: quarter of the ship's roll frequency; 0 for none.
    washout_rad_s: NotNegative = 0.0

    def __post_init__(self) -> None:
        problems = [*range_problems(self), *self._horizon_problems()]
        measured = self.predictor.measured
        if self.kind not in ("gpc", "dpc"):
            problems.append(("kind", f"must be gpc or dpc, got {self.kind}"))
        if self.kind == "gpc" and self.output_weight is None:
            reason = "GPC needs an output_weight for each measured output"
            problems.append(("output_weight", reason))
        if self.output_weight is not None and len(self.output_weight) != len(measured):
            problems.append(per_output("output_weight", self.output_weight, measured))
        elif self.output_weight is not None:
            problems += weight_problems("output_weight", self.output_weight)
        refuse("predictive design", problems)

    def _horizon_problems(self) -> list[Problem]:
        control, prediction = self.control_horizon, self.prediction_horizon
        deadbeat = self.kind == "dpc"
        problems = []
        if control > prediction - deadbeat:
            most = "below prediction_horizon" if deadbeat else "prediction_horizon at most"
            reason = f"must be {most}, got {control} and {prediction}"
            problems.append(("control_horizon", reason))
        if deadbeat and self.first_output:
            reason = "belongs to GPC; DPC weighs from control_horizon on"
            problems.append(("first_output", reason))
        elif self.first_output >= prediction:
            reason = f"must be below prediction_horizon, got {self.first_output} and {prediction}"
            problems.append(("first_output", reason))
        return problems

    def law(self, plant: DesignPlant) -> LinearLaw:
        """Design the law for a plant."""
        return washed(self._predictive_law(plant), self.washout_rad_s, plant.ship)

    def build(self, plant: DesignPlant) -> BuiltLaw:
        """Design the law for a plant."""
        law = self.law(plant)
        return BuiltLaw(law.controller, self.predictor.measured, law)

    def _predictive_law(self, plant: DesignPlant) -> PredictiveLaw:
        arx = wave_arx(self.predictor, plant)
        if self.kind == "dpc":
            return design_dpc(
                arx, self.control_horizon, self.prediction_horizon, self.output_weight
            )
        if self.output_weight is None:
            raise ValueError("GPC needs an output_weight for each measured output")
        return design_gpc(
            arx,
            self.control_horizon,
            self.prediction_horizon,
            self.output_weight,
            first_output=self.first_output,
        )


def wave_plant(predictor: Predictor, plant: DesignPlant) -> tuple[LinearModel, FloatArray]:
    """Sampled model of ship, tank, drive and wave moment, and its process noise.

    The model is from the pump's command to `STATES`, with states of ship and tank, wave moment, lag
    and past commands; the covariance has shape (n, n).
    """
    # of greater loss, laws of greater weights would miss their margins in small motions
    a_ship, b_ship = state_matrices(plant.ship, plant.tanks[-1])
    pressure, wave = b_ship[:, :1], b_ship[:, 1:]
    wp, zeta = predictor.wave_peak_rad_s, predictor.wave_damping_ratio
    n = len(STATES)
    a = np.zeros((n + 2, n + 2))
    a[:n, :n] = a_ship
    a[:n, n : n + 1] = wave * plant.ship.stiffness_nm_rad * predictor.wave_slope_rad
    a[n:, n:] = [[0.0, 1.0], [-(wp**2), -2 * zeta * wp]]
    b = np.vstack([pressure, np.zeros((2, 1))])
    noise = np.zeros((n + 2, 2))
    noise[n + 1, 0] = np.sqrt(4 * zeta * wp**3)  # gives the wave state an RMS of one
    noise[:, 1] = b[:, 0] * predictor.pressure_noise_pa_rt_s
    model = LinearModel(a, b, np.eye(n, n + 2), np.zeros((n, 1)), 0.0)
    sampled = sample(model, predictor.sample_time_s, plant.delay_s, plant.lag_s)
    process = np.zeros(sampled.A.shape)
    process[: n + 2, : n + 2] = noise_covariance(a, noise, predictor.sample_time_s)
    return sampled, process


def wave_arx(predictor: Predictor, plant: DesignPlant) -> ARX:
    """ARX model of least prediction error for a ship and tank in waves."""
    model, process = wave_plant(predictor, plant)
    rows = [STATES.index(name) for name in predictor.measured]
    measurement = np.diag(np.square(predictor.measurement_std))
    seen = model._replace(C=model.C[rows], D=model.D[rows])
    return finite_memory_arx(seen, process, measurement, predictor.order)
