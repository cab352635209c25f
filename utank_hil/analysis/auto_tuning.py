"""GPC, DPC and LQG laws that take all their numbers from ship, pump and sea: ``tuning: auto``.

The search begins with the shipped law of the kind, scaled to ship and sea and asked for less until
it has all margins (`first_law`). Then four factors are varied in turn, in smaller and smaller
steps: on the weights, on the noises (never below the sensors'), on peak and on damping of the
waves that the predictor expects. A law is taken if it has all margins and costs less in that sea,
by linear prediction; the cost is that of a self-tuned law (`cost_weights`).
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
"""First steps of the factors on weights, noises, peak and damping."""
_SIZES: Final = 3
"""Of steps, each the root of the one before."""
_SWEEPS: Final = 3
"""Over the factors with steps of one size, at most."""
_MOST_DAMPING: Final = 1.0
_SLOPE: Final = 1.46
"""Over the passive roll's RMS: significant slope of the sea for which the shipped law is scaled."""
_OMEGA: Final = np.geomspace(0.1, 10.0, 600)
"""Of the waves, over roll frequency."""


@dataclass(frozen=True, slots=True)
class AutoTuned:
    """A law with all required margins.

    Attributes
    ----------
    design : PredictiveDesign or LQGDesign
        Its numbers.
    cost : float
        Predicted; 1 is that of the passive tank's roll.
    """

    design: LinearDesign
    robustness: Robustness
    cost: float


def auto_tuned(kind: LinearKind, plant: DesignPlant, sea: SlopeDensity) -> AutoTuned:
    """The law of a kind with all margins that costs least of those tried.

    Parameters
    ----------
    kind : {"gpc", "dpc", "lqg"}
    plant : DesignPlant
        With the limits of its pump.
    sea : SlopeDensity
        That it expects.

    Raises
    ------
    NoLawError
        If no law has the margins, or the sea does not roll the ship.
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
    """A GPC, DPC or LQG law with numbers that follow from ship, pump and sea.

    Parameters
    ----------
    kind : {"gpc", "dpc", "lqg"}
    tuning : {"auto"}
        In place of the numbers of the kind.
    sea : SeaModel or None
        The sea it expects, of which spectrum and effective slope count; None where none is known.
    """

    kind: LinearKind
    tuning: Literal["auto"]
    sea: SeaModel | None = None

    def tuned(self, plant: DesignPlant) -> LinearDesign:
        """The law's numbers for a plant.

        Raises
        ------
        NoLawError
            As `auto_tuned`.
        """
        return auto_tuned(self.kind, plant, self.sea or unknown_sea(plant.ship)).design

    def build(self, plant: DesignPlant) -> BuiltLaw:
        """Design the law for a plant."""
        return self.tuned(plant).build(plant)


class _Search:
    """Laws of a kind for one ship in one sea: designed, judged and predicted."""

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
        """The law with these factors if it costs less than that and has all margins."""
        design = _varied(self.start.design, self._least_std, *factors)
        if design is None:
            return None
        try:
            found = self._cost(design)
            if not found < cost:
                return None
            judged = self._judged(design)
        except (ValueError, ArithmeticError):  # LinAlgError is one of the former
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
    """A design with its numbers multiplied; None if that is no sea any more."""
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
