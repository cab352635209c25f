"""Design of a constrained law from an estimate of waves and ship, in the retuner's process."""

import dataclasses
import math
from dataclasses import dataclass
from typing import Final

import numpy as np

from utank_hil.analysis.loop.sea_response import at_work, moment_of
from utank_hil.analysis.loop.self_tuning import self_tuned
from utank_hil.base.arrays import FloatArray
from utank_hil.control import DesignPlant
from utank_hil.retuning.answer import Refusal, RenewedLaw
from utank_hil.retuning.estimate import MotionEstimate, ShipFigures
from utank_hil.sea import SlopeSpectrum

TAIL_SHARE: Final = 0.15
"""Share of the bands, at the upper end, from which the tail is computed. Chosen; no study."""
ROLL_PART: Final = 1.0  #: Largest predicted roll, relative to the passive tank's.


@dataclass(frozen=True, slots=True)
class RenewalTask:
    """Inputs of the retuner besides the estimate."""

    plant: DesignPlant  #: The configured ship and tank.
    sample_time_s: float  #: Sample time of the present and of the new law.
    mean_power_w: float = math.inf  #: Budget of the predicted power.


class TailedSpectrum:
    """A slope spectrum with the tail of wind waves above its last band.

    The elevation's density falls with the fifth power of the frequency there (Phillips), so the
    slope's with the first.
    """

    def __init__(self, waves: SlopeSpectrum) -> None:
        self._waves = waves
        count = max(1, round(TAIL_SHARE * len(waves.omega_rad_s)))
        self._top_rad_s = float(waves.omega_rad_s[-1])
        self._level = float(np.mean((waves.omega_rad_s * waves.density)[-count:]))

    def slope_density(self, omega_rad_s: FloatArray) -> FloatArray:
        """One-sided density of the effective wave slope, rad^2 per rad/s."""
        inside = self._waves.slope_density(omega_rad_s)
        return np.where(omega_rad_s > self._top_rad_s, self._level / omega_rad_s, inside)


def renew(estimate: MotionEstimate, task: RenewalTask) -> RenewedLaw | Refusal:
    """Design a law for the estimated waves and ship; a configured ship may be loaded otherwise."""
    if estimate.waves is None or estimate.ship is None:
        return Refusal(("there is no estimate of the waves to design a law for",))
    plant = dataclasses.replace(task.plant, ship=estimate.ship.ship(task.plant.ship))
    sea = TailedSpectrum(estimate.waves)
    try:
        tuned = self_tuned(
            at_work(plant, moment_of(sea, plant.ship)),
            sea,
            mean_power_w=task.mean_power_w,
            sample_time_s=task.sample_time_s,
            any_load=estimate.ship == ShipFigures.of(task.plant.ship),
        )
    except ValueError as error:  # NoLawError and LinAlgError are ValueErrors.
        return Refusal((str(error),))
    predicted = tuned.prediction
    if not predicted.roll_rad <= ROLL_PART * tuned.passive_roll_rad:
        return Refusal(
            (
                f"the law is predicted to roll {math.degrees(predicted.roll_rad):.2f} degrees RMS, "
                f"the passive tank {math.degrees(tuned.passive_roll_rad):.2f}",
            )
        )
    return RenewedLaw(tuned.law, predicted.roll_rad, predicted.pressure_pa, tuned.passive_roll_rad)
