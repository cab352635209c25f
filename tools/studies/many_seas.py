"""Shares of the possible in many seas: the shipped laws beside the one that designs itself.

    python -m tools.studies.many_seas --seconds 900 --seeds 3

The first ship, linear, with the sensors, delay, lag and limiters of the bench, in sixteen seas of
ordinary weather, storm and formulas, and in more: swell from afar, two systems at once, short and
steep seas; the storm on other headings at speed, and with the ship loaded for 0.7 to 1.3 of its
roll period. The self-tuned law is given the waves as they meet the ship, and the ship; "no sea
known" is the same law without the waves. Share is the part of the way from the passive tank to the
clairvoyant bound; no law that does not know the waves to come exceeds that of the causal bound.
"""

import math
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, replace
from multiprocessing import get_context
from typing import Final

import numpy as np

from tools.printing import show
from tools.studies.causal_bound import CausalProblem, causal_bound
from tools.studies.clairvoyant import NoHistoryError
from tools.studies.sea_trial import CLAIRVOYANT, PASSIVE, Entrant, Trial, TrialShip
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
from utank_hil.analysis.loop.self_tuning import SelfTunedDesign
from utank_hil.analysis.motion.confidence import Interval, mean_interval
from utank_hil.base.background import one_thread_each
from utank_hil.control.sea_model import SeaModel
from utank_hil.dynamics import RollShip
from utank_hil.sea import EffectiveSlope, Sea, Spectrum, jonswap

GPC, CONSTRAINED, TUNED, UNTOLD = "GPC, roll", "constrained", "self-tuned", "no sea known"
LAWS: Final = (GPC, CONSTRAINED, TUNED, UNTOLD)
HOURS: Final = (
    *("06T08", "06T20", "07T08", "07T20", "08T08", "09T04", "09T12", "09T19"),
)  # of February 2019, significant heights of 0.65 to 1.4 m
SIXTEEN: Final = 16
PERIODS: Final = (0.7, 0.85, 1.15, 1.3)  #: Of the ship's roll period, by its loading.
HEADINGS_DEG: Final = {"nearly following": 20.0, "quartering": 45.0, "bow": 135.0}
SPEED_M_S: Final = 6.0
CAUSAL: Final = "causal bound"
CAUSAL_RECORDS: Final = 6
CAUSAL_RECORD_S: Final = 600.0
CAUSAL_SEA: Final = {"order": 24, "floor": 1e-3}
_STEP_RAD_S: Final = 0.01
_COMPONENTS: Final = 16384  # Of the sea whose waves the law is told as they meet the ship.


@dataclass(frozen=True)
class Case:
    """A sea, and the ship in it."""

    sea: Spectrum
    ship: TrialShip

    def model(self, **settings: float) -> SeaModel:
        """The effective slope over encounter frequency."""
        ship = self.ship
        if ship.speed_m_s == 0:
            bands = tuple(self.sea.frequency_hz.tolist()), tuple(self.sea.density.tolist())
            slope = ship.effective_slope * abs(math.sin(ship.heading_rad))
            return SeaModel(*bands, effective_slope=slope, **settings)  # type: ignore[arg-type]
        waves = Sea.irregular(
            self.sea,
            1,
            components=_COMPONENTS,
            heading_rad=ship.heading_rad,
            speed_m_s=ship.speed_m_s,
        ).roll_moment(1.0, EffectiveSlope(ship.effective_slope))
        edges = _STEP_RAD_S * (
            0.5 + np.arange(math.ceil(waves.frequency_rad_s.max() / _STEP_RAD_S))
        )
        energy, _ = np.histogram(waves.frequency_rad_s, edges, weights=waves.amplitude**2 / 2)
        return SeaModel.of_slope((edges[1:] + edges[:-1]) / 2, energy / _STEP_RAD_S, **settings)


def of_period(ship: RollShip, scale: float) -> RollShip:
    """The ship with another roll period, by its stiffness."""
    return replace(ship, stiffness_nm_rad=ship.stiffness_nm_rad / scale**2)


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


def cases() -> dict[str, Case]:
    """All seas abeam, then the storm on other headings and with other loadings."""
    plant = shipped("gpc").plant
    found = {name: Case(sea, TrialShip(plant)) for name, sea in seas().items()}
    storm = measured_hour(STORM_HOUR)
    for name, heading_deg in HEADINGS_DEG.items():
        heading_rad = math.radians(heading_deg)
        ship = TrialShip(plant, heading_rad=heading_rad, speed_m_s=SPEED_M_S)
        found[f"storm, {name} at {SPEED_M_S:g} m/s"] = Case(storm, ship)
    for scale in PERIODS:
        loaded = replace(plant, ship=of_period(plant.ship, scale))
        found[f"storm, roll period x {scale:g}"] = Case(storm, TrialShip(loaded))
    return found


def entrants(case: Case) -> tuple[Entrant, ...]:
    """The laws for a case: the shipped ones as they are."""
    planned, plant = shipped("constrained_gpc"), case.ship.plant
    loaded = planned.model_copy(
        update={"vessel": planned.vessel.model_copy(update={"ship": plant.ship})}
    )
    designs = {
        TUNED: SelfTunedDesign("self_tuned", case.model()),
        UNTOLD: SelfTunedDesign("self_tuned"),
    }
    return (
        entrant(GPC, shipped("gpc")),
        entrant(CONSTRAINED, planned),
        *(
            entrant(name, loaded.model_copy(update={"law": design}))
            for name, design in designs.items()
        ),
    )


def causal_share(case: Case) -> Interval | None:
    """Share of the clairvoyant bound that no causal law exceeds.

    None where waves alone lift the water beyond its limit: neither bound is known then.
    """
    plant = replace(case.ship.plant, limits=shipped("constrained_gpc").limits)
    problem = CausalProblem(plant, case.model(**CAUSAL_SEA))
    try:
        runs = [problem.run(seed, CAUSAL_RECORD_S) for seed in range(1, 1 + CAUSAL_RECORDS)]
    except NoHistoryError:
        return None
    return causal_bound(problem, runs).share


def causal_shares(wanted: Sequence[Case]) -> list[Interval | None]:
    """Of each case, in a process for each core."""
    with one_thread_each(), ProcessPoolExecutor(mp_context=get_context("spawn")) as pool:
        return list(pool.map(causal_share, wanted))


def main() -> None:
    """Run all cases and print the shares."""
    made = parser(__doc__, seeds=3, first_seed=1)
    made.add_argument("--only", default="", help="run the cases whose names hold this text")
    arguments = parsed(made)
    try:
        wanted = chosen(cases(), arguments.only)
    except ValueError as error:
        made.error(str(error))
    bound, trials = shipped("constrained_gpc").limits, {}
    for name, case in wanted.items():
        laws = entrants(case)
        trials[name] = [
            Trial(case.sea, seed, case.ship, laws, arguments.seconds, bound)
            for seed in seeds_of(arguments)
        ]
    shares: dict[str, dict[str, Interval]] = {}
    passive_deg = {}
    by_seed = []
    for name, runs in run_shown(trials).items():
        roll = {
            each: np.array([run[each].roll_rms_rad for run in runs])
            for each in (PASSIVE, CLAIRVOYANT, *LAWS)
        }
        gained = {law: roll[PASSIVE] - roll[law] for law in LAWS}
        possible = roll[PASSIVE] - roll[CLAIRVOYANT]
        by_seed.append(np.array([gained[law] / possible for law in LAWS]))
        passive_deg[name] = math.degrees(roll[PASSIVE].mean())
        shares[name] = {law: mean_interval(gained[law] / possible) for law in LAWS}
    for name, share in zip(wanted, causal_shares(list(wanted.values())), strict=True):
        if share is not None:
            shares[name][CAUSAL] = share
    found = {
        "seconds": arguments.seconds,
        "seeds": arguments.seeds,
        "seas": {
            name: {"passive_deg": passive_deg[name]}
            | {law: share._asdict() for law, share in each.items()}
            for name, each in shares.items()
        },
    }
    if len(by_seed) >= SIXTEEN:
        mean = np.mean(by_seed[:SIXTEEN], axis=0)
        found["mean of the first sixteen"] = {
            law: mean_interval(row)._asdict() for law, row in zip(LAWS, mean, strict=True)
        }
        causal = [each[CAUSAL].mean for each in list(shares.values())[:SIXTEEN] if CAUSAL in each]
        found["mean of the first sixteen"][CAUSAL] = {"mean": float(np.mean(causal))}
    show(found, arguments)


if __name__ == "__main__":
    main()
