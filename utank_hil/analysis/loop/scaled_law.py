"""A first law for any ship: the shipped LQG law by similarity, asked for less until it is accepted.

The parameters of ``configs/controllers/lqg.yaml`` are those of one ship in one sea. Made
dimensionless by roll frequency w, effective wave slope s, greatest pressure P and level limit h,
they serve another ship in another sea:

* measurement noise 0.0907 s, 0.133 s w, 0.0143 h on roll, roll rate and level;
* pressure noise 0.0246 P / sqrt(w); sample time 0.1 / w; corner of the washout 0.04 w;
* weights P^2 times 0.35 / s^2, 0.175 / (s w)^2, 0.00534 / h^2, 0.000296 / (h w)^2 on roll, level
  and their rates, and 1 on the square of the pressure.

Similarity is not robustness. A law that misses a required margin is asked for less, by smaller
weights on the motion, until it meets them all.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Final

from utank_hil.analysis.loop.robustness import Robustness, robustness
from utank_hil.control.design_plant import DesignPlant
from utank_hil.control.lqg_design import LQGDesign
from utank_hil.control.predictive.design import Predictor
from utank_hil.tick import TICK_S

STEP: Final = 2.0
"""From one trial of the weights to the next."""
MOST_TRIALS: Final = 16

_MEASURED = ("roll_rad", "roll_rate_rad_s", "level_m")


class NoLawError(ValueError):
    """No law of the kind is robust enough, or within the limits, however little it does."""


@dataclass(frozen=True, slots=True)
class FirstLaw:
    """A law that meets the required margins.

    Attributes
    ----------
    design : LQGDesign
    weight_factor : float
        Of the weights that similarity gives; 1 where those were accepted.
    robustness : Robustness
    """

    design: LQGDesign
    weight_factor: float
    robustness: Robustness


def scaled_law(plant: DesignPlant, slope_rad: float, peak_rad_s: float) -> LQGDesign:
    """The shipped LQG law for another ship, not judged.

    Parameters
    ----------
    plant : DesignPlant
        With the limits of its pump.
    slope_rad : float
        Significant amplitude of the effective wave slope.
    peak_rad_s : float
        Of the sea's spectrum.
    """
    w, s = plant.ship.natural_frequency_rad_s, slope_rad
    p, h = plant.limits.pressure_pa, plant.limits.level_m
    predictor = Predictor(
        measured=_MEASURED,
        measurement_std=(_short(0.0907 * s), _short(0.133 * s * w), _short(0.0143 * h)),
        order=1,
        wave_peak_rad_s=_short(peak_rad_s),
        wave_damping_ratio=0.0051,
        wave_slope_rad=_short(s),
        pressure_noise_pa_rt_s=_short(0.0246 * p / math.sqrt(w)),
        sample_time_s=round(TICK_S * max(2, round(0.1 / w / TICK_S)), 2),
    )
    weights = 0.35 / s**2, 0.175 / (s * w) ** 2, 0.00534 / h**2, 0.000296 / (h * w) ** 2
    return LQGDesign(
        predictor,
        state_weight=tuple(p**2 * weight for weight in weights),
        washout_rad_s=_short(0.04 * w),
    )


def first_law(
    plant: DesignPlant,
    slope_rad: float,
    peak_rad_s: float,
    suits: Callable[[LQGDesign], bool] = lambda _: True,
) -> FirstLaw:
    """The law of `scaled_law` with the greatest weights at which it meets the required margins.

    Its numbers have three digits, as they stand in a file.

    Parameters
    ----------
    plant, slope_rad, peak_rad_s
        As `scaled_law` takes them.
    suits : callable, optional
        What a law with all margins must be besides; smaller weights suit more.

    Raises
    ------
    NoLawError
        If no weights do.
    """
    design = scaled_law(plant, slope_rad, peak_rad_s)
    failures: tuple[str, ...] = ()
    for trial in range(MOST_TRIALS):
        factor = STEP**-trial
        weight = tuple(_short(factor * each) for each in design.state_weight)
        asked = replace(design, state_weight=weight)
        judged = robustness(asked.law(plant), plant, _MEASURED, with_delay_margin=False)
        failures = judged.failures()
        if not failures and suits(asked):
            return FirstLaw(asked, factor, judged)
    gentlest = failures[0] if failures else "beyond the limits of pump and tank"
    raise NoLawError(f"no LQG law will do on this ship; the gentlest one is {gentlest}")


def _short(value: float) -> float:
    return float(f"{value:.3g}")
