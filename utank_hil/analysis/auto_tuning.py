"""GPC, DPC and LQG laws whose numbers all follow from ship, pump and sea: ``tuning: auto``.

The search begins with the shipped law of the kind, scaled to ship and sea, with weights lowered
until it has all margins (`first_law`). Then four factors are varied in turn, in decreasing steps:
on the weights, on the noises (never below the sensors'), on peak and on damping of the waves in the
predictor. A law is accepted if it has all margins and costs less in that sea, by linear prediction,
with the cost of a self-tuned law (`cost_weights`).
"""

import math
from dataclasses import asdict, dataclass, replace
from typing import Final, Literal

import numpy as np

from utank_hil.analysis.loop.closed_loop import closed_loop_response
from utank_hil.analysis.loop.loop_simulation import SensorNoise
from utank_hil.analysis.loop.robustness import Robustness, robustness
from utank_hil.analysis.loop.scaled_law import LinearDesign, LinearKind, NoLawError, first_law
from utank_hil.analysis.loop.sea_response import motion_in_sea
from utank_hil.analysis.loop.self_tuning import SlopeDensity, cost_weights, unknown_sea
from utank_hil.analysis.loop.trade import scaled
from utank_hil.control.design_plant import DesignPlant
from utank_hil.control.interface import BuiltLaw
from utank_hil.control.sea_model import SeaModel
from utank_hil.dynamics.linear import coupled_model
from utank_hil.sea import Harmonics

_STEPS: Final = (4.0, 2.0, 1.15, 2.0)
"""First step of each factor: on weights, noises, peak and damping. Chosen; no study."""
_SIZES: Final = 3
"""Number of step sizes, each the square root of the one before. Chosen; no study."""
_SWEEPS: Final = 3
"""Limit on passes over the factors with one step size. Chosen; no study."""
_MOST_DAMPING: Final = 1.0
"""Limit on the damping of the predictor's waves: critical damping."""
_SLOPE: Final = 1.46
"""Significant slope of the sea assumed for the scaled law, over the passive roll's RMS."""
_OMEGA: Final = np.geomspace(0.1, 10.0, 600)
"""Wave frequencies over the roll frequency."""


@dataclass(frozen=True, slots=True)
class AutoTuned:
    """A law with all required margins."""

    design: LinearDesign
    robustness: Robustness
    cost: float  #: Predicted cost; 1 is that of the roll with the passive tank.


def auto_tuned(kind: LinearKind, plant: DesignPlant, sea: SlopeDensity) -> AutoTuned:
    """Find the law of a kind with all margins that costs least of those tried.

    Raises `NoLawError` if no law has the margins, or the sea does not roll the ship.
    """
    search = _Search(kind, plant, sea)
    best, factors = search.start, [1.0] * len(_STEPS)
    for size in range(_SIZES):
        for _ in range(_SWEEPS):
            before = best.cost
            for which, first in enumerate(_STEPS):
                for step in (first ** (0.5**size), first ** -(0.5**size)):
                    tried = [*factors]
                    tried[which] *= step
                    better = search.better(tried, best.cost)
                    if better is not None:
                        best, factors = better, tried
                        break
            if best.cost == before:
                break
    return best


@dataclass(frozen=True, slots=True)
class AutoDesign:
    """A GPC, DPC or LQG law with numbers that follow from ship, pump and sea."""

    kind: LinearKind
    tuning: Literal["auto"]  #: Replaces the numbers of the kind.
    #: Expected sea, of which spectrum and effective slope count; None for an unknown sea.
    sea: SeaModel | None = None

    def tuned(self, plant: DesignPlant) -> LinearDesign:
        """Numbers of the law for a plant.

        Raises `NoLawError` as `auto_tuned`.
        """
        return auto_tuned(self.kind, plant, self.sea or unknown_sea(plant.ship)).design

    def build(self, plant: DesignPlant) -> BuiltLaw:
        """Design the law for a plant."""
        return self.tuned(plant).build(plant)


class _Search:
    """Design, judgement and prediction of laws of a kind for one ship in one sea."""

    def __init__(self, kind: LinearKind, plant: DesignPlant, sea: SlopeDensity) -> None:
        self._least_std = asdict(SensorNoise())
        self._plant, self._system = plant, coupled_model(plant.ship, plant.tank)
        w = plant.ship.natural_frequency_rad_s * _OMEGA
        slope = np.sqrt(2 * sea.slope_density(w) * np.gradient(w))
        self._moment = Harmonics(plant.ship.stiffness_nm_rad * slope, w, np.zeros(len(w)))
        answers, _ = closed_loop_response(None, self._system, (), w)
        roll = np.abs(answers[:, self._system.output_labels.index("roll_rad")])
        energy = np.square(roll * self._moment.amplitude) / 2
        self._passive_rad = math.sqrt(float(energy.sum()))
        if not self._passive_rad > 0:
            raise NoLawError("the sea does not roll the ship: there is nothing to design a law for")
        self._weights = cost_weights(self._passive_rad, plant.limits)
        mean_rad_s = float(energy @ w / energy.sum())
        peaks = mean_rad_s, math.sqrt(mean_rad_s * plant.ship.natural_frequency_rad_s)
        first = [first_law(plant, _SLOPE * self._passive_rad, peak, kind=kind) for peak in peaks]
        self.start = min(
            (AutoTuned(each.design, each.robustness, self._cost(each.design)) for each in first),
            key=lambda each: each.cost,
        )

    def better(self, factors: list[float], cost: float) -> AutoTuned | None:
        """The law with these factors if it has all margins and costs less than `cost`."""
        design = _varied(self.start.design, self._least_std, *factors)
        if design is None:
            return None
        try:
            found = self._cost(design)
            if not found < cost:
                return None
            judged = self._judged(design)
        except (ValueError, ArithmeticError):  # LinAlgError is a ValueError
            return None
        return None if judged.failures() else AutoTuned(design, judged, found)

    def _judged(self, design: LinearDesign) -> Robustness:
        law, measured = design.law(self._plant), design.predictor.measured
        return robustness(law, self._plant, measured, with_delay_margin=False)

    def _cost(self, design: LinearDesign) -> float:
        plant, limits = self._plant, self._plant.limits
        motion = motion_in_sea(
            design.law(plant),
            self._system,
            design.predictor.measured,
            self._moment,
            plant.delay_s,
            plant.lag_s,
        )
        pressure = motion.pressure_rms_pa / limits.pressure_pa
        squares = np.square([motion.roll_rms_rad, motion.level_rms_m, pressure])
        return float(squares @ self._weights) / self._passive_rad**2


def _varied(
    design: LinearDesign,
    least_std: dict[str, float],
    weight: float,
    noise: float,
    peak: float,
    damping: float,
) -> LinearDesign | None:
    """Return a design with its numbers multiplied, or None if its waves become invalid."""
    given = design.predictor
    damping_ratio = given.wave_damping_ratio * damping
    peak_rad_s = given.wave_peak_rad_s * peak
    if not (damping_ratio < _MOST_DAMPING and peak_rad_s * given.sample_time_s < math.pi):
        return None
    predictor = replace(
        given,
        measurement_std=tuple(
            max(noise * std, least_std.get(name, 0.0))
            for name, std in zip(given.measured, given.measurement_std, strict=True)
        ),
        pressure_noise_pa_rt_s=noise * given.pressure_noise_pa_rt_s,
        wave_peak_rad_s=peak_rad_s,
        wave_damping_ratio=damping_ratio,
    )
    return scaled(replace(design, predictor=predictor), weight)
