"""A self-tuned law that is renewed under way, beside laws that were told what she meets.

    python -m tools.studies.renewed_voyage --json     # --seeds

One voyage on the bench's full plant, in lockstep: an hour of 3 m, into the storm and out of it, and
in the storm the load changes and changes back. The renewed law starts knowing nothing; it estimates
every three minutes. The others were designed for one sea and one loading each. Shares are of the
clairvoyant bound for the passive ship's own record, from 20 minutes after each change on.
"""

import math
import sys
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from datetime import datetime
from multiprocessing import get_context
from typing import Any, Final

import numpy as np

from firmware_sim.bench import jobs_of
from firmware_sim.lockstep_run import run_lockstep
from firmware_sim.run import RECORD_S, Job, Run
from firmware_sim.scenario import PASSIVE, Scenario
from firmware_sim.voyage import Waypoint
from tools.printing import command_line, show
from tools.studies.clairvoyant import clairvoyant_bound
from tools.studies.trial_setup import CONFIGS, measured_hour, shipped
from utank_hil.analysis.loop.self_tuning import SelfTunedDesign, sample_time_of, self_tuned
from utank_hil.analysis.motion.confidence import mean_interval
from utank_hil.base.arrays import FloatArray
from utank_hil.configuration import ControllerConfig, load_config
from utank_hil.control import BuiltLaw, DesignPlant
from utank_hil.retuning import EstimateSettings

WORKERS: Final = 2
SLOWER_S: Final = 14.4
RENEWED: Final = "renewed"
MILD, STORM = "02:40", "05:40"
CHANGES_S: Final = (1800.0, 3900.0, 5700.0, 7500.0)
PASSAGE_S: Final = 180.0
END_S: Final = 9480.0
LATER_S: Final = 1200.0
"""From a change to the time that is judged."""
STEP_S: Final = 0.2

STAGES: Final = {
    "3 m": (0.0, CHANGES_S[0], MILD, False),
    "storm": (CHANGES_S[0] + PASSAGE_S, CHANGES_S[1], STORM, False),
    "storm, slower ship": (CHANGES_S[1] + PASSAGE_S, CHANGES_S[2], STORM, True),
    "storm, as before": (CHANGES_S[2] + PASSAGE_S, CHANGES_S[3], STORM, False),
    "3 m again": (CHANGES_S[3] + PASSAGE_S, END_S, MILD, False),
}
"""Begin, end, sea, and whether she is slower."""


def told(config: ControllerConfig, time: str, stiffness_nm_rad: float | None = None) -> BuiltLaw:
    """The self-tuned law that knows an hour's sea and the ship's stiffness."""
    law = config.law
    assert isinstance(law, SelfTunedDesign)
    assert law.sea is not None
    spectrum = measured_hour(f"2019-02-10T{time}")
    sea = replace(
        law.sea,
        frequency_hz=tuple(spectrum.frequency_hz.tolist()),
        density_m2_hz=tuple(spectrum.density.tolist()),
    )
    plant = config.plant
    step_s = sample_time_of(plant)
    if stiffness_nm_rad is not None:
        plant = replace(plant, ship=replace(plant.ship, stiffness_nm_rad=stiffness_nm_rad))
    found = self_tuned(plant, sea, sample_time_s=step_s)
    return BuiltLaw(found.law.controller, found.design.measured, found.law)


def hour(time: str) -> Any:
    """An hour of the storm day as a scenario names it."""
    base = load_config(CONFIGS / "scenarios" / "storm.yaml", Scenario).sea
    return base.model_copy(update={"time": datetime.fromisoformat(f"2019-02-10T{time}")})


def jobs(seed: int) -> list[Job]:
    """Passive, renewed, and the laws that were told."""
    base = load_config(CONFIGS / "scenarios" / "storm.yaml", Scenario)
    renewing, knowing = shipped("self_tuning"), shipped("self_tuned")
    renewing = renewing.model_copy(update={"sea_estimate": EstimateSettings(renew=True)})
    slower = base.vessel.ship.inertia_kg_m2 * (2 * math.pi / SLOWER_S) ** 2
    loads = ({"stiffness_nm_rad": slower}, {"stiffness_nm_rad": base.vessel.ship.stiffness_nm_rad})
    rising, loading, unloading, falling = CHANGES_S
    mild, storm = hour(MILD), hour(STORM)
    voyage = tuple(
        Waypoint.model_construct(time_s=time_s, heading_deg=None, course_deg=None,
                                 speed_m_s=None, sea=sea, ship=ship)
        for time_s, sea, ship in (
            (rising, None, {}),
            (rising + PASSAGE_S, storm, {}),
            (loading, None, {}),
            (loading + PASSAGE_S, None, loads[0]),
            (unloading, None, {}),
            (unloading + PASSAGE_S, None, loads[1]),
            (falling, None, {}),
            (falling + PASSAGE_S, mild, {}),
        )
    )  # fmt: skip
    laws = {
        told_name(MILD, slower=False): told(knowing, MILD),
        told_name(STORM, slower=False): told(knowing, STORM),
        told_name(STORM, slower=True): told(knowing, STORM, slower),
    }
    scenario = base.model_copy(
        update={
            "sea": mild,
            "voyage": voyage,
            "duration_s": END_S,
            "controllers": {RENEWED: renewing} | dict.fromkeys(laws, knowing),
        }
    )
    first = renewing.law.build(renewing.plant)
    return jobs_of(scenario, seed, END_S, {RENEWED: first} | laws)


def told_name(sea: str, *, slower: bool) -> str:
    """Name of the law that was told a stage."""
    return f"told {sea}" + (", slower" if slower else "")


def motion_between(run: Run, begin_s: float, end_s: float) -> FloatArray:
    """Roll, rate, level and rate of a run, every `STEP_S`."""
    inside = run.between(begin_s, end_s)
    every = round(STEP_S / RECORD_S)
    columns = []
    for name in ("true_roll_rad", "true_level_m"):
        values = run.column(name)[inside]
        columns += [values[::every], np.gradient(values, RECORD_S)[::every]]
    return np.column_stack(columns)


def judge(runs: dict[str, Run], plant: DesignPlant) -> list[dict[str, Any]]:
    """The renewed law beside the one that was told, stage by stage."""
    found = []
    for stage, (begin_s, end_s, sea, slower) in STAGES.items():
        begin_s += LATER_S
        ship = plant.ship
        if slower:
            stiffness = ship.inertia_kg_m2 * (2 * math.pi / SLOWER_S) ** 2
            ship = replace(ship, stiffness_nm_rad=stiffness)
        waves = motion_between(runs[PASSIVE], begin_s, end_s)
        bound = clairvoyant_bound(replace(plant, ship=ship), waves).roll_rms_rad
        rolls = {
            name: float(np.sqrt(np.mean(motion_between(runs[each], begin_s, end_s)[:, 0] ** 2)))
            for name, each in (
                ("passive", PASSIVE),
                ("renewed", RENEWED),
                ("told", told_name(sea, slower=slower)),
            )
        }
        passive = rolls["passive"]
        found.append(
            {
                "stage": stage,
                "from_s": begin_s,
                "to_s": end_s,
                "bound_deg": math.degrees(bound),
                **{f"{name}_deg": math.degrees(roll) for name, roll in rolls.items()},
                "renewed_share": (passive - rolls["renewed"]) / (passive - bound),
                "told_share": (passive - rolls["told"]) / (passive - bound),
            }
        )
    return found


def mean_of(rows: Sequence[dict[str, Any]]) -> dict[str, Any]:
    """One stage over the seeds, and how far the renewed law's share is below the other's."""
    numbers = [name for name in rows[0] if name != "stage"]
    lost = np.array([row["told_share"] - row["renewed_share"] for row in rows])
    return {
        "stage": rows[0]["stage"],
        **{name: float(np.mean([row[name] for row in rows])) for name in numbers},
        "lost_share": mean_interval(lost)._asdict(),
    }


def main() -> None:
    """Sail and print."""
    parser = command_line(__doc__)
    parser.add_argument("--seeds", type=int, default=3, help="2 or more (%(default)s)")
    arguments = parser.parse_args()
    if arguments.seeds < 2:
        parser.error("--seeds must be 2 or more: one value has no confidence interval")
    plant = shipped("self_tuned").plant
    voyages, events = [], []
    with ProcessPoolExecutor(WORKERS, mp_context=get_context("spawn")) as pool:
        for seed in range(1, 1 + arguments.seeds):
            runs = {run.name: run for run in pool.map(run_lockstep, jobs(seed))}
            voyages.append(judge(runs, plant))
            events.append([event.as_json() for event in runs[RENEWED].retuning])
            sys.stderr.write(f"voyage {seed} of {arguments.seeds}\n")
    stages = [mean_of(rows) for rows in zip(*voyages, strict=True)]
    show({"stages": stages, "voyages": voyages, "events": events}, arguments)


if __name__ == "__main__":
    main()
