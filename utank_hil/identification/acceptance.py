"""Whether an identified model may be believed: what speaks against it, in words.

The model is judged on data it was not made from, and against what is known of the ship. Whether the
law made with it is good is judged elsewhere (`utank_hil.retuning.redesign`).
"""

import math
from dataclasses import dataclass

import numpy as np

from utank_hil.identification.ship_fit import ShipFit
from utank_hil.identification.validation import Validation


@dataclass(frozen=True, slots=True)
class ModelLimits:
    """What a model must keep within.

    Attributes
    ----------
    roll_period_range_s : tuple of float
        Of the ship's stability booklet.
    fit : float
        Least one-step fit of each output on held-out data.
    correlation : float
        Greatest autocorrelation of the held-out prediction errors at any lag. A probability of
        whiteness is no measure here: with hundreds of coefficients a little colour is always
        there, and with enough data always significant.
    period_deviation : float
        Greatest standard deviation of the roll period, as a part of it.
    dispersion : float
        How much worse than its errors explain the ship may fit the identified model.
    """

    roll_period_range_s: tuple[float, float]
    fit: float = 0.8
    correlation: float = 0.5
    period_deviation: float = 0.05
    dispersion: float = 12.0


def model_objections(validation: Validation, fit: ShipFit, limits: ModelLimits) -> tuple[str, ...]:
    """What speaks against an identified model, in words; empty if nothing does.

    Parameters
    ----------
    validation : Validation
        Of the identified ARX model on held-out data.
    fit : ShipFit
        Ship and tank behind it.
    limits : ModelLimits
    """
    found = []
    # written so that NaN is an objection too
    one_step = float(np.min(validation.one_step_fit))
    if not one_step >= limits.fit:
        found.append(f"fit on held-out data is {one_step:.2f}, less than {limits.fit:g}")
    correlation = float(np.max(np.abs(validation.residual_correlation)))
    if not correlation <= limits.correlation:
        found.append(
            f"held-out prediction errors are correlated by {correlation:.2f}, more than "
            f"{limits.correlation:g}: there is more to predict"
        )
    low, high = limits.roll_period_range_s
    period_s = 2 * math.pi / fit.ship.natural_frequency_rad_s
    if not low <= period_s <= high:
        found.append(
            f"roll period {period_s:.2f} s is outside the stability booklet's {low:g} to {high:g} s"
        )
    if not fit.period_deviation <= limits.period_deviation:
        found.append(
            f"roll period is uncertain by {fit.period_deviation:.0%}, more than "
            f"{limits.period_deviation:.0%}: give stronger or longer pulses"
        )
    if not fit.dispersion <= limits.dispersion:
        found.append(
            f"no ship explains the identified model: the misfit is {fit.dispersion:.1f} times "
            f"its uncertainty, more than {limits.dispersion:g}"
        )
    return tuple(found)
