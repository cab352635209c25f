"""Acceptance test of an identified model, with objections in words.

The model is judged on validation data and against prior knowledge of the ship. Its law is judged
elsewhere (`utank_hil.retuning.redesign`).
"""

import math
from dataclasses import dataclass

import numpy as np

from utank_hil.identification.ship_fit import ShipFit
from utank_hil.identification.validation import Validation


@dataclass(frozen=True, slots=True)
class ModelLimits:
    """Limits of the acceptance test."""

    #: Shortest and longest roll period of the ship's stability booklet.
    roll_period_range_s: tuple[float, float]
    fit: float = 0.8  #: Smallest one-step fit of each output on validation data.
    #: Largest autocorrelation of the prediction errors on validation data at any lag. A whiteness
    #: test is no criterion: with hundreds of coefficients the errors are always slightly coloured,
    #: and with enough data significantly.
    correlation: float = 0.5
    period_deviation: float = 0.05  #: Largest relative standard deviation of the roll period.
    #: Largest misfit of the ship to the identified model, relative to its uncertainty.
    dispersion: float = 12.0


def model_objections(validation: Validation, fit: ShipFit, limits: ModelLimits) -> tuple[str, ...]:
    """Return objections to an identified model, in words; empty if it is acceptable.

    `validation` is of the ARX model, and `fit` the ship and tank fitted to it.
    """
    found = []
    # The form of these conditions makes NaN an objection too.
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
