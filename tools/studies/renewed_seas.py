"""Many seas on the bench's full plant: the law that starts knowing nothing, 20 minutes on.

    python -m tools.studies.renewed_seas --json     # --seeds, --only "6.5 s", --workers

Sixteen seas of ordinary weather, storm and formulas, and more: swell from afar, two systems at
once, short and steep seas. Each comes from abeam, on bus, plant and sensors of the bench, in
lockstep. The renewed law knows neither sea nor ship's condition at first; it is designed anew for
what it estimates. Shares are of the clairvoyant bound for the passive ship's own motion; roll,
share and the power that the shaft draws are of the time from 20 to 40 minutes.
"""

import math
import sys
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from typing import Any, Final

import numpy as np
from pydantic import ConfigDict

from firmware_sim.bench import jobs_of
from firmware_sim.run import RECORD_S, Job, Run, run_lockstep
from firmware_sim.scenario import Scenario
from firmware_sim.scenario_content import PASSIVE
from firmware_sim.scenario_sea import IrregularSea
from tools.printing import command_line, show
from tools.studies.clairvoyant import clairvoyant_bound
from tools.studies.share_of_possible import CONFIGS, STORM_HOUR, measured_hour, shipped
from utank_hil.analysis.motion.statistics import mean_interval
from utank_hil.base.arrays import FloatArray
from utank_hil.base.background import one_thread_each
from utank_hil.canbus.enumerations import Mode, RetuningState
from utank_hil.configuration import load_config
from utank_hil.sea import Spectrum, jonswap

LAWS: Final = {"GPC, roll": "gpc", "constrained": "constrained_gpc", "renewed": "self_tuning"}
"""Of configs/controllers."""
FROM_S: Final = 1200.0
TO_S: Final = 2400.0
STEP_S: Final = 0.2  #: Of the motion that the bound is computed for.
HOURS: Final = (
    *("06T08", "06T20", "07T08", "07T20", "08T08", "09T04", "09T12", "09T19"),
)  # of February 2019, significant heights of 0.65 to 1.4 m
SIXTEEN: Final = 16


def both(first: Spectrum, second: Spectrum) -> Spectrum:
    """Two systems at once."""
    frequency_hz = np.arange(0.03, 0.6, 0.0025)
    density = sum(
        np.interp(frequency_hz, each.frequency_hz, each.density, left=0.0, right=0.0)
        for each in (first, second)
    )
    return Spectrum(frequency_hz, density)


def seas() -> dict[str, Spectrum]:
    """The sixteen, then the others."""
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


class GivenSea(IrregularSea):
    """A sea of any spectrum."""

    model_config = ConfigDict(arbitrary_types_allowed=True)
    given: Spectrum

    def spectrum(self) -> Spectrum:
        """The one that was given."""
        return self.given


def jobs(spectrum: Spectrum, seed: int) -> list[Job]:
    """The passive tank, and the laws."""
    storm = load_config(CONFIGS / "scenarios" / "storm.yaml", Scenario)
    sea = GivenSea(given=spectrum, effective_slope=storm.sea.effective_slope)
    laws = {name: shipped(file) for name, file in LAWS.items()}
    scenario = storm.model_copy(update={"sea": sea, "duration_s": TO_S, "controllers": laws})
    return jobs_of(scenario, seed, TO_S)


def judged(case: tuple[str, Spectrum, int]) -> tuple[str, dict[str, Any]]:
    """One realisation: each law's roll, share, power and how long it was in charge."""
    name, spectrum, seed = case
    runs = {job.name: run_lockstep(job) for job in jobs(spectrum, seed)}
    plant = shipped("self_tuned").plant
    bound = clairvoyant_bound(plant, motion_between(runs[PASSIVE], FROM_S, TO_S)).roll_rms_rad
    rolls = {each: _rms(run, "true_roll_rad") for each, run in runs.items()}
    passive = rolls[PASSIVE]
    return name, {
        "passive_deg": math.degrees(passive),
        "bound_deg": math.degrees(bound),
        **{
            law: {
                "below_passive": 1 - rolls[law] / passive,
                "share": (passive - rolls[law]) / (passive - bound),
                "power_w": float(np.mean(np.maximum(_window(runs[law], "true_shaft_power_w"), 0))),
                "active": float(np.mean(_window(runs[law], "mode") == Mode.ACTIVE)),
                "renewals": sum(
                    event.state is RetuningState.RETUNED for event in runs[law].retuning
                ),
            }
            for law in LAWS
        },
    }


def motion_between(run: Run, begin_s: float, end_s: float) -> FloatArray:
    """Roll, rate, level and rate of a run, every `STEP_S`."""
    inside = run.between(begin_s, end_s)
    every = round(STEP_S / RECORD_S)
    columns = []
    for name in ("true_roll_rad", "true_level_m"):
        values = run.column(name)[inside]
        columns += [values[::every], np.gradient(values, RECORD_S)[::every]]
    return np.column_stack(columns)


def _window(run: Run, column: str) -> Any:
    return run.column(column)[run.between(FROM_S, TO_S)]


def _rms(run: Run, column: str) -> float:
    return float(np.sqrt(np.mean(_window(run, column) ** 2)))


def interval(values: Sequence[float]) -> dict[str, float]:
    """Mean and 95 % interval."""
    return mean_interval(np.array(values))._asdict()


def summary(runs: Sequence[dict[str, Any]]) -> dict[str, Any]:
    """The realisations of one sea."""
    return {
        "passive_deg": float(np.mean([run["passive_deg"] for run in runs])),
        "bound_deg": float(np.mean([run["bound_deg"] for run in runs])),
        **{
            law: {key: interval([run[law][key] for run in runs]) for key in runs[0][law]}
            for law in LAWS
        },
    }


def main() -> None:
    """Sail and print."""
    parser = command_line(__doc__)
    parser.add_argument("--seeds", type=int, default=3, help="2 or more (%(default)s)")
    parser.add_argument("--only", default="", help="run the seas whose names hold this text")
    parser.add_argument("--workers", type=int, default=2, help="processes (%(default)s)")
    arguments = parser.parse_args()
    if arguments.seeds < 2:
        parser.error("--seeds must be 2 or more: one value has no confidence interval")
    wanted = {name: sea for name, sea in seas().items() if arguments.only in name}
    if not wanted:
        parser.error(f"--only {arguments.only!r}: no sea's name; there are {'; '.join(seas())}")
    cases = [
        (name, spectrum, seed)
        for name, spectrum in wanted.items()
        for seed in range(1, 1 + arguments.seeds)
    ]
    runs: dict[str, list[dict[str, Any]]] = {name: [] for name in wanted}
    spawn = get_context("spawn")
    with one_thread_each(), ProcessPoolExecutor(arguments.workers, mp_context=spawn) as pool:
        for name, run in pool.map(judged, cases):
            runs[name].append(run)
            sys.stderr.write(f"{name}: {run['renewed']['share']:.0%} of the possible\n")
    found: dict[str, Any] = {"seas": {name: summary(each) for name, each in runs.items()}}
    sixteen = list(runs.values())[:SIXTEEN]
    if len(sixteen) == SIXTEEN:
        found["mean of the first sixteen"] = {
            law: {
                key: interval(
                    [np.mean([sea[k][law][key] for sea in sixteen]) for k in range(arguments.seeds)]
                )
                for key in ("share", "below_passive", "power_w")
            }
            for law in LAWS
        }
    show(found, arguments)


if __name__ == "__main__":
    main()
