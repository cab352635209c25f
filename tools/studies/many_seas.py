"""Shares of the possible in many seas: the shipped laws beside the one that designs itself.

    python -m tools.studies.many_seas --seconds 900 --seeds 2

The first ship, linear, with the sensors, delay, lag and limiters of the bench, in sixteen seas of
ordinary weather, storm and formulas, and in twelve more: swell from afar, two systems at once,
short and steep seas. The self-tuned law is given each sea's spectrum; the last column is the same
law without it. Share is the part of the way from the passive tank to the clairvoyant bound.
"""

import math
from typing import Final

import numpy as np

from tools.printing import show
from tools.studies.trial_setup import (
    STORM_HOUR,
    chosen,
    entrant,
    measured_hour,
    parsed,
    parser,
    run_shown,
    seeds_of,
    shipped,
)
from utank_hil.analysis.loop.sea_trial import CLAIRVOYANT, PASSIVE, Entrant, Trial, TrialShip
from utank_hil.analysis.loop.self_tuning import SelfTunedDesign
from utank_hil.control.sea_model import SeaModel
from utank_hil.sea import Spectrum, jonswap

GPC, CONSTRAINED, TUNED, UNTOLD = "GPC, roll", "constrained", "self-tuned", "no sea known"
LAWS: Final = (GPC, CONSTRAINED, TUNED, UNTOLD)
HOURS: Final = (
    *("06T08", "06T20", "07T08", "07T20", "08T08", "09T04", "09T12", "09T19"),
)  # of February 2019, significant heights of 0.65 to 1.4 m


def both(first: Spectrum, second: Spectrum) -> Spectrum:
    """Two systems at once."""
    frequency_hz = np.arange(0.03, 0.6, 0.0025)
    density = sum(
        np.interp(frequency_hz, each.frequency_hz, each.density, left=0.0, right=0.0)
        for each in (first, second)
    )
    return Spectrum(frequency_hz, density)


def seas() -> dict[str, Spectrum]:
    """The sixteen, then the new ones."""
    found = {f"February {hour}:40": measured_hour(f"2019-02-{hour}:40") for hour in HOURS}
    found["storm hour"] = measured_hour(STORM_HOUR)
    for hs_m, tp_s in ((2.0, 6.5), (3, 8), (4, 9.5), (5, 11), (4, 12.5), (3, 14), (3, 17)):
        found[f"JONSWAP {hs_m} m {tp_s} s"] = jonswap(hs_m, tp_s)
    for hs_m, tp_s, gamma in ((1.5, 15.0, 7), (2, 18, 6), (1, 12.5, 7), (2.5, 13.5, 5)):
        found[f"swell {hs_m} m {tp_s} s"] = jonswap(hs_m, tp_s, gamma)
    found["2 m 14 s and 1.5 m 6 s"] = both(jonswap(2, 14, 5), jonswap(1.5, 6))
    found["1.5 m 11 s and 1.5 m 7 s"] = both(jonswap(1.5, 11, 5), jonswap(1.5, 7))
    found["1 m 17 s and 2.5 m 8.5 s"] = both(jonswap(1, 17, 5), jonswap(2.5, 8.5))
    found["2 m 12.5 s and 2.5 m 9 s"] = both(jonswap(2, 12.5, 5), jonswap(2.5, 9))
    for hs_m, tp_s in ((3.5, 7.5), (2.5, 7.0), (1.5, 5.5), (5, 9)):
        found[f"steep {hs_m} m {tp_s} s"] = jonswap(hs_m, tp_s)
    return found


def entrants(sea: Spectrum) -> tuple[Entrant, ...]:
    """The laws for a sea."""
    planned = shipped("constrained_gpc")
    model = SeaModel(tuple(sea.frequency_hz.tolist()), tuple(sea.density.tolist()))
    designs = {TUNED: SelfTunedDesign("self_tuned", model), UNTOLD: SelfTunedDesign("self_tuned")}
    return (
        entrant(GPC, shipped("gpc")),
        entrant(CONSTRAINED, planned),
        *(
            entrant(name, planned.model_copy(update={"law": design}))
            for name, design in designs.items()
        ),
    )


def main() -> None:
    """Run all seas and print the shares."""
    made = parser(__doc__, seeds=2, first_seed=1)
    made.add_argument("--only", default="", help="run the seas whose names hold this text")
    arguments = parsed(made)
    try:
        wanted = chosen(seas(), arguments.only)
    except ValueError as error:
        made.error(str(error))
    vessel, bound, trials = TrialShip(shipped("gpc").plant), shipped("constrained_gpc").limits, {}
    for name, sea in wanted.items():
        laws = entrants(sea)
        trials[name] = [
            Trial(sea, seed, vessel, laws, arguments.seconds, bound) for seed in seeds_of(arguments)
        ]
    found: dict[str, dict[str, float]] = {}
    for name, runs in run_shown(trials).items():
        rolls = {
            each: float(np.mean([run[each].roll_rms_rad for run in runs]))
            for each in (PASSIVE, CLAIRVOYANT, *LAWS)
        }
        passive, best = rolls[PASSIVE], rolls[CLAIRVOYANT]
        found[name] = {"passive_deg": math.degrees(passive)} | {
            law: (passive - rolls[law]) / (passive - best) for law in LAWS
        }
    show({"seconds": arguments.seconds, "seas": found}, arguments)


if __name__ == "__main__":
    main()
