"""A constrained law designed for a ship and a sea by itself, with the margins that are required.

Sizes follow from scales. With the passive roll's RMS s in the expected sea, roll frequency w,
greatest pressure P and level limit h:

* pressure P all the time costs as much as 0.106 s^2, level h as much as 0.33 s^2;
* white pressure disturbance 11 P s / sqrt(w), white slope 0.046 s / sqrt(w), heel 0.13 s;
* sample time 0.1 / w, plans of 12 / w of it, level margin h / 20.

What is left to choose is how far the law trusts ship and sea. A doubt is added, noise at all
frequencies or energy of the sea below the roll frequency, as little of it as gives the law all
margins. This is done for several shapes of the doubt and two weights of the level. The law with the
least predicted cost is taken.
"""

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Annotated, Final, Literal, NamedTuple, Protocol

import numpy as np

from utank_hil.analysis.loop.closed_loop import closed_loop_radius
from utank_hil.analysis.loop.loop_simulation import SensorNoise
from utank_hil.analysis.loop.robustness import (
    EXTRA_DELAY_S,
    GAINS,
    PERIOD_SCALES,
    Robustness,
    robustness,
)
from utank_hil.analysis.loop.scaled_law import NoLawError
from utank_hil.arrays import FloatArray
from utank_hil.control.constrained.design import ConstrainedDesign
from utank_hil.control.constrained.law import ConstrainedLaw
from utank_hil.control.constrained.sea_plant import sea_plant
from utank_hil.control.design_plant import DesignPlant
from utank_hil.control.interface import BuiltLaw
from utank_hil.control.lqg import LQGLaw
from utank_hil.control.sea_model import SeaModel
from utank_hil.dynamics.linear import STATES, pump_model, state_matrices
from utank_hil.dynamics.sampling import LinearModel, sample
from utank_hil.dynamics.ship import RollShip
from utank_hil.parameters import Range, range_problems, refuse
from utank_hil.sea import ittc
from utank_hil.tick import TICK_S

_PRESSURE_COST: Final = 0.106
_LEVEL_COST: Final = 0.33


class _Doubt(NamedTuple):
    """A shape of the doubt, for a knob of one, and the level's weight that goes with it."""

    noise: float
    """Of the slope, over s / sqrt(w)."""
    low: float
    """Low floor of the sea."""
    corner: float
    """Of that floor, over w."""
    level: float
    """Factor on the level's weight."""


_DOUBTS: Final = tuple(
    _Doubt(*shape, level)
    for shape in ((1.0, 0.0, 0.9), (0.1, 1.0, 0.9), (0.1, 1.0, 0.8))
    for level in (1.0, 3.0)
)
_KNOB: Final = (1e-4, 3.0)
_BISECTIONS: Final = 5
_ORDER: Final = 16
_LEAST_FLOOR: Final = 1.3e-4
_OMEGA: Final = np.geomspace(0.05, 30.0, 1500)
"""Over roll frequency: the slope of short waves falls slowly, and they are in the sensors."""
_UNKNOWN_PERIOD: Final = 0.8
_UNKNOWN_HEIGHT: Final = 0.019
"""In m per square second of the roll period: 3 m for a ship of 12.6 s."""
_UNKNOWN_SLOPE: Final = 0.5
_MORE_DOUBT: Final = 1.6
_MORE_DOUBTS: Final = 6
_COSTLIER: Final = 3.0
_MOST_STEPS: Final = 8
_MEASURED: Final = ("roll_rad", "roll_rate_rad_s", "level_m")


class SlopeDensity(Protocol):
    """What a law is told of a sea."""

    def slope_density(self, omega_rad_s: FloatArray) -> FloatArray:
        """One-sided density of the effective wave slope over encounter frequency."""


@dataclass(frozen=True, slots=True)
class Prediction:
    """Root mean squares without limits, and the mean power.

    Attributes
    ----------
    roll_rad, level_m, pressure_pa : float
    power_w : float
        Mean of what the pump puts into the water, what it takes out not counted.
    """

    roll_rad: float
    level_m: float
    pressure_pa: float
    power_w: float


@dataclass(frozen=True, slots=True)
class SelfTuned:
    """A law with all required margins.

    Attributes
    ----------
    design : ConstrainedDesign
    law : ConstrainedLaw
    robustness : Robustness
    passive_roll_rad : float
    prediction : Prediction
        In the sea that it expects.
    """

    design: ConstrainedDesign
    law: ConstrainedLaw
    robustness: Robustness
    passive_roll_rad: float
    prediction: Prediction


def self_tuned(
    plant: DesignPlant,
    sea: SlopeDensity,
    *,
    noise: SensorNoise = SensorNoise(),  # noqa: B008 - frozen
    mean_power_w: float = math.inf,
    sample_time_s: float | None = None,
) -> SelfTuned:
    """The constrained law of least predicted cost that has all margins and keeps a mean power.

    Parameters
    ----------
    plant : DesignPlant
        With the limits of its pump.
    sea : SlopeDensity
        Known, estimated or assumed.
    noise : SensorNoise
        Of the sensors, as measured.
    mean_power_w : float
        Budget of the predicted power; infinite for the greatest comfort.
    sample_time_s : float, optional
        Instead of the one that follows from the roll frequency.

    Raises
    ------
    NoLawError
        If no law has the margins, or the sea does not roll the ship.
    """
    search = _Search(plant, sea, noise, sample_time_s)
    found, doubt = search.best()
    for power in range(1, _MOST_STEPS + 1):
        if found.prediction.power_w <= mean_power_w:
            return found
        gentler = search.least_doubt(doubt, _COSTLIER**power)
        found = gentler or found
    raise NoLawError(
        f"no law puts less than {mean_power_w:g} W in the mean into the water; the gentlest one "
        f"puts {found.prediction.power_w:.3g} W"
    )


def passive_roll_rad(plant: DesignPlant, sea: SlopeDensity) -> float:
    """Roll RMS of the ship with the passive tank in a sea."""
    w = plant.ship.natural_frequency_rad_s * _OMEGA
    a, b = state_matrices(plant.ship, plant.tank)
    effect = b[:, 1] * plant.ship.stiffness_nm_rad
    resolvent = 1j * w[:, None, None] * np.eye(len(a)) - a
    roll = np.linalg.solve(resolvent, effect.astype(complex)[None, :, None])[:, 0, 0]
    return math.sqrt(float(np.trapezoid(np.abs(roll) ** 2 * sea.slope_density(w), w)))


@dataclass(frozen=True, slots=True)
class SelfTunedDesign:
    """A constrained law that is designed for its ship and sea by itself.

    Parameters
    ----------
    kind : {"self_tuned"}
    sea : SeaModel or None
        The sea it expects, of which spectrum and effective slope count; None where none is known.
    mean_power_w : float
        Most that the pump may put into the water in the mean, predicted; infinite for the greatest
        comfort.
    """

    kind: Literal["self_tuned"]
    sea: SeaModel | None = None
    mean_power_w: Annotated[float, Range(above=0, infinite=True)] = math.inf

    def __post_init__(self) -> None:
        refuse("self-tuned design", range_problems(self))

    def tuned(self, plant: DesignPlant) -> SelfTuned:
        """The design and its law for a plant.

        Raises
        ------
        NoLawError
            As `self_tuned`.
        """
        sea = self.sea or unknown_sea(plant.ship)
        return self_tuned(plant, sea, mean_power_w=self.mean_power_w)

    def build(self, plant: DesignPlant) -> BuiltLaw:
        """Design the law for a plant."""
        law = self.tuned(plant).law
        return BuiltLaw(law.controller, _MEASURED, law)


def unknown_sea(ship: RollShip) -> SeaModel:
    """What a law expects of a sea that is not known: broad, its peak above the roll frequency."""
    period_s = 2 * math.pi / ship.natural_frequency_rad_s
    spectrum = ittc(_UNKNOWN_HEIGHT * period_s**2, _UNKNOWN_PERIOD * period_s)
    return SeaModel(
        tuple(spectrum.frequency_hz.tolist()),
        tuple(spectrum.density.tolist()),
        effective_slope=_UNKNOWN_SLOPE,
    )


class _Search:
    """One ship in one sea: what is designed, predicted and judged again and again."""

    def __init__(
        self,
        plant: DesignPlant,
        sea: SlopeDensity,
        noise: SensorNoise,
        sample_time_s: float | None = None,
    ) -> None:
        self._plant, self._std = plant, (noise.roll_rad, noise.roll_rate_rad_s, noise.level_m)
        self._roll_rad = passive_roll_rad(plant, sea)
        if not (math.isfinite(self._roll_rad) and self._roll_rad > 0):
            raise NoLawError("the sea does not roll the ship: there is nothing to design a law for")
        w = plant.ship.natural_frequency_rad_s
        self._step_s = sample_time_s or sample_time_of(plant)
        omega = w * _OMEGA
        self._sea = SeaModel.of_slope(
            omega,
            sea.slope_density(omega),
            order=_ORDER,
            floor=_LEAST_FLOOR,
            smoothing_rad_s=_short(min(0.028 * w, 1.0)),
        )
        self._truth = sea_plant(
            self._sea,
            plant,
            pressure_noise_pa_rt_s=0.0,
            slope_noise_rad_rt_s=0.0,
            heel_std_rad=0.0,
            heel_time_s=1.0,
            sample_time_s=self._step_s,
        )
        self._hard_cases = list(self._longest_and_shortest_period())

    def best(self) -> tuple[SelfTuned, _Doubt]:
        """The law of least predicted cost, and the doubt that it has."""
        found = [
            (self._cost(tuned.prediction), tuned, doubt)
            for doubt in _DOUBTS
            if (tuned := self.least_doubt(doubt)) is not None
        ]
        if not found:
            raise NoLawError("no constrained law has all margins on this ship: choose another tank")
        return min(found, key=lambda each: each[0])[1:]

    def _cost(self, predicted: Prediction) -> float:
        limits, share = self._plant.limits, self._roll_rad**2
        return (
            predicted.roll_rad**2
            + _LEVEL_COST * share * (predicted.level_m / limits.level_m) ** 2
            + _PRESSURE_COST * share * (predicted.pressure_pa / limits.pressure_pa) ** 2
        )

    def least_doubt(self, doubt: _Doubt, costlier: float = 1.0) -> SelfTuned | None:
        """The law with as little of a doubt as gives it all margins, or None.

        The pressure costs so many times its scaled weight.
        """
        low, high = (math.log(end) for end in _KNOB)
        for _ in range(_BISECTIONS):
            middle = (low + high) / 2
            if self._stands_hard_cases(self._design(doubt, math.exp(middle), costlier)):
                high = middle
            else:
                low = middle
        for _ in range(_MORE_DOUBTS):
            tuned = self._judged(self._design(doubt, math.exp(high), costlier))
            if tuned is not None:
                return tuned
            high += math.log(_MORE_DOUBT)
        return None

    def _stands_hard_cases(self, design: ConstrainedDesign) -> bool:
        try:
            law = design.law(self._plant).unlimited()
        except (ValueError, ArithmeticError):  # LinAlgError is one of the former
            return False
        return all(closed_loop_radius(law, model, gain) < 1 for model, gain in self._hard_cases)

    def _judged(self, design: ConstrainedDesign) -> SelfTuned | None:
        """A law with all margins, or None."""
        if not self._stands_hard_cases(design):
            return None
        law = design.law(self._plant)
        linear = law.unlimited()
        judged = robustness(linear, self._plant, _MEASURED, with_delay_margin=False)
        if judged.failures():
            return None
        return SelfTuned(design, law, judged, self._roll_rad, self._prediction(linear))

    def _design(self, doubt: _Doubt, knob: float, costlier: float) -> ConstrainedDesign:
        limits, roll = self._plant.limits, self._roll_rad
        w = self._plant.ship.natural_frequency_rad_s
        root = math.sqrt(w)
        sea = replace(
            self._sea, low_floor=_short(doubt.low * knob), low_corner_rad_s=_short(doubt.corner * w)
        )
        return ConstrainedDesign(
            "constrained_gpc",
            sea,
            measurement_std=self._std,
            pressure_noise_pa_rt_s=_short(11.0 * limits.pressure_pa * roll / root),
            slope_noise_rad_rt_s=_short((0.046 + doubt.noise * math.sqrt(knob)) * roll / root),
            after_horizon="law",
            pressure_weight_rad2=_short(_PRESSURE_COST * costlier * roll**2),
            level_weight_rad2_m2=_short(_LEVEL_COST * doubt.level * roll**2 / limits.level_m**2),
            level_margin_m=_short(limits.level_m / 20),
            heel_std_rad=_short(0.13 * roll),
            sample_time_s=self._step_s,
        )

    def _longest_and_shortest_period(self) -> Iterator[tuple[LinearModel, float]]:
        """Where a law mostly fails first: at the longest and the shortest roll period."""
        ship, plant = self._plant.ship, self._plant
        for scale in (PERIOD_SCALES[-1], PERIOD_SCALES[0]):
            other = replace(ship, stiffness_nm_rad=ship.stiffness_nm_rad / scale**2)
            model = pump_model(other, plant.tank, _MEASURED)
            late_s = plant.delay_s + (EXTRA_DELAY_S if scale < 1 else 0.0)
            sampled = sample(model, self._step_s, late_s, plant.lag_s)
            yield from ((sampled, gain) for gain in (GAINS[0], GAINS[-1]))

    def _prediction(self, law: LQGLaw) -> Prediction:
        """Of the loop in the sea that was given, by its covariance; pressures in units of P."""
        from scipy.linalg import solve_discrete_lyapunov

        unit, n = self._plant.limits.pressure_pa, len(law.model.A)
        pressures = slice(len(STATES), n - _ORDER - 1)
        scale = np.ones(n)
        scale[pressures] = unit
        gain, observer = law.gain * scale / unit, law.observer_gain / scale[:, None]
        a, c = law.model.A * scale / scale[:, None], law.model.C * scale
        b, d = law.model.B * unit / scale[:, None], law.model.D * unit
        truth, process = self._truth
        whole, reach = truth.C * scale, truth.D * unit
        rows = [STATES.index(name) for name in _MEASURED]
        # model and truth differ in the sea alone
        true_a = truth.A * scale / scale[:, None]
        closed = np.block(
            [
                [true_a, -b @ gain],
                [
                    observer @ whole[rows],
                    a - b @ gain - observer @ (c - d @ gain + reach[rows] @ gain),
                ],
            ]
        )
        noise = np.zeros((2 * n, 2 * n))
        noise[:n, :n] = process / scale / scale[:, None]
        noise[n:, n:] = observer @ np.diag(np.square(self._std)) @ observer.T
        spread = solve_discrete_lyapunov(closed, noise)
        command = np.hstack([np.zeros((1, n)), -gain])
        motion = np.hstack([whole, np.zeros_like(whole)]) + reach @ command
        rms = np.sqrt(np.diag(motion @ spread @ motion.T))
        pressure = math.sqrt(float((command @ spread @ command.T)[0, 0]))
        speed = STATES.index("level_rate_m_s")
        together = float((command @ spread @ motion[speed])[0])
        return Prediction(
            roll_rad=float(rms[STATES.index("roll_rad")]),
            level_m=float(rms[STATES.index("level_m")]),
            pressure_pa=pressure * unit,
            power_w=self._plant.tank.reservoir_area_m2
            * unit
            * _mean_positive_product(pressure, float(rms[speed]), together),
        )


def _mean_positive_product(first: float, second: float, covariance: float) -> float:
    """Mean of x y where that is positive, of two normal variables of zero mean."""
    size = first * second
    if size == 0:
        return 0.0
    r = min(max(covariance / size, -1.0), 1.0)
    return size / (2 * math.pi) * (2 * math.sqrt(1 - r**2) + 2 * r * (math.pi / 2 + math.asin(r)))


def sample_time_of(plant: DesignPlant) -> float:
    """Time between two steps of a law for a plant, in s: a tenth over its roll frequency."""
    w = plant.ship.natural_frequency_rad_s
    return round(TICK_S * max(2, round(0.1 / w / TICK_S)), 2)


def _short(value: float) -> float:
    return float(f"{value:.3g}")
