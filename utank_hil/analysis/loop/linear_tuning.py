"""Tuning of linear laws: a shipped law scaled to ship, pump and sea, and a search from there.

The parameters of ``lqg.yaml``, ``gpc.yaml`` and ``dpc.yaml`` in ``configs/controllers`` are those
of one ship in one sea. Made dimensionless by roll frequency w, effective wave slope s, greatest
pressure P and level limit h, they serve another ship in another sea (`scaled_law`):

* measurement noise on roll over s, on roll rate over s w, on level over h;
* pressure noise over P / sqrt(w); sample time 0.1 / w; corner of the washout 0.04 w; horizons in
  samples unchanged;
* weights over P^2, times s^2 on roll, (s w)^2 on roll rate, h^2 on level, (h w)^2 on its rate, with
  1 on the square of the pressure.

Similarity does not guarantee robustness. The weights on the motion of a law that misses a required
margin are lowered until it has all margins (`first_law`).

With ``tuning: auto`` (`auto_tuned`) four factors are then varied in turn, in decreasing steps: on
the weights, on the noises (never below the sensors'), on peak and on damping of the waves in the
predictor. A law is accepted if it has all margins and costs less in that sea, by linear prediction,
with the cost of a self-tuned law (`cost_weights`).
"""

import math
from dataclasses import asdict, dataclass, replace
from typing import Final, Literal, NamedTuple, get_args

import numpy as np

from utank_hil.analysis.loop.loop_simulation import SensorNoise
from utank_hil.analysis.loop.margins import closed_loop_response, robustness
from utank_hil.analysis.loop.sea_response import SlopeDensity, moment_of, motion_in_sea
from utank_hil.analysis.loop.self_tuning import (
    NoLawError,
    cost_weights,
    sample_time_of,
    short,
    unknown_sea,
)
from utank_hil.control import BuiltLaw, DesignPlant, PredictiveDesign, Predictor, SeaModel
from utank_hil.control.lqg_design import LQGDesign
from utank_hil.dynamics import STATES

LinearKind = Literal["gpc", "dpc", "lqg"]
LINEAR_KINDS: Final[tuple[LinearKind, ...]] = get_args(LinearKind)
LinearDesign = PredictiveDesign | LQGDesign

STEP: Final = 2.0  #: Factor between successive trials of the weights. Chosen; no study.
MOST_TRIALS: Final = 16  #: Limit on trials, down to weights of 2^-15. Chosen; no study.


class _Shipped(NamedTuple):
    """Dimensionless parameters of a shipped law."""

    measured: tuple[str, ...]
    noise: tuple[float, ...]
    order: int
    wave_damping_ratio: float
    pressure_noise: float
    weight: tuple[float, ...]


_SHIPPED: Final[dict[LinearKind, _Shipped]] = {
    "gpc": _Shipped(("roll_rad",), (0.0778,), 90, 0.0117, 0.0293, (1.43,)),
    "dpc": _Shipped(("roll_rad", "level_m"), (0.0389, 0.0127), 90, 0.0178, 0.00877, (1.56, 0.125)),
    "lqg": _Shipped(
        ("roll_rad", "roll_rate_rad_s", "level_m"),
        (0.0907, 0.133, 0.0143),
        1,
        0.0051,
        0.0246,
        (0.35, 0.175, 0.00534, 0.000296),
    ),
}
_STEPS: Final = (4.0, 2.0, 1.15, 2.0)
"""First step of each factor: on weights, noises, peak and damping. Chosen; no study."""
_SIZES: Final = 3  # Number of step sizes, each the square root of the one before. Chosen; no study.
_SWEEPS: Final = 3  # Limit on passes over the factors with one step size. Chosen; no study.
_MOST_DAMPING: Final = 1.0  # Limit on the damping of the predictor's waves: critical damping.
_SLOPE: Final = 1.46
"""Significant slope of the sea assumed for the scaled law, over the passive roll's RMS."""


def scaled(design: LinearDesign, factor: float) -> LinearDesign:
    """Return the design with its weights on outputs or states multiplied."""
    if isinstance(design, LQGDesign):
        return replace(design, state_weight=tuple(factor * w for w in design.state_weight))
    assert design.output_weight is not None
    return replace(design, output_weight=tuple(factor * w for w in design.output_weight))


def scaled_law(
    kind: LinearKind, plant: DesignPlant, slope_rad: float, peak_rad_s: float
) -> LinearDesign:
    """Scale the shipped law of a kind to another ship, without judging it.

    `plant` has the limits of its pump; `slope_rad` is the significant amplitude of the effective
    wave slope, `peak_rad_s` the peak frequency of the sea's spectrum.
    """
    w, shipped, limits = plant.ship.natural_frequency_rad_s, _SHIPPED[kind], plant.limits
    sizes = slope_rad, slope_rad * w, limits.level_m, limits.level_m * w
    size = dict(zip(STATES, sizes, strict=True))
    predictor = Predictor(
        measured=shipped.measured,
        measurement_std=tuple(
            short(noise * size[name])
            for name, noise in zip(shipped.measured, shipped.noise, strict=True)
        ),
        order=shipped.order,
        wave_peak_rad_s=short(peak_rad_s),
        wave_damping_ratio=shipped.wave_damping_ratio,
        wave_slope_rad=short(slope_rad),
        pressure_noise_pa_rt_s=short(shipped.pressure_noise * limits.pressure_pa / math.sqrt(w)),
        sample_time_s=sample_time_of(plant),
    )
    weighed = STATES if kind == "lqg" else shipped.measured
    weight = tuple(
        short(limits.pressure_pa**2 * share / size[name] ** 2)
        for name, share in zip(weighed, shipped.weight, strict=True)
    )
    washout_rad_s = short(0.04 * w)
    if kind == "lqg":
        return LQGDesign(predictor, weight, washout_rad_s=washout_rad_s)
    control, first = (58, 28) if kind == "gpc" else (57, 0)
    return PredictiveDesign(kind, predictor, control, 71, weight, first, washout_rad_s)


def first_law(
    plant: DesignPlant, slope_rad: float, peak_rad_s: float, kind: LinearKind = "lqg"
) -> LinearDesign:
    """Law of `scaled_law` with the greatest weights that keep all margins, else `NoLawError`."""
    design = scaled_law(kind, plant, slope_rad, peak_rad_s)
    failures: tuple[str, ...] = ()
    for trial in range(MOST_TRIALS):
        asked = scaled(design, STEP**-trial)
        failures = _failures(asked, plant)
        if not failures:
            return asked
    raise NoLawError(
        f"no {kind.upper()} law will do on this ship; the gentlest one is {failures[0]}"
    )


def _failures(design: LinearDesign, plant: DesignPlant) -> tuple[str, ...]:
    law, measured = design.law(plant), design.predictor.measured
    return robustness(law, plant, measured, with_delay_margin=False).failures()


def auto_tuned(
    kind: LinearKind, plant: DesignPlant, sea: SlopeDensity
) -> tuple[float, LinearDesign]:
    """Cost over passive, and law, of the cheapest tried with all margins; else `NoLawError`."""
    search = _Search(kind, plant, sea)
    best, factors = search.start, [1.0] * len(_STEPS)
    for size in range(_SIZES):
        for _ in range(_SWEEPS):
            before = best
            for which, first in enumerate(_STEPS):
                for step in (first ** (0.5**size), first ** -(0.5**size)):
                    tried = [*factors]
                    tried[which] *= step
                    better = search.better(tried, best[0])
                    if better is not None:
                        best, factors = better, tried
                        break
            if best is before:
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
        """Numbers of the law for a plant, or `NoLawError` as of `auto_tuned`."""
        return auto_tuned(self.kind, plant, self.sea or unknown_sea(plant.ship))[1]

    def build(self, plant: DesignPlant) -> BuiltLaw:
        """Design the law for a plant."""
        return self.tuned(plant).build(plant)


class _Search:
    """Design, judgement and prediction of laws of a kind for one ship in one sea."""

    def __init__(self, kind: LinearKind, plant: DesignPlant, sea: SlopeDensity) -> None:
        self._least_std = asdict(SensorNoise())
        self._plant = plant
        self._moment = moment_of(sea, plant.ship)
        w = self._moment.frequency_rad_s
        answers, _ = closed_loop_response(None, plant, (), w)
        roll = np.abs(answers[:, STATES.index("roll_rad")])
        energy = np.square(roll * self._moment.amplitude) / 2
        self._passive_rad = math.sqrt(float(energy.sum()))
        if not self._passive_rad > 0:
            raise NoLawError("the sea does not roll the ship: there is nothing to design a law for")
        self._weights = cost_weights(self._passive_rad, plant.limits)
        mean_rad_s = float(energy @ w / energy.sum())
        peaks = mean_rad_s, math.sqrt(mean_rad_s * plant.ship.natural_frequency_rad_s)
        first = [first_law(plant, _SLOPE * self._passive_rad, peak, kind=kind) for peak in peaks]
        #: Cost, and the cheapest law that is only scaled.
        self.start = min(((self._cost(each), each) for each in first), key=lambda each: each[0])

    def better(self, factors: list[float], cost: float) -> tuple[float, LinearDesign] | None:
        """The cost and law with these factors if it has all margins and costs less than `cost`."""
        design = _varied(self.start[1], self._least_std, *factors)
        if design is None:
            return None
        try:
            found = self._cost(design)
            good = found < cost and not _failures(design, self._plant)
        except (ValueError, ArithmeticError):  # LinAlgError is a ValueError
            return None
        return (found, design) if good else None

    def _cost(self, design: LinearDesign) -> float:
        plant, limits = self._plant, self._plant.limits
        law, measured = design.law(plant), design.predictor.measured
        motion = motion_in_sea(law, plant, measured, self._moment)
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
