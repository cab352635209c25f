"""A constrained law designed for a ship and a sea by itself, with the margins that are required.

Sizes follow from scales: the passive roll's RMS s in the expected sea, roll frequency w, greatest
pressure P and level limit h. The factors on them, constants of this module, were found together by
trial on the first ship of the thesis in sixteen seas (commit c752396): with them the mean share of
the clairvoyant bound was 60 % with all margins; with numbers that had been tuned in one storm, 51.

Where a law with these weights would swing on with the pump at its limit, pressure costs more:
with the pump giving any smaller part of what is asked for, an oscillation may grow by
`_MOST_GROWTH` over the length of a plan. A heel is looked for unless the water takes so much of the
ship's stability that one can't be told from another load (`_LEAST_STIFFNESS`).

What is left to choose is how far the law trusts ship and sea. As little noise of the slope is added
as makes it stable on all ships that it must stand, and half as much again. A filter on its
innovations then makes it cost least in the expected sea, robust all the same
(`innovation_filter`), a convex problem. Where that misses a margin, the law without it is taken.
What foresees the waves for the plan at the limits is a Kalman filter without the added noise.
"""

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Annotated, Final, Literal, Protocol

import numpy as np

from utank_hil.analysis.loop.closed_loop import closed_loop_radius
from utank_hil.analysis.loop.innovation_filter import InnovationFilter, Prediction
from utank_hil.analysis.loop.loop_simulation import SensorNoise
from utank_hil.analysis.loop.robustness import (
    EXTRA_DELAY_S,
    GAINS,
    PERIOD_SCALES,
    Robustness,
    robustness,
)
from utank_hil.analysis.loop.scaled_law import NoLawError
from utank_hil.base.arrays import FloatArray
from utank_hil.base.parameters import Range, range_problems, refuse
from utank_hil.base.tick import TICK_S
from utank_hil.control.constrained.design import ConstrainedDesign
from utank_hil.control.constrained.law import ConstrainedLaw
from utank_hil.control.design_plant import DesignPlant
from utank_hil.control.interface import BuiltLaw
from utank_hil.control.limits import PumpLimits
from utank_hil.control.sea_model import SeaModel
from utank_hil.dynamics.linear import pump_model, state_matrices
from utank_hil.dynamics.sampling import LinearModel, sample
from utank_hil.dynamics.ship import RollShip
from utank_hil.sea import ittc

_PRESSURE_COST: Final = 0.106
"""Of the greatest pressure all the time, over s^2."""
_LEVEL_COST: Final = 0.33
"""Of a level at its limit h all the time, over s^2."""
_PRESSURE_NOISE: Final = 11.0
"""White pressure disturbance over P s / sqrt(w), s in rad: what the model ignores."""
_SLOPE_NOISE: Final = 0.046
"""Least white noise of the slope, over s / sqrt(w)."""
_HEEL: Final = 0.13
"""Deviation of the heel over s."""
_SMOOTHING: Final = 0.028
"""Of the sea's density, over w: 0.014 rad/s on a ship of 12.6 s."""
_KNOB: Final = (1e-4, 3.0)
"""Least and most of the added noise of the slope, squared, over s^2 / w."""
_BISECTIONS: Final = 5
"""From the range of `_KNOB` to a factor of 1.4."""
_ORDER: Final = 16
"""States of the sea, twice the usual ones (`SeaModel`): the margins come from the noise instead."""
_LEAST_FLOOR: Final = 1.3e-4
"""Of the sea, a tenth of the usual one, for the same reason."""
_OMEGA: Final = np.geomspace(0.05, 30.0, 1500)
"""Over roll frequency: the slope of short waves falls slowly, and they are in the sensors."""
_UNKNOWN: Final = ((0.5, 0.017), (0.8, 0.017), (1.4, 0.0026))
"""Systems of a sea that is not known: peak periods over the roll period, and heights in m per
square second of the peak period: 0.7, 1.7 and 0.8 m at 6, 10 and 18 s for a ship of 12.6 s."""
_UNKNOWN_SLOPE: Final = 0.5
"""Effective slope of a sea that is not known: the usual one of `SeaModel`."""
_MORE_NOISE: Final = 1.5
"""Beyond the least noise: on the very edge of stability a filter finds no room."""
_MORE_NOISES: Final = 6
_COSTLIER: Final = 3.0
"""From one cost of pressure that is tried to the next."""
_MOST_STEPS: Final = 8
_MOST_GROWTH: Final = 1.5
"""Growth over a plan of an oscillation with the pump at its limit: the plan foresees it."""
_PARTS: Final = np.linspace(0.02, 1.0, 50)
"""Parts of the pressure asked for that a pump at its limit gives."""
_LEAST_STIFFNESS: Final = 1 / 3
"""Stiffness of ship and water at the longest roll period over the known one; below it a heel can't
be told from a load."""
_MEASURED: Final = ("roll_rad", "roll_rate_rad_s", "level_m")


class SlopeDensity(Protocol):
    """What a law knows of a sea."""

    def slope_density(self, omega_rad_s: FloatArray) -> FloatArray:
        """One-sided density of the effective wave slope over encounter frequency."""


@dataclass(frozen=True, slots=True)
class SelfTuned:
    """A law with all required margins.

    Attributes
    ----------
    law : ConstrainedLaw
        It commands what the design's does with a filter on its innovations.
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
    mean_power_w : float
        Budget of the predicted power; infinite for the greatest comfort.
    sample_time_s : float, optional
        Instead of the one that follows from the roll frequency.

    Raises
    ------
    NoLawError
        If no law has the margins, or the sea does not roll the ship.
    """
    search, gentlest_w = _Search(plant, sea, sample_time_s), math.inf
    first = search.least_cost()
    for power in range(_MOST_STEPS + 1):
        found = search.best(first * _COSTLIER**power)
        if found is None:
            continue
        if found.prediction.power_w <= mean_power_w:
            return found
        gentlest_w = found.prediction.power_w
    if gentlest_w == math.inf:
        raise NoLawError("no constrained law has all margins on this ship: choose another tank")
    raise NoLawError(
        f"no law puts less than {mean_power_w:g} W in the mean into the water; the gentlest one "
        f"puts {gentlest_w:.3g} W"
    )


def passive_roll_rad(plant: DesignPlant, sea: SlopeDensity) -> float:
    """Roll RMS of the ship with the passive tank in a sea."""
    w = plant.ship.natural_frequency_rad_s * _OMEGA
    a, b = state_matrices(plant.ship, plant.tank)
    effect = b[:, 1] * plant.ship.stiffness_nm_rad
    resolvent = 1j * w[:, None, None] * np.eye(len(a)) - a
    roll = np.linalg.solve(resolvent, effect.astype(complex)[None, :, None])[:, 0, 0]
    return math.sqrt(float(np.trapezoid(np.abs(roll) ** 2 * sea.slope_density(w), w)))


def cost_weights(passive_rad: float, limits: PumpLimits) -> tuple[float, float, float]:
    """What a law's motion costs: per square of roll, level, and pressure over the pump's most.

    Parameters
    ----------
    passive_rad : float
        Roll RMS with the passive tank.
    """
    return 1.0, _LEVEL_COST * (passive_rad / limits.level_m) ** 2, _PRESSURE_COST * passive_rad**2


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
        return _tuned(self, plant)

    def build(self, plant: DesignPlant) -> BuiltLaw:
        """Design the law for a plant."""
        law = self.tuned(plant).law
        return BuiltLaw(law.controller, _MEASURED, law)


@lru_cache(maxsize=16)
def _tuned(design: SelfTunedDesign, plant: DesignPlant) -> SelfTuned:
    """As `SelfTunedDesign.tuned`; it takes seconds, and several ask for the same."""
    sea = design.sea or unknown_sea(plant.ship)
    return self_tuned(plant, sea, mean_power_w=design.mean_power_w)


def unknown_sea(ship: RollShip) -> SeaModel:
    """What a law expects of a sea that is not known: broad, and mostly above the roll frequency."""
    w = ship.natural_frequency_rad_s
    omega, slope = w * _OMEGA, np.zeros(len(_OMEGA))
    for ratio, height in _UNKNOWN:
        period_s = ratio * 2 * math.pi / w
        system = ittc(height * period_s**2, period_s)
        bands = tuple(system.frequency_hz.tolist()), tuple(system.density.tolist())
        slope += SeaModel(*bands, effective_slope=_UNKNOWN_SLOPE).slope_density(omega)
    return SeaModel.of_slope(omega, slope)


class _Search:
    """One ship in one sea: what is designed, predicted and judged again and again."""

    def __init__(self, plant: DesignPlant, sea: SlopeDensity, sample_time_s: float | None) -> None:
        noise = SensorNoise()
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
            smoothing_rad_s=_short(min(_SMOOTHING * w, 1.0)),
        )
        self._hard_cases = list(self._longest_and_shortest_period())
        self._heel_rad = _short(_HEEL * self._roll_rad) if self._tells_heel() else 0.0

    def least_cost(self) -> float:
        """Factor on the pressure's scaled weight from which the pump's limit is no danger."""
        costlier = 1.0
        for _ in range(_MOST_STEPS):
            if self._growth(costlier) <= _MOST_GROWTH:
                break
            costlier *= math.sqrt(_COSTLIER)
        return costlier

    def best(self, costlier: float) -> SelfTuned | None:
        """The law of least predicted cost with all margins, or None.

        The pressure costs so many times its scaled weight.
        """
        noise = _MORE_NOISE * self._least_noise(costlier)
        for _ in range(_MORE_NOISES):
            design = self._design(noise, costlier)
            if self._stands_hard_cases(design):
                start = design.law(self._plant).unlimited()
                search = InnovationFilter(start, design, self._plant, self._weights(costlier))
                for linear in (*search.laws(), start):
                    judged = robustness(linear, self._plant, _MEASURED, with_delay_margin=False)
                    if not judged.failures():
                        planner = self._design(0.0, costlier).law(self._plant)
                        prediction = search.prediction(linear)
                        law = planner.following(linear)
                        return SelfTuned(design, law, judged, self._roll_rad, prediction)
            noise *= _MORE_NOISE
        return None

    def _least_noise(self, costlier: float) -> float:
        """Noise of the slope from which the law stands the hard cases, by bisection."""
        low, high = (math.log(end) for end in _KNOB)
        for _ in range(_BISECTIONS):
            middle = (low + high) / 2
            if self._stands_hard_cases(self._design(math.exp(middle), costlier)):
                high = middle
            else:
                low = middle
        return math.exp(high)

    def _weights(self, costlier: float) -> tuple[float, float, float]:
        """Of the cost, on the squares of roll, level and pressure per the pump's most."""
        roll, level, pressure = cost_weights(self._roll_rad, self._plant.limits)
        return roll, level, costlier * pressure

    def _stands_hard_cases(self, design: ConstrainedDesign) -> bool:
        try:
            law = design.law(self._plant).unlimited()
        except (ValueError, ArithmeticError):  # LinAlgError is one of the former
            return False
        return all(closed_loop_radius(law, model, gain) < 1 for model, gain in self._hard_cases)

    def _design(self, knob: float, costlier: float) -> ConstrainedDesign:
        limits, roll = self._plant.limits, self._roll_rad
        w = self._plant.ship.natural_frequency_rad_s
        root = math.sqrt(w)
        _, level, pressure = self._weights(costlier)
        return ConstrainedDesign(
            "constrained_gpc",
            self._sea,
            measurement_std=self._std,
            pressure_noise_pa_rt_s=_short(_PRESSURE_NOISE * limits.pressure_pa * roll / root),
            slope_noise_rad_rt_s=_short((_SLOPE_NOISE + math.sqrt(knob)) * roll / root),
            pressure_weight_rad2=_short(pressure),
            level_weight_rad2_m2=_short(level),
            heel_std_rad=self._heel_rad,
            sample_time_s=self._step_s,
        )

    def _growth(self, costlier: float) -> float:
        """Of the fastest growing oscillation over a plan, with the pump at its limit.

        The motion is known, and the pump gives a part of the pressure that the law asks for.
        """
        design = self._design(_KNOB[0], costlier)
        law = design.law(self._plant).unlimited()
        a, b, gain = law.model.A[:-1, :-1], law.model.B[:-1], law.gain[:, :-1]
        closed = a - _PARTS[:, None, None] * (b @ gain)
        return float(np.abs(np.linalg.eigvals(closed)).max()) ** design.horizon

    def _tells_heel(self) -> bool:
        """Whether the heel under a steady moment hardly depends on how the ship is loaded."""
        ship = self._plant.ship
        slower = replace(ship, stiffness_nm_rad=ship.stiffness_nm_rad / PERIOD_SCALES[-1] ** 2)
        least, known = (_steady_stiffness(each, self._plant) for each in (slower, ship))
        return least > _LEAST_STIFFNESS * known

    def _longest_and_shortest_period(self) -> Iterator[tuple[LinearModel, float]]:
        """Where a law mostly fails first: at the longest and the shortest roll period."""
        ship, plant = self._plant.ship, self._plant
        for scale in (PERIOD_SCALES[-1], PERIOD_SCALES[0]):
            other = replace(ship, stiffness_nm_rad=ship.stiffness_nm_rad / scale**2)
            model = pump_model(other, plant.tank, _MEASURED)
            late_s = plant.delay_s + (EXTRA_DELAY_S if scale < 1 else 0.0)
            sampled = sample(model, self._step_s, late_s, plant.lag_s)
            yield from ((sampled, gain) for gain in (GAINS[0], GAINS[-1]))


def _steady_stiffness(ship: RollShip, plant: DesignPlant) -> float:
    """Steady moment over the heel that it makes, the water free to move, in N m / rad."""
    a, b = state_matrices(ship, plant.tank)
    return -1 / float(np.linalg.solve(a, b[:, 1])[0])


def sample_time_of(plant: DesignPlant) -> float:
    """Time between two steps of a law for a plant, in s: a tenth over its roll frequency."""
    w = plant.ship.natural_frequency_rad_s
    return round(TICK_S * max(2, round(0.1 / w / TICK_S)), 2)


def _short(value: float) -> float:
    return float(f"{value:.3g}")
