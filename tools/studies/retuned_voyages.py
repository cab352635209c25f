"""What retuning is worth: each voyage once with the law as it was, once retuned, and passive.

    python -m tools.studies.retuned_voyages configs/scenarios/load_change.yaml --seeds 1 2 3

The three are judged over the same time of the same waves: from 60 s after the (last) new law took
over, or after the refusal, to the end. In lockstep, so the same seed prints the same figures.
"""

import re
from collections.abc import Iterator, Mapping
from concurrent.futures import ProcessPoolExecutor
from dataclasses import asdict, dataclass, replace
from multiprocessing import get_context
from pathlib import Path

from firmware_sim.bench import jobs_of
from firmware_sim.lockstep_run import run_lockstep
from firmware_sim.retuning_figures import SETTLING_S
from firmware_sim.run import Job, Run
from firmware_sim.scenario import Scenario
from tools.printing import command_line, show
from tools.studies.trial_setup import designed
from utank_hil.analysis.motion.statistics import roll_statistics
from utank_hil.canbus import RetuningState
from utank_hil.configuration import ConfigError
from utank_hil.control import BuiltLaw

WORKERS = 2


@dataclass(frozen=True)
class Voyage:
    """One controller with one seed.

    Attributes
    ----------
    begun_s : float or None
        First identification; None if there was none.
    ended : str
        State that retuning ended in.
    reasons : tuple of str
        Of the last refusal, or what was found when the law was put on trial.
    period_s : float or None
        Roll period found, if a law was put on trial.
    from_s : float
        Judged from then on.
    passive_rad, as_it_was_rad, retuned_rad : float
        Roll, root mean square.
    """

    seed: int
    controller: str
    begun_s: float | None
    ended: str
    reasons: tuple[str, ...]
    period_s: float | None
    from_s: float
    passive_rad: float
    as_it_was_rad: float
    retuned_rad: float


def jobs_for(scenario: Scenario, seed: int, laws: Mapping[str, BuiltLaw]) -> list[Job]:
    """Passive; then each controller as it is configured, and without its retuning."""
    passive, *retuned = jobs_of(scenario, seed, scenario.duration_s, laws)
    jobs = [passive]
    for job in retuned:
        still = job.controller.model_copy(update={"retuning": None})
        jobs += [job, replace(job, controller=still)]
    return jobs


def voyages(seed: int, runs: list[Run], settle_s: float) -> Iterator[Voyage]:
    """Compare the runs of one seed."""
    passive, *rest = runs
    for retuned, as_it_was in zip(rest[::2], rest[1::2], strict=True):
        events = retuned.retuning
        trials = [event for event in events if event.state is RetuningState.TRIAL]
        last = (trials or events)[-1] if events else None
        from_s = settle_s if last is None else last.time_ns * 1e-9 + SETTLING_S
        reasons = next((event.reasons for event in reversed(events) if event.reasons), ())
        period = re.search(r"roll period ([\d.]+) s", trials[-1].reasons[0]) if trials else None
        rolls = [
            roll_statistics(run.column("true_roll_rad")[run.column("time_s") >= from_s]).rms_rad
            for run in (passive, as_it_was, retuned)
        ]
        yield Voyage(
            seed,
            retuned.name,
            events[0].time_ns * 1e-9 if events else None,
            events[-1].state.name if events else RetuningState.IDLE.name,
            reasons,
            None if period is None else float(period[1]),
            from_s,
            *rolls,
        )


def main() -> None:
    """Sail and print."""
    parser = command_line(__doc__)
    parser.add_argument("scenario", type=Path)
    parser.add_argument("--seeds", type=int, nargs="+", help="instead of the scenario's one")
    arguments = parser.parse_args()
    try:
        scenario, laws = designed(arguments.scenario)
    except ConfigError as error:
        parser.error(str(error))
    seeds = arguments.seeds or [scenario.seed]
    jobs = {seed: jobs_for(scenario, seed, laws) for seed in seeds}
    with ProcessPoolExecutor(WORKERS, mp_context=get_context("spawn")) as pool:
        runs = pool.map(run_lockstep, [job for seed in seeds for job in jobs[seed]])
        found: list[Voyage] = []
        for seed in seeds:
            found += voyages(seed, [next(runs) for _ in jobs[seed]], scenario.settle_s)
    show([asdict(one) for one in found], arguments)


if __name__ == "__main__":
    main()
