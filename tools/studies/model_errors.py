"""Laws on a ship other than the one they were designed for: roll in the storm hour.

    python -m tools.studies.model_errors --seeds 8                  # --seconds, --json

The shipped laws stay as they are; the first ship, her pump or the way from sensor to pump change.
Printed is the share by which the roll RMS is less than with the passive tank in the same waves,
mean and 95 % confidence interval. Where the ship herself changes, the laws designed anew for her
are printed beside the shipped ones. Takes about 20 minutes on two cores.
"""

import dataclasses
import math
from dataclasses import dataclass

import numpy as np

from tools.printing import show
from tools.studies.sea_trial import PASSIVE, Entrant, Trial, TrialFigures, TrialShip
from tools.studies.trial_setup import (
    STORM_HOUR,
    entrant,
    measured_hour,
    parsed,
    parser,
    run_shown,
    seeds_of,
    shipped,
)
from utank_hil.analysis.motion.confidence import Interval, mean_interval
from utank_hil.dynamics import RollShip

LAWS = {"GPC": "gpc", "DPC": "dpc", "LQG": "lqg", "constrained": "constrained_gpc"}
REDESIGNED = ", designed for her"


@dataclass(frozen=True)
class Error:
    """What is not as the laws believe.

    Attributes
    ----------
    lag_s : float or None
        None as configured.
    period_scale : float
        Of the ship's roll period, by her stiffness.
    """

    name: str
    extra_delay_s: float = 0.0
    pump_gain: float = 1.0
    lag_s: float | None = None
    period_scale: float = 1.0


ERRORS = (
    Error("none"),
    Error("20 ms later", extra_delay_s=0.02),
    Error("50 ms later", extra_delay_s=0.05),
    Error("pump gain 0.8", pump_gain=0.8),
    Error("pump gain 1.2", pump_gain=1.2),
    Error("drive's lag 0.2 s", lag_s=0.2),
    Error("roll period x 1.3", period_scale=1.3),
    Error("roll period x 1.15", period_scale=1.15),
    Error("roll period x 0.85", period_scale=0.85),
    Error("roll period x 0.7", period_scale=0.7),
)


def of_period(ship: RollShip, scale: float) -> RollShip:
    """The ship with another roll period."""
    return dataclasses.replace(ship, stiffness_nm_rad=ship.stiffness_nm_rad / scale**2)


def vessel_with(error: Error) -> TrialShip:
    """The first ship as she is, not as the laws believe."""
    believed = shipped("gpc").plant
    plant = dataclasses.replace(
        believed,
        ship=of_period(believed.ship, error.period_scale),
        delay_s=believed.delay_s + error.extra_delay_s,
        lag_s=believed.lag_s if error.lag_s is None else error.lag_s,
    )
    return TrialShip(plant, pump_gain=error.pump_gain)


def entrants(error: Error) -> tuple[Entrant, ...]:
    """The shipped laws, and with another ship those that are designed for her."""
    found = []
    for name, file in LAWS.items():
        config = shipped(file)
        found.append(entrant(name, config))
        if error.period_scale != 1:
            ship = of_period(config.vessel.ship, error.period_scale)
            vessel = config.vessel.model_copy(update={"ship": ship})
            found.append(entrant(name + REDESIGNED, config.model_copy(update={"vessel": vessel})))
    return tuple(found)


def below_passive(results: list[dict[str, TrialFigures]]) -> dict[str, Interval]:
    """Share by which each law's roll is less than the passive tank's."""
    return {
        name: mean_interval(
            [1 - result[name].roll_rms_rad / result[PASSIVE].roll_rms_rad for result in results]
        )
        for name in results[0]
        if name.removesuffix(REDESIGNED) in LAWS
    }


def main() -> None:
    """Run all seeds with all errors and print the table."""
    arguments = parsed(parser(__doc__, seeds=8, first_seed=401))
    hour, trials = measured_hour(STORM_HOUR), {}
    for error in ERRORS:
        vessel, laws = vessel_with(error), entrants(error)
        trials[error.name] = [
            Trial(hour, seed, vessel, laws, arguments.seconds) for seed in seeds_of(arguments)
        ]
    summary = {
        name: {
            "passive_roll_rms_deg": math.degrees(
                np.mean([one[PASSIVE].roll_rms_rad for one in found])
            ),
            "below_passive": {law: share._asdict() for law, share in below_passive(found).items()},
        }
        for name, found in run_shown(trials).items()
    }
    show(summary, arguments)


if __name__ == "__main__":
    main()
