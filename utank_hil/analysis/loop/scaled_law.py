"""A first law for any ship: a shipped law scaled by similarity, its weights lowered if refused.

The parameters of ``lqg.yaml``, ``gpc.yaml`` and ``dpc.yaml`` in ``configs/controllers`` are those
of one ship in one sea. Made dimensionless by roll frequency w, effective wave slope s, greatest
pressure P and level limit h, they serve another ship in another sea:

* measurement noise on roll over s, on roll rate over s w, on level over h;
* pressure noise over P / sqrt(w); sample time 0.1 / w; corner of the washout 0.04 w; horizons in
  samples unchanged;
* weights over P^2, times s^2 on roll, (s w)^2 on roll rate, h^2 on level, (h w)^2 on its rate, with
  1 on the square of the pressure.

Similarity does not guarantee robustness. The weights on the motion of a law that misses a required
margin are lowered until it has all margins.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Final, Literal, NamedTuple, get_args

from utank_hil.analysis.loop.robustness import Robustness, robustness
from utank_hil.analysis.loop.trade import scaled
from utank_hil.base.tick import TICK_S
from utank_hil.control.design_plant import DesignPlant
from utank_hil.control.lqg_design import LQGDesign
from utank_hil.control.predictive.design import PredictiveDesign, Predictor
from utank_hil.dynamics.linear import STATES

LinearKind = Literal["gpc", "dpc", "lqg"]
LINEAR_KINDS: Final[tuple[LinearKind, ...]] = get_args(LinearKind)
LinearDesign = PredictiveDesign | LQGDesign

STEP: Final = 2.0
"""Factor between successive trials of the weights. Chosen; no study."""
MOST_TRIALS: Final = 16
"""Limit on trials, down to weights of 2^-15. Chosen; no study."""


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


class NoLawError(ValueError):
    """No law of the kind is robust or within the limits, even with the smallest weights tried."""


@dataclass(frozen=True, slots=True)
class FirstLaw:
    """A law that meets the required margins."""

    design: LinearDesign
    weight_factor: float  #: Factor on the weights of similarity; 1 where those were accepted.
    robustness: Robustness


def scaled_law(
    kind: LinearKind, plant: DesignPlant, slope_rad: float, peak_rad_s: float
) -> LinearDesign:
    """Scale the shipped law of a kind to another ship, without judging it.

    Parameters
    ----------
    plant : DesignPlant
        With the limits of its pump.
    slope_rad : float
        Significant amplitude of the effective wave slope.
    peak_rad_s : float
        Peak frequency of the sea's spectrum.
    """
    w, shipped, limits = plant.ship.natural_frequency_rad_s, _SHIPPED[kind], plant.limits
    sizes = slope_rad, slope_rad * w, limits.level_m, limits.level_m * w
    size = dict(zip(STATES, sizes, strict=True))
    predictor = Predictor(
        measured=shipped.measured,
        measurement_std=tuple(
            _short(noise * size[name])
            for name, noise in zip(shipped.measured, shipped.noise, strict=True)
        ),
        order=shipped.order,
        wave_peak_rad_s=_short(peak_rad_s),
        wave_damping_ratio=shipped.wave_damping_ratio,
        wave_slope_rad=_short(slope_rad),
        pressure_noise_pa_rt_s=_short(shipped.pressure_noise * limits.pressure_pa / math.sqrt(w)),
        sample_time_s=round(TICK_S * max(2, round(0.1 / w / TICK_S)), 2),
    )
    weighed = STATES if kind == "lqg" else shipped.measured
    weight = tuple(
        _short(limits.pressure_pa**2 * share / size[name] ** 2)
        for name, share in zip(weighed, shipped.weight, strict=True)
    )
    washout_rad_s = _short(0.04 * w)
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
) -> FirstLaw:
    """Find the law of `scaled_law` with the greatest weights at which it has the required margins.

    Raises `NoLawError` if no weights do.

    Parameters
    ----------
    suits : callable, optional
        Further requirement on a law with all margins; smaller weights must help to meet it.
    """
    design = scaled_law(kind, plant, slope_rad, peak_rad_s)
    failures: tuple[str, ...] = ()
    for trial in range(MOST_TRIALS):
        factor = STEP**-trial
        asked = scaled(design, factor)
        judged = robustness(
            asked.law(plant), plant, asked.predictor.measured, with_delay_margin=False
        )
        failures = judged.failures()
        if not failures and suits(asked):
            return FirstLaw(asked, factor, judged)
    gentlest = failures[0] if failures else "beyond the limits of pump and tank"
    raise NoLawError(f"no {kind.upper()} law will do on this ship; the gentlest one is {gentlest}")


def _short(value: float) -> float:
    return float(f"{value:.3g}")
