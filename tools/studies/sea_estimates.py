"""Estimates of waves and ship under way against the truth, over seas, loadings and record lengths.

    python -m tools.studies.sea_estimates --minutes 10 20 --hours 1

Each case is an hour on the bench's full plant, in lockstep, with the shipped GPC or the passive
tank. The record is cut into parts; each is estimated as the retuner's process does it. The truth is
the moment that the bench's waves had in the same part. An hour takes 20 s and a part one or two.
"""

import math
import sys
from collections.abc import Iterator
from dataclasses import dataclass, replace
from datetime import datetime
from typing import Any

import numpy as np

from firmware_sim.bench import jobs_of
from firmware_sim.lockstep_run import run_lockstep
from firmware_sim.run import COLUMNS, RECORD_S
from firmware_sim.scenario import Scenario
from firmware_sim.scenario_sea import JonswapSea
from tools.printing import command_line, show
from tools.studies.trial_setup import CONFIGS
from utank_hil.base.arrays import FloatArray
from utank_hil.canbus import Verdict
from utank_hil.configuration import load_config
from utank_hil.identification.multitaper import bandwidth_rad_s, coefficients
from utank_hil.retuning.estimate import EstimateRequest, ShipFigures
from utank_hil.retuning.estimating import EstimateTask, estimate
from utank_hil.retuning.estimator import SAMPLE_TIME_S
from utank_hil.sea import SlopeSpectrum

SETTLED_S = 120.0
TAPERS = 4
CLOSE = 0.05
"""Relative error of the stiffness within which it is counted as right."""
PERIODS_S = (8.8, 10.8, 12.57, 14.4, 16.3)
MEASURED = {
    "02:40": "2019-02-10T02:40",
    "05:40": "2019-02-10T05:40",
    "ordinary": "2019-02-08T12:40",
}
MODELS = {"swell": (3.0, 14.0), "short": (3.0, 8.0)}
DECIBEL = 10 / math.log(10)


@dataclass(frozen=True)
class Part:
    """One part of a record, estimated and true."""

    sea: str
    law: str
    period_s: float
    minutes: float
    #: of_sea, of_ship: verdicts.
    of_sea: str
    of_ship: str
    #: moment, height, peak: relative errors of the moment's root mean square, of Hs and of Tp.
    moment: float
    height: float
    peak: float
    #: Root mean square of the error of the moment's density where its energy is.
    spectrum_db: float
    stated: float  #: Relative deviation stated of `moment`.
    #: stiffness, period: relative errors of stiffness and roll period.
    stiffness: float
    period: float
    stiffness_deviation: float


def scenario_of(sea: str, period_s: float) -> Scenario:
    """The storm scenario with another sea and loading."""
    base = load_config(CONFIGS / "scenarios" / "storm.yaml", Scenario)
    stiffness = base.vessel.ship.inertia_kg_m2 * (2 * math.pi / period_s) ** 2
    if sea in MEASURED:
        waves: object = base.sea.model_copy(update={"time": datetime.fromisoformat(MEASURED[sea])})
    else:
        hs_m, tp_s = MODELS[sea]
        waves = JonswapSea.model_validate(
            {"kind": "jonswap", "hs_m": hs_m, "tp_s": tp_s, "effective_slope": {"coefficient": 0.5}}
        )
    return base.model_copy(
        update={
            "sea": waves,
            "actual_ship": {"stiffness_nm_rad": stiffness},
            "controllers": {"gpc": base.controllers["gpc"]},
        }
    )


def parts_of(sea: str, period_s: float, hours: int, minutes: list[float]) -> Iterator[Part]:
    """The parts of some hours, under GPC and with the passive tank."""
    scenario = scenario_of(sea, period_s)
    plant = scenario.controllers["gpc"].plant
    task = EstimateTask(plant, SAMPLE_TIME_S, 0.5)
    actual = scenario.sailing_ship
    every = round(SAMPLE_TIME_S / RECORD_S)
    for seed in range(1, hours + 1):
        for job in jobs_of(scenario, seed, 3600.0):
            rows = run_lockstep(job).rows[round(SETTLED_S / RECORD_S) :: every]
            signals = {name: rows[:, COLUMNS.index(name)] for name in COLUMNS}
            level = (signals["starboard_level_m"] - signals["port_level_m"]) / 2
            record = np.column_stack(
                [
                    signals["pressure_actual_pa"],
                    signals["roll_rad"],
                    signals["roll_rate_rad_s"],
                    level,
                ]
            )
            # with a passive tank the ship is known, under GPC it is not
            known = actual if job.name == "passive" else plant.ship
            figures = ShipFigures.of(known)
            for length in minutes:
                count = round(length * 60 / SAMPLE_TIME_S)
                for start in range(0, len(record) - count + 1, count):
                    cut = slice(start, start + count)
                    found = estimate(EstimateRequest(figures, record[cut]), task)
                    if found.ship is None or found.waves is None:
                        continue
                    truth = true_slope(
                        signals["wave_moment_nm"][cut] / found.ship.stiffness_nm_rad, found.waves
                    )
                    heights = [each.elevation_density(0.5) for each in (found.waves, truth)]
                    peaks = [2 * np.pi / truth.omega_rad_s[np.argmax(each)] for each in heights]
                    energy = truth.density / truth.density.sum()
                    error_db = DECIBEL * np.log(found.waves.density / smooth(truth).density)
                    yield Part(
                        sea,
                        job.name,
                        period_s,
                        length,
                        found.of_sea.name,
                        found.of_ship.name,
                        found.waves.rms_rad / truth.rms_rad - 1,
                        found.hs_m / truth.hs_m(0.5) - 1,
                        peaks[0] / peaks[1] - 1,
                        math.sqrt(float(energy @ error_db**2)),
                        found.rms_deviation,
                        found.ship.stiffness_nm_rad / actual.stiffness_nm_rad - 1,
                        found.ship.roll_period_s / period_s - 1,
                        found.ship.stiffness_deviation,
                    )


def true_slope(slope: FloatArray, like: SlopeSpectrum) -> SlopeSpectrum:
    """Spectrum of the moment that there was, at the estimate's frequencies."""
    tapers = max(TAPERS, round(like.band_rad_s / bandwidth_rad_s(len(slope), SAMPLE_TIME_S, 0)) - 1)
    found = coefficients(slope[:, None], SAMPLE_TIME_S, like.omega_rad_s, tapers)[0]
    return replace(like, density=np.mean(np.abs(found) ** 2, axis=0), deviation=None)


def smooth(spectrum: SlopeSpectrum) -> SlopeSpectrum:
    """The spectrum averaged over five bands: a part's own scatters by half."""
    window = np.ones(5) / 5
    return replace(spectrum, density=np.convolve(spectrum.density, window, "same"))


def errors(parts: list[Part]) -> list[dict[str, Any]]:
    """Mean error and scatter by law, length and sea; the ship's where its verdict is good."""
    rows = []
    for law, minutes, sea in sorted({(each.law, each.minutes, each.sea) for each in parts}):
        group = [p for p in parts if (p.law, p.minutes, p.sea) == (law, minutes, sea)]
        good = [each for each in group if each.of_ship == Verdict.GOOD.name]
        row: dict[str, Any] = {"law": law, "minutes": minutes, "sea": sea, "parts": len(group)}
        row["sea_good"] = sum(each.of_sea == Verdict.GOOD.name for each in group)
        row["ship_good"] = len(good)
        for name in ("moment", "stated", "height", "peak", "spectrum_db"):
            row |= _spread(name, group)
        for name in ("stiffness", "stiffness_deviation", "period"):
            row |= _spread(name, good)
        rows.append(row)
    return rows


def loadings(parts: list[Part]) -> list[dict[str, Any]]:
    """Whether stiffness, and with it GM, is told, and how well, by loading and length."""
    rows = []
    for minutes, period_s in sorted({(each.minutes, each.period_s) for each in parts}):
        group = [
            abs(each.stiffness) if each.of_ship == Verdict.GOOD.name else None
            for each in parts
            if (each.minutes, each.period_s) == (minutes, period_s) and each.law != "passive"
        ]
        told = [each for each in group if each is not None]
        rows.append(
            {
                "minutes": minutes,
                "period_s": period_s,
                "parts": len(group),
                "told": len(told),
                "within": sum(each <= CLOSE for each in told),
                "worst": max(told, default=None),
            }
        )
    return rows


def _spread(name: str, parts: list[Part]) -> dict[str, float]:
    values = [getattr(each, name) for each in parts]
    if not values:
        return {}
    return {name: float(np.mean(values)), f"{name}_scatter": float(np.std(values))}


def main(arguments: list[str] | None = None) -> int:
    """Run the study; see the module's description."""
    parser = command_line(__doc__)
    parser.add_argument("--minutes", type=float, nargs="+", default=[10.0, 20.0, 60.0])
    parser.add_argument("--hours", type=int, default=1, help="seeds of each case")
    parser.add_argument(
        "--seas", nargs="+", choices=(*MEASURED, *MODELS), default=[*MEASURED, *MODELS]
    )
    parser.add_argument("--periods", type=float, nargs="+", default=[*PERIODS_S])
    chosen = parser.parse_args(arguments)
    parts: list[Part] = []
    for sea in chosen.seas:
        for period_s in chosen.periods:
            parts += parts_of(sea, period_s, chosen.hours, chosen.minutes)
            print(f"{sea}, {period_s:g} s", file=sys.stderr)
    found = {"errors": errors(parts), "loadings": loadings(parts)}
    show(found | {"parts": [each.__dict__ for each in parts]}, chosen)
    return 0


if __name__ == "__main__":
    sys.exit(main())
