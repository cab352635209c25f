"""A constrained law designed automatically for a ship and a sea, with the required margins.

Weights and noises follow from scales: the passive roll's RMS s in the expected sea, roll frequency
w, greatest pressure P and level limit h. The factors on them, constants of this module, were found
together by trial on the first ship of the thesis in sixteen seas (commit c752396): with them the
mean share of the clairvoyant bound was 60 % with all margins; with numbers tuned in one storm, 51.

The weight on pressure is raised where a law would sustain an oscillation with the pump at its
limit: with the pump giving any smaller part of the requested pressure, an oscillation may grow by
`_MOST_GROWTH` over the length of a plan. A heel is estimated unless the water takes so much of the
ship's stability that a heel and another load cannot be distinguished (`_LEAST_STIFFNESS`).

The remaining choice is how far the law trusts ship and sea. The added noise of the slope is the
least that makes it stable on all ships of the grid, times `_MORE_NOISE`. A filter on its
innovations then gives it the least cost in the expected sea under the robustness requirements, a
convex problem (`innovation_filter`). Where that misses a margin, the next greater weight on
pressure is tried, and of that law and the one without a filter the one of less predicted roll is
taken. On an identified ship a Kalman filter without the added noise predicts the waves for the plan
at the limits. On another load that swings the water from limit to limit, so there the plan takes
the robust law's estimate, and stays within `_LEEWAY` of what that law commands.
"""

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Annotated, Final, Literal

import numpy as np

from utank_hil.analysis.loop.innovation_filter import InnovationFilter, Prediction
from utank_hil.analysis.loop.loop_simulation import SensorNoise
from utank_hil.analysis.loop.margins import (
    EXTRA_DELAY_S,
    GAINS,
    PEAK_SENSITIVITY,
    PERIOD_SCALES,
    Robustness,
    closed_loop_radius,
    of_period,
    robustness,
)
from utank_hil.analysis.loop.sea_response import SlopeDensity
from utank_hil.base.arrays import FloatArray
from utank_hil.base.parameters import Checked, Range
from utank_hil.base.tick import TICK_S
from utank_hil.control import BuiltLaw, ConstrainedDesign, DesignPlant, LQGLaw, PumpLimits, SeaModel
from utank_hil.control.constrained.law import ConstrainedLaw
from utank_hil.control.lqg import SHARES
from utank_hil.dynamics import GRAVITY_M_S2, LinearModel, RollShip
from utank_hil.dynamics.linear import pump_model, state_matrices
from utank_hil.dynamics.sampling import sample
from utank_hil.sea import ittc

_PRESSURE_COST: Final = 0.106  # Cost of constant pressure at its limit, over s^2.
_LEVEL_COST: Final = 0.33  # Cost of a constant level at its limit h, over s^2.
_PRESSURE_NOISE: Final = 11.0
"""White pressure disturbance over P s / sqrt(w), s in rad, for what the model neglects."""
_SLOPE_NOISE: Final = 0.046  # Least white noise of the slope, over s / sqrt(w).
_HEEL: Final = 0.13  # Standard deviation of the heel over s.
_SMOOTHING: Final = 0.028
"""Smoothing width of the sea's density over w: 0.014 rad/s at a roll period of 12.6 s."""
_KNOB: Final = (1e-4, 3.0)  # Range of the squared added slope noise over s^2 / w.
_BISECTIONS: Final = 5  # Number of bisections, which bring the range of `_KNOB` to a factor of 1.4.
_ORDER: Final = 16
"""States of the sea, twice the default of `SeaModel`, because the noise provides the margins."""
_LEAST_FLOOR: Final = 1.3e-4
"""Floor of the sea's density, a tenth of the default of `SeaModel`, for the reason of `_ORDER`."""
_OMEGA: Final = np.geomspace(0.05, 30.0, 1500)
"""Frequencies over the roll frequency; short waves count because the slope falls slowly with
frequency and the sensors see them."""
_UNKNOWN: Final = ((0.5, 0.017), (0.8, 0.017), (1.4, 0.0026))
"""Wave systems assumed for an unknown sea: peak periods over the roll period, and heights in m per
square second of the peak period: 0.7, 1.7 and 0.8 m at 6, 10 and 18 s for a roll period of 12.6 s.
"""
_UNKNOWN_SLOPE: Final = 0.5  # Effective slope of an unknown sea: the default of `SeaModel`.
_MORE_NOISE: Final = 1.5
"""Factor on the least noise; at the edge of stability a filter has no freedom."""
_MORE_NOISES: Final = 6  # Limit on the number of noise levels tried. Chosen; no study.
_COSTLIER: Final = 3.0  # Factor between successive trial weights on pressure.
_MOST_STEPS: Final = 8  # Limit on the number of trial weights. Chosen; no study.
_MOST_GROWTH: Final = 1.5
"""Allowed growth over a plan of an oscillation with the pump at its limit; the plan predicts it."""
_PARTS: Final = np.linspace(0.02, 1.0, 50)
"""Fractions of the requested pressure that a pump at its limit may give."""
_LEEWAY: Final = 0.25
"""Most by which the plan differs from the robust law, over the greatest pressure. Over the passive
roll the first ship at 1.3 of its period has 0.95 at most with 0.25, 1.2 with 0.5, 3 without."""
CLIPPED_PEAK: Final = 3.0
"""`loads_peak` of a law that is clipped, or plans without leeway. With 40 the clipped law rolled a
ship loaded to 1.3 times its period 1.4 to 3.3 times the passive roll, with 6 up to 1.15 times, with
3 at most 0.98 times; the storm's roll rises by 0, 0 and 4 %."""
_PLANNED_PEAK: Final = 4.0  # With leeway; with 3 the ship rolls more at its own load.
_LEAST_STIFFNESS: Final = 1 / 3
"""Least stiffness at the longest roll period over the nominal one that tells heel from load."""
_SHARES: Final = (0.05, 0.1, 0.2, 0.3, 0.5, 0.7)
"""Of its command that a law may get: after arming, in degraded operation, where more does not pay.
Patti-B's law of least cost has all margins and is unstable with 0.05 to 0.3 of its command."""
_MEASURED: Final = ("roll_rad", "roll_rate_rad_s", "level_m")


class NoLawError(ValueError):
    """No law of the kind is robust or within the limits, even with the smallest weights tried."""


@dataclass(frozen=True, slots=True)
class SelfTuned:
    """A law with all required margins."""

    design: ConstrainedDesign
    law: ConstrainedLaw  #: The law of `design` with a filter on its innovations.
    filtered: bool  #: False where the one with a filter missed a margin.
    robustness: Robustness
    passive_roll_rad: float
    prediction: Prediction  #: In the expected sea.


def self_tuned(
    plant: DesignPlant,
    sea: SlopeDensity,
    *,
    mean_power_w: float = math.inf,
    sample_time_s: float | None = None,
    loads_peak: float | None = None,
) -> SelfTuned:
    """Design the constrained law of least predicted cost with all margins, within a mean power.

    `plant` has the limits of its pump; `mean_power_w` limits the predicted mean power, infinite for
    the least cost; the default of `sample_time_s` follows from the roll frequency. With
    `loads_peak` the ship may be loaded otherwise (`InnovationFilter`). Raises `NoLawError` if no
    law has the margins, or the sea does not roll the ship.
    """
    search, gentlest_w = _Search(plant, sea, sample_time_s, loads_peak), math.inf
    first, within = search.least_cost(), list[SelfTuned]()
    for power in range(_MOST_STEPS + 1):
        found = search.best(first * _COSTLIER**power)
        if found is None:
            continue
        if found.prediction.power_w > mean_power_w:
            gentlest_w = found.prediction.power_w
            continue
        within.append(found)
        if found.filtered or len(within) > 1:
            return min(within, key=lambda each: each.prediction.roll_rad)
    if within:
        return within[0]
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
    """Cost weights on squared roll, level, and pressure over the pump's maximum.

    `passive_rad` is the roll RMS with the passive tank.
    """
    return 1.0, _LEVEL_COST * (passive_rad / limits.level_m) ** 2, _PRESSURE_COST * passive_rad**2


@dataclass(frozen=True, slots=True)
class SelfTunedDesign(Checked, owner="self-tuned design"):
    """A constrained law whose numbers follow from its ship and sea."""

    kind: Literal["self_tuned"]
    #: Expected sea, of which spectrum and effective slope count; None for an unknown sea. A law
    #: that is renewed begins with the unknown sea, and the tank's loss in this one.
    sea: SeaModel | None = None
    #: Limit on the predicted mean power from pump to water; infinite for the least roll.
    mean_power_w: Annotated[float, Range(above=0, infinite=True)] = math.inf

    def tuned(self, plant: DesignPlant, *, first: bool = False) -> SelfTuned:
        """The design and its law for a plant that may be loaded otherwise.

        The `first` law leads until ship and waves are known, and expects no sea in particular: one
        for a beam sea amplifies the slow roll of following waves by up to 1.9, this one less. Of
        `sea` it has what the plant takes from it, the tank's loss. Raises `NoLawError` as
        `self_tuned`.
        """
        peak = CLIPPED_PEAK if first or needs_plan(plant) else _PLANNED_PEAK
        return _tuned(replace(self, sea=None) if first else self, plant, peak)

    def build(self, plant: DesignPlant, *, first: bool = False) -> BuiltLaw:
        """Design the law for a plant, the `first` one clipped if it can be."""
        law = self.tuned(plant, first=first).law
        clips = first and not needs_plan(plant)
        return BuiltLaw(law.clipped if clips else law.controller, _MEASURED, law)


def needs_plan(plant: DesignPlant) -> bool:
    """Whether only a plan keeps the level: the pressure alone holds the water beyond its limit."""
    limits, tank = plant.limits, plant.tank
    return limits.pressure_pa > 2 * tank.density_kg_m3 * GRAVITY_M_S2 * limits.level_m


@lru_cache(maxsize=16)
def _tuned(design: SelfTunedDesign, plant: DesignPlant, loads_peak: float) -> SelfTuned:
    """Design as `SelfTunedDesign.tuned`; cached, as it takes seconds and several callers use it."""
    sea = design.sea or unknown_sea(plant.ship)
    return self_tuned(plant, sea, mean_power_w=design.mean_power_w, loads_peak=loads_peak)


@lru_cache(maxsize=16)
def unknown_sea(ship: RollShip) -> SeaModel:
    """A broad sea, mostly above the roll frequency, for a law whose sea is unknown."""
    w = ship.natural_frequency_rad_s
    omega, slope = w * _OMEGA, np.zeros(len(_OMEGA))
    for ratio, height in _UNKNOWN:
        period_s = ratio * 2 * math.pi / w
        system = ittc(height * period_s**2, period_s)
        bands = tuple(system.frequency_hz.tolist()), tuple(system.density.tolist())
        slope += SeaModel(*bands, effective_slope=_UNKNOWN_SLOPE).slope_density(omega)
    return SeaModel.of_slope(omega, slope)


class _Search:
    """Repeated design, prediction and judgement of laws for one ship in one sea."""

    def __init__(
        self,
        plant: DesignPlant,
        sea: SlopeDensity,
        sample_time_s: float | None,
        loads_peak: float | None,
    ) -> None:
        noise, self._loads_peak = SensorNoise(), loads_peak
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
            smoothing_rad_s=short(min(_SMOOTHING * w, 1.0)),
        )
        self._hard_cases = list(self._longest_and_shortest_period())
        self._heel_rad = short(_HEEL * self._roll_rad) if self._tells_heel() else 0.0

    def least_cost(self) -> float:
        """Least factor on the pressure's scaled weight without oscillation at the pump's limit."""
        costlier = 1.0
        for _ in range(_MOST_STEPS):
            if self._growth(costlier) <= _MOST_GROWTH:
                break
            costlier *= math.sqrt(_COSTLIER)
        return costlier

    def best(self, costlier: float) -> SelfTuned | None:
        """Law of least predicted cost with all margins, or None; `costlier` scales pressure."""
        noise = _MORE_NOISE * self._least_noise(costlier)
        for _ in range(_MORE_NOISES):
            design = self._design(noise, costlier)
            if self._stands_hard_cases(design):
                start = design.law(self._plant).unlimited()
                search = InnovationFilter(
                    start, design, self._plant, self._weights(costlier), loads_peak=self._loads_peak
                )
                for linear in (*search.laws(), start):
                    if not (bears := self._bears_shares(linear)):
                        continue
                    judged = robustness(linear, self._plant, _MEASURED, with_delay_margin=False)
                    if judged.failures():
                        continue
                    if law := self._planned(search, design, linear, costlier):
                        prediction = search.prediction(linear)
                        filtered = linear is not start
                        return SelfTuned(design, law, filtered, judged, self._roll_rad, prediction)
                if not bears:
                    return None  # the gain decides, which is the same with more noise
            noise *= _MORE_NOISE
        return None

    def _planned(
        self, search: InnovationFilter, design: ConstrainedDesign, linear: LQGLaw, costlier: float
    ) -> ConstrainedLaw | None:
        """The law that plans at the limits, and within them commands what the linear law does.

        None if it is for a ship loaded otherwise and with less pressure misses a margin.
        """
        if self._loads_peak is None:
            return self._design(0.0, costlier).law(self._plant).following(linear)
        planner = design.law(self._plant)
        gains = self._gentler(search, design, linear)
        if gains is None:
            return None
        gains = np.hstack([np.zeros((len(gains), len(planner.model.A))), gains])
        leeway = None if needs_plan(self._plant) else _LEEWAY
        return replace(planner.following(linear), gentler=gains, leeway=leeway)

    def _least_noise(self, costlier: float) -> float:
        """Least noise of the slope with a stable law in the hardest cases, by bisection."""
        low, high = (math.log(end) for end in _KNOB)
        for _ in range(_BISECTIONS):
            middle = (low + high) / 2
            if self._stands_hard_cases(self._design(math.exp(middle), costlier)):
                high = middle
            else:
                low = middle
        return math.exp(high)

    def _weights(self, costlier: float) -> tuple[float, float, float]:
        """Cost weights as `cost_weights`."""
        roll, level, pressure = cost_weights(self._roll_rad, self._plant.limits)
        return roll, level, costlier * pressure

    def _stands_hard_cases(self, design: ConstrainedDesign) -> bool:
        try:
            law = design.law(self._plant).unlimited()
        except (ValueError, ArithmeticError):  # LinAlgError is a ValueError
            return False
        return all(closed_loop_radius(law, model, gain) < 1 for model, gain in self._hard_cases)

    def _bears_shares(self, law: LQGLaw) -> bool:
        """Whether the loop is stable with any share of the command, which the estimate knows."""
        plant = self._plant
        plants = [replace(plant, tank=tank) for tank in plant.tanks]
        models = [each.sampled(_MEASURED, law.sample_time_s) for each in plants]
        shared = [LQGLaw(law.model, share * law.gain, law.observer_gain) for share in _SHARES]
        return all(closed_loop_radius(law, model, 1.0) < 1 for law in shared for model in models)

    def _gentler(
        self, search: InnovationFilter, design: ConstrainedDesign, law: LQGLaw
    ) -> FloatArray | None:
        """Gains for less pressure (`GentleController`), or None if one misses a margin.

        Gains that less pressure makes best, else shares of the law's. The passive ship is the limit
        of less pressure: where it does not stand a hard case, a gain for less need not.
        """
        shares, feedback = np.array(SHARES[1:]), design.law(self._plant).unlimited().gain.shape[1]
        best: FloatArray = np.multiply.outer(shares, law.gain[0])
        shared = best.copy()
        for row, share in zip(best, shares, strict=True):
            costly = replace(design, pressure_weight_rad2=design.pressure_weight_rad2 / share**2)
            row[:feedback] = costly.law(self._plant).unlimited().gain[0]
        hard = [
            (case, max(1.0, float(np.abs(np.linalg.eigvals(case[0].A)).max())))
            for case in self._hard_cases
        ]
        for gains in (best, shared):
            less = [LQGLaw(law.model, gain[None], law.observer_gain) for gain in gains]
            if all(
                search.peak_sensitivity(each) <= PEAK_SENSITIVITY
                and all(closed_loop_radius(each, *case) < radius for case, radius in hard)
                for each in less
            ):
                return gains
        return None

    def _design(self, knob: float, costlier: float) -> ConstrainedDesign:
        limits, roll = self._plant.limits, self._roll_rad
        root = math.sqrt(self._plant.ship.natural_frequency_rad_s)
        _, level, pressure = self._weights(costlier)
        return ConstrainedDesign(
            "constrained_gpc",
            self._sea,
            measurement_std=self._std,
            pressure_noise_pa_rt_s=short(_PRESSURE_NOISE * limits.pressure_pa * roll / root),
            slope_noise_rad_rt_s=short((_SLOPE_NOISE + math.sqrt(knob)) * roll / root),
            pressure_weight_rad2=short(pressure),
            level_weight_rad2_m2=short(level),
            heel_std_rad=self._heel_rad,
            sample_time_s=self._step_s,
        )

    def _growth(self, costlier: float) -> float:
        """Growth over a plan of the fastest growing oscillation, with the pump at its limit.

        The motion is known, and the pump gives a part of the requested pressure.
        """
        design = self._design(_KNOB[0], costlier)
        law = design.law(self._plant).unlimited()
        a, b, gain = law.model.A[:-1, :-1], law.model.B[:-1], law.gain[:, :-1]
        closed = a - _PARTS[:, None, None] * (b @ gain)
        return float(np.abs(np.linalg.eigvals(closed)).max()) ** design.horizon

    def _tells_heel(self) -> bool:
        """Whether the heel under a steady moment hardly depends on the ship's loading."""
        ship = self._plant.ship
        slower = of_period(ship, PERIOD_SCALES[-1])
        least, known = (_steady_stiffness(each, self._plant) for each in (slower, ship))
        return least > _LEAST_STIFFNESS * known

    def _longest_and_shortest_period(self) -> Iterator[tuple[LinearModel, float]]:
        """Yield the cases that usually fail first: the longest and the shortest roll period."""
        ship, plant = self._plant.ship, self._plant
        for scale in (PERIOD_SCALES[-1], PERIOD_SCALES[0]):
            late_s = plant.delay_s + (EXTRA_DELAY_S if scale < 1 else 0.0)
            for tank in plant.tanks:
                model = pump_model(of_period(ship, scale), tank, _MEASURED)
                sampled = sample(model, self._step_s, late_s, plant.lag_s)
                yield from ((sampled, gain) for gain in (GAINS[0], GAINS[-1]))


def _steady_stiffness(ship: RollShip, plant: DesignPlant) -> float:
    """Steady moment over the heel that it causes, with free water, in N m / rad."""
    a, b = state_matrices(ship, plant.tank)
    return -1 / float(np.linalg.solve(a, b[:, 1])[0])


def sample_time_of(plant: DesignPlant) -> float:
    """Sample time in s of a law for a plant: 0.1 over its roll frequency."""
    w = plant.ship.natural_frequency_rad_s
    return round(TICK_S * max(2, round(0.1 / w / TICK_S)), 2)


def short(value: float) -> float:
    """Round to three digits, as a file shows them."""
    return float(f"{value:.3g}")
