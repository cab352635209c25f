"""Tuning of linear laws: a shipped law scaled to ship, pump and sea.

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

``tuning: auto`` (`AutoDesign`) is that law for the sea that a file names, or an unknown one.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Final, Literal, NamedTuple, TypeVar, get_args

import numpy as np

from utank_hil.analysis.loop.margins import Robustness, closed_loop_response, robustness
from utank_hil.analysis.loop.sea_response import moment_of
from utank_hil.analysis.loop.self_tuning import (
    NoLawError,
    sample_time_of,
    short,
    unknown_sea,
)
from utank_hil.control import (
    BuiltLaw,
    ConstrainedDesign,
    DesignPlant,
    PredictiveDesign,
    Predictor,
    SeaModel,
)
from utank_hil.control.lqg_design import LQGDesign
from utank_hil.dynamics import STATES

LinearKind = Literal["gpc", "dpc", "lqg"]
LINEAR_KINDS: Final[tuple[LinearKind, ...]] = get_args(LinearKind)
LinearDesign = PredictiveDesign | LQGDesign
Design = LinearDesign | ConstrainedDesign
DesignT = TypeVar("DesignT", bound=Design)

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
_SLOPE: Final = 1.46
"""Significant slope of the sea assumed for the scaled law, over the passive roll's RMS."""


@dataclass(frozen=True, slots=True)
class TunedLaw:
    """Parameters of a law that has the required margins."""

    design: LinearDesign
    robustness: Robustness


def varied(design: Design) -> str:
    """Name of the parameter that `scaled` scales: a weight, or a deadbeat's control horizon."""
    if isinstance(design, LQGDesign):
        return "state weight"
    if isinstance(design, PredictiveDesign) and design.output_weight is None:
        return "control horizon"
    return "output weight"


def scaled(design: DesignT, factor: float) -> DesignT:
    """Return the design with its `varied` parameter multiplied.

    A horizon is rounded to whole samples and its window of targets keeps its length. A constrained
    design has its pressure weight divided, which is equivalent.
    """
    if isinstance(design, ConstrainedDesign):
        return replace(design, pressure_weight_rad2=design.pressure_weight_rad2 / factor)
    if isinstance(design, LQGDesign):
        return replace(design, state_weight=tuple(factor * w for w in design.state_weight))
    if design.output_weight is not None:
        return replace(design, output_weight=tuple(factor * w for w in design.output_weight))
    horizon = max(1, round(factor * design.control_horizon))
    window = design.prediction_horizon - design.control_horizon
    return replace(design, control_horizon=horizon, prediction_horizon=horizon + window)


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
    plant: DesignPlant,
    slope_rad: float,
    peak_rad_s: float,
    suits: Callable[[LinearDesign], bool] = lambda _: True,
    kind: LinearKind = "lqg",
) -> TunedLaw:
    """Find the law of `scaled_law` with the greatest weights at which it has the required margins.

    `suits` is a further requirement on a law with all margins; smaller weights must help to meet
    it. Raises `NoLawError` if no weights do.
    """
    design = scaled_law(kind, plant, slope_rad, peak_rad_s)
    failures: tuple[str, ...] = ()
    for trial in range(MOST_TRIALS):
        asked = scaled(design, STEP**-trial)
        law = asked.law(plant)
        judged = robustness(law, plant, asked.predictor.measured, with_delay_margin=False)
        failures = judged.failures()
        if not failures and suits(asked):
            return TunedLaw(asked, judged)
    gentlest = failures[0] if failures else "beyond the limits of pump and tank"
    raise NoLawError(f"no {kind.upper()} law will do on this ship; the gentlest one is {gentlest}")


@dataclass(frozen=True, slots=True)
class AutoDesign:
    """A GPC, DPC or LQG law with numbers that follow from ship, pump and sea."""

    kind: LinearKind
    tuning: Literal["auto"]  #: Replaces the numbers of the kind.
    #: Expected sea, of which spectrum and effective slope count; None for an unknown sea.
    sea: SeaModel | None = None

    def tuned(self, plant: DesignPlant) -> LinearDesign:
        """Numbers of the law for a plant.

        Raises `NoLawError` as `first_law`.
        """
        moment = moment_of(self.sea or unknown_sea(plant.ship), plant.ship)
        w = moment.frequency_rad_s
        answers, _ = closed_loop_response(None, plant, (), w)
        energy = np.square(np.abs(answers[:, STATES.index("roll_rad")]) * moment.amplitude) / 2
        passive_rad = math.sqrt(float(energy.sum()))
        mean_rad_s = float(energy @ w / energy.sum())
        return first_law(plant, _SLOPE * passive_rad, mean_rad_s, kind=self.kind).design

    def build(self, plant: DesignPlant) -> BuiltLaw:
        """Design the law for a plant."""
        return self.tuned(plant).build(plant)
