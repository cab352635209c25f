"""Does planning within the limits pay? Constrained GPC against clipped GPC, sea by sea.

    python -m tools.studies.constrained_campaign --seeds 8 --out out/campaign    # --seconds, --json

The first ship in measured and formula seas and with weaker pumps, the same realisations for all:

* constrained: plans within pressure, rate, level and power; expects the sea there is;
* clipped: the very same law without its plan, cut by the limiter with its usual level barrier;
* clipped late: the same, cut by the limiter that stands behind the constrained law;
* self-tuned, and self-tuned clipped: the same two of the law that designs itself for this sea;
* GPC_ROLL: the shipped law that sees the roll alone and knows the sea by its peak.

Differences are paired, seed by seed, with the 95 % confidence interval of their mean. "Held back"
is the share of time in which the limiter gives the clipped law less than it asks for. Takes about
25 minutes on two cores. With --horizon-s the plans reach further (and hold more knots):

    python -m tools.studies.constrained_campaign --only "roll period" --horizon-s 30
"""

import dataclasses
import math
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from tools.printing import show
from tools.studies.sea_trial import Entrant, Trial, TrialFigures, TrialShip
from tools.studies.trial_setup import (
    STORM_HOUR,
    chosen,
    entrant,
    expecting,
    limited,
    measured_hour,
    parsed,
    parser,
    run_shown,
    seeds_of,
    shipped,
)
from utank_hil.analysis.loop.self_tuning import SelfTunedDesign
from utank_hil.analysis.motion.confidence import Interval, mean_interval
from utank_hil.base.arrays import FloatArray
from utank_hil.configuration import ControllerConfig
from utank_hil.control import ConstrainedDesign, PumpLimits
from utank_hil.control.constrained.law import ConstrainedLaw
from utank_hil.control.sea_model import SeaModel
from utank_hil.pictures.style import COLORS, picture
from utank_hil.sea import Spectrum, jonswap

CONSTRAINED, CLIPPED, CLIPPED_LATE, GPC = "constrained", "clipped", "clipped late", "GPC_ROLL"
TUNED, TUNED_CLIPPED = "self-tuned", "self-tuned clipped"
RIVALS = {CLIPPED: CONSTRAINED, GPC: CONSTRAINED, TUNED_CLIPPED: TUNED}
"""Of which law."""
KNOT_GROWTH = 0.15  # beyond the shipped knots, the distance between two is this share of the time


@dataclass(frozen=True)
class Case:
    """A sea, and the limits of the pump."""

    sea: Spectrum
    pressure_pa: float = 50e3
    power_w: float = math.inf


def cases() -> dict[str, Case]:
    """Seas from where the pump is never at a limit to where it mostly is."""
    storm = measured_hour(STORM_HOUR)
    return {
        "swell, 9 Feb 12:40": Case(measured_hour("2019-02-09T12:40")),
        "short sea, 10 Feb 00:40": Case(measured_hour("2019-02-10T00:40")),
        "short sea, JONSWAP": Case(jonswap(5.0, 8.0)),
        "long swell, JONSWAP": Case(jonswap(4.0, 16.0)),
        "at the roll period, JONSWAP": Case(jonswap(4.0, 12.5)),
        "storm hour, 10 Feb 05:40": Case(storm),
        "storm hour, pump of 25 kPa": Case(storm, pressure_pa=25e3),
        "storm hour, pump of 1 MW": Case(storm, power_w=1e6),
        "greater storm, JONSWAP": Case(jonswap(6.5, 11.5)),
    }


def entrants(case: Case, horizon_s: float | None) -> tuple[Entrant, ...]:
    """The laws, each with the limits that stand behind it."""

    def of_pump(limits: PumpLimits) -> PumpLimits:
        return dataclasses.replace(limits, pressure_pa=case.pressure_pa, power_w=case.power_w)

    planned, gpc = shipped("constrained_gpc"), shipped("gpc")
    planned = limited(expecting(planned, case.sea), of_pump(planned.limits))
    sea = SeaModel(tuple(case.sea.frequency_hz.tolist()), tuple(case.sea.density.tolist()))
    tuned = entrant(TUNED, planned.model_copy(update={"law": SelfTunedDesign("self_tuned", sea)}))
    if horizon_s is not None:
        planned = reaching(planned, horizon_s)
    usual = of_pump(gpc.limits)
    constrained = entrant(CONSTRAINED, planned)
    assert isinstance(constrained.law, ConstrainedLaw)
    assert isinstance(tuned.law, ConstrainedLaw)
    plain = constrained.law.unlimited()
    return (
        constrained,
        Entrant(CLIPPED, plain, constrained.measured, usual),
        Entrant(CLIPPED_LATE, plain, constrained.measured, constrained.limits),
        tuned,
        Entrant(TUNED_CLIPPED, tuned.law.unlimited(), tuned.measured, usual),
        entrant(GPC, limited(gpc, usual)),
    )


def reaching(config: ControllerConfig, horizon_s: float) -> ControllerConfig:
    """A constrained law with a longer horizon; its knots grow apart beyond the shipped ones."""
    design = config.law
    assert isinstance(design, ConstrainedDesign)
    samples = round(horizon_s / design.sample_time_s)
    if samples < design.horizon:
        raise ValueError(
            f"--horizon-s must be {design.horizon * design.sample_time_s:g} or more, "
            f"got {horizon_s:g}"
        )
    knots = list(design.knots)
    while (following := knots[-1] + round(KNOT_GROWTH * knots[-1])) < samples - 1:
        knots.append(following)
    longer = dataclasses.replace(design, knots=tuple(knots), horizon=samples)
    return config.model_copy(update={"law": longer})


def figures(runs: list[dict[str, TrialFigures]], name: str, field: str) -> FloatArray:
    """One figure of one entrant, seed by seed."""
    return np.array([getattr(run[name], field) for run in runs])


def below(runs: list[dict[str, TrialFigures]], rival: str) -> Interval:
    """Share by which a law's roll RMS is less than its rival's."""
    ours, theirs = (figures(runs, name, "roll_rms_rad") for name in (RIVALS[rival], rival))
    return mean_interval(1 - ours / theirs)


def outcome(name: str, case: Case, runs: list[dict[str, TrialFigures]]) -> dict[str, Any]:
    """Means of a case, the paired differences, and everything seed by seed."""
    return {
        "name": name,
        "hs_m": case.sea.hs_m,
        "tp_s": case.sea.tp_s,
        "pressure_pa": case.pressure_pa,
        "power_w": case.power_w,
        "roll_rms_deg": {
            law: math.degrees(figures(runs, law, "roll_rms_rad").mean()) for law in runs[0]
        },
        "below": {rival: below(runs, rival)._asdict() for rival in RIVALS},
        "runs": {law: [dataclasses.asdict(run[law]) for run in runs] for law in runs[0]},
    }


def draw(outcomes: list[dict[str, Any]], path: Path) -> None:
    """Paired differences with their intervals, case below case."""
    title = "What planning within limits is worth"
    with picture(path, title, (9.0, 1.6 + 0.45 * len(outcomes))) as figure:
        axes = figure.add_subplot()
        places = np.arange(len(outcomes))[::-1]
        for number, (rival, law) in enumerate(RIVALS.items()):
            intervals = [Interval(**outcome["below"][rival]) for outcome in outcomes]
            axes.errorbar(
                [100 * one.mean for one in intervals],
                places + 0.2 * (1 - number),
                xerr=[100 * one.half_width for one in intervals],
                fmt="o",
                color=COLORS[1 + number],
                capsize=3,
                label=f"{law} below {rival}",
            )
        axes.axvline(0.0, color=COLORS[0], linewidth=1.0)
        axes.set_yticks(places, [outcome["name"] for outcome in outcomes])
        axes.set_xlabel("Roll RMS below the rival's (%), 95 % interval")
        figure.legend(loc="outside lower left", ncols=3, frameon=False)


def main() -> None:
    """Run the campaign, print the tables, draw the picture."""
    made = parser(__doc__, seeds=8, first_seed=301)
    made.add_argument("--out", type=Path, help="folder for the picture campaign.png")
    made.add_argument("--only", default="", help="run the cases whose names hold this text")
    made.add_argument("--horizon-s", type=float, help="length of the plans (12 as shipped)")
    arguments = parsed(made)
    vessel, trials = TrialShip(shipped("constrained_gpc").plant), {}
    try:
        wanted = chosen(cases(), arguments.only)
        for name, case in wanted.items():
            laws = entrants(case, arguments.horizon_s)
            trials[name] = [
                Trial(case.sea, seed, vessel, laws, arguments.seconds)
                for seed in seeds_of(arguments)
            ]
    except ValueError as error:
        made.error(str(error))
    outcomes = [outcome(name, wanted[name], runs) for name, runs in run_shown(trials).items()]
    show({"cases": outcomes}, arguments)
    if arguments.out is not None:
        arguments.out.mkdir(parents=True, exist_ok=True)
        draw(outcomes, arguments.out / "campaign.png")


if __name__ == "__main__":
    main()
