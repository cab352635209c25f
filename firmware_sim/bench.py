"""The bench: the same sea without a tank, with the passive tank, and with each controller."""

import math
import multiprocessing
import os
import pickle
import time
from collections.abc import Callable, Iterable, Mapping
from concurrent.futures import Future
from concurrent.futures.process import BrokenProcessPool
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Final

from firmware_sim.run import (
    RECORD_S,
    Board,
    Job,
    Run,
    Watch,
    join,
    roll_without_tank,
    run_controller,
    run_in_one_process,
    run_lockstep,
    run_ship,
)
from firmware_sim.scenario import Scenario
from firmware_sim.scenario_content import PASSIVE
from firmware_sim.ship_side import passive_script
from firmware_sim.worker_pool import WorkerPool, shared, whole_first
from utank_hil.assembly import build_law
from utank_hil.base.arrays import FloatArray
from utank_hil.base.parameters import ParameterError
from utank_hil.configuration import ControllerConfig
from utank_hil.control import BuiltLaw, PassiveDesign
from utank_hil.runners import stop_on_signals
from utank_hil.telemetry.frame_log import SUFFIX

LOCKSTEP: Final = "lockstep"
POLL_S: Final = 0.1
"""Interval of the progress display and the check for Ctrl-C in s; no deadline depends on it."""
BEGIN_AFTER_NS: Final = 200_000_000
"""Time in ns from both sides being ready to their common first tick: 20 polls of each side."""

LEAST_REACH: Final = 0.5
"""Least share of the longest run that a run must reach to shorten the window compared."""
LEAST_ROWS: Final = 0.9  #: Least share of its rows in the window with which a run is compared.

Progress = Callable[[str, float], None]
"""Callback that takes the name of a run and its simulated or elapsed time in s."""


@dataclass(frozen=True, slots=True, eq=False)
class BenchResult:
    """Results of a bench; all runs are compared over one window of ship's time."""

    scenario: Scenario
    mode: str  #: "lockstep", "real time", or "real time on" and the interface.
    seed: int
    duration_s: float
    #: settle_s, end_s: window: its start, and the end of the shortest run that reached
    #: `LEAST_REACH` of the longest.
    settle_s: float
    end_s: float
    #: shape (n,): roll of the bare ship in the same waves, every `RECORD_S` up to `end_s`.
    without_tank_rad: FloatArray
    runs: tuple[Run, ...]  #: Runs with at least one row; the passive tank first.
    not_run: tuple[str, ...]  #: Names of the runs without a row.
    interrupted: bool
    wall_s: float
    #: Time at which the bare ship capsized; infinite if it did not.
    without_tank_capsized_s: float = math.inf
    killed: bool = False

    @property
    def expected_rows(self) -> int:
        """Number of rows of a complete run in the window."""
        return max(1, round((self.end_s - self.settle_s) / RECORD_S))

    def rows_compared(self, run: Run) -> int:
        """Number of rows of a run in the window."""
        return int(run.between(self.settle_s, self.end_s).sum())

    def compares(self, run: Run) -> bool:
        """Whether a run has enough rows in the window to be compared."""
        return self.rows_compared(run) >= LEAST_ROWS * self.expected_rows


@dataclass(frozen=True, slots=True)
class BenchOptions:
    """Options of a bench; `seed` and `duration_s` replace the scenario's values."""

    real_time: bool = False
    #: SocketCAN interface for real time; without it both sides share one process.
    channel: str | None = None
    seed: int | None = None
    duration_s: float | None = None
    frames: Path | None = None  #: Folder for a frame log of each run in simulated time.


def _call(function: Callable[..., Any], index: int, *arguments: object) -> Any:
    return function(*arguments, Watch(shared(), index))


def jobs_of(
    scenario: Scenario, seed: int, duration_s: float, laws: Mapping[str, BuiltLaw] | None = None
) -> list[Job]:
    """Return the job of the passive tank, then one for each controller."""
    laws = laws or {name: build_law(each) for name, each in scenario.controllers.items()}
    first = next(iter(scenario.controllers.values()), None)
    if first is None:
        content = {"name": PASSIVE, "vessel": scenario.vessel, "law": {"kind": "passive"}}
        passive = ControllerConfig.model_validate(content)
    else:
        passive = first.model_copy(
            update={"law": PassiveDesign(), "retuning": None, "sea_estimate": None}
        )
    script = passive_script(scenario.vessel)
    return [
        Job(PASSIVE, scenario, passive, build_law(passive), script, seed, duration_s),
        *(
            Job(name, scenario, controller, laws[name], scenario.operator, seed, duration_s)
            for name, controller in scenario.controllers.items()
        ),
    ]


def run_bench(
    scenario: Scenario,
    options: BenchOptions,
    progress: Progress,
    laws: Mapping[str, BuiltLaw] | None = None,
) -> BenchResult:
    """Run a scenario with the passive tank, then with each controller, in the same waves.

    Each run has its own process. Ctrl-C ends the runs between two ticks, with the pump at zero; the
    rows recorded until then are returned. `progress` is called several times a second; laws that
    are not given are designed. Raises `ParameterError` for a law that its process cannot be given,
    a lambda for example. Raises `OSError` if the interface cannot be used, or everything was
    ended before the first sample. Raises `BrokenProcessPool` if a process was killed before the
    passive run had ended.
    """
    seed = scenario.seed if options.seed is None else options.seed
    duration_s = scenario.duration_s if options.duration_s is None else options.duration_s
    jobs = jobs_of(scenario, seed, duration_s, laws)
    if options.frames is not None:
        jobs = [replace(job, frames=options.frames / frames_name(job.name)) for job in jobs]
    for job in jobs:
        try:
            pickle.dumps(job)
        except (pickle.PicklingError, AttributeError, TypeError) as error:
            why = (
                f"can't be given to the process of its run ({error}): "
                "it may hold functions of a module, but no lambda and no open file"
            )
            raise ParameterError("", [(f"controllers.{job.name}.law", why)]) from error
    started = time.monotonic()
    workers = 1 if options.channel is None else 2
    if not options.real_time:
        workers = len(os.sched_getaffinity(0))
    with stop_on_signals() as stopped:
        board = Board(multiprocessing.get_context("spawn"), len(jobs))
        runs: list[Run] = []
        killed = False
        try:
            with WorkerPool(workers, board) as pool:
                for run in _run_all(pool, jobs, options, board, stopped, progress):
                    runs.append(run)  # noqa: PERF402, those before an error are kept
        except BrokenProcessPool:
            if not runs or runs[0].name != PASSIVE:
                raise
            killed = True
        interrupted = stopped()
    if not runs or len(runs[0].rows) == 0:
        raise InterruptedError("ended before the first sample")
    mode = "real time" if options.real_time else LOCKSTEP
    mode += f" on {options.channel}" if options.channel is not None else ""
    return replace(_result(jobs, runs, mode, interrupted, started), killed=killed)


def run_in_turn(
    scenario: Scenario, seed: int, laws: Mapping[str, BuiltLaw] | None = None
) -> BenchResult:
    """Do what `run_bench` does in lockstep and in this process, one run after the other."""
    started = time.monotonic()
    jobs = jobs_of(scenario, seed, scenario.duration_s, laws)
    return _result(jobs, [run_lockstep(job) for job in jobs], LOCKSTEP, False, started)


def _result(
    jobs: list[Job], runs: list[Run], mode: str, interrupted: bool, started: float
) -> BenchResult:
    scenario, seed = jobs[0].scenario, jobs[0].seed
    done = tuple(run for run in runs if len(run.rows))
    settle_s, end_s = window_s(done, scenario.settle_s)
    bare_rad, bare_capsized_s = roll_without_tank(scenario, seed, round(end_s / RECORD_S))
    return BenchResult(
        scenario,
        mode,
        seed,
        jobs[0].duration_s,
        settle_s,
        end_s,
        bare_rad,
        done,
        tuple(job.name for job in jobs if job.name not in {run.name for run in done}),
        interrupted,
        time.monotonic() - started,
        bare_capsized_s,
    )


def frames_name(run: str) -> str:
    """File name of the frame log of a run."""
    return f"{run}{SUFFIX}"


def window_s(runs: tuple[Run, ...], settle_s: float) -> tuple[float, float]:
    """Start and end of the window compared, in ship's time on the grid of the rows.

    The window ends with the shortest run that reached `LEAST_REACH` of the longest. It covers at
    least half of the rows, however few there are.
    """
    longest_s = max(run.end_s for run in runs)
    end_s = min(run.end_s for run in runs if run.end_s >= LEAST_REACH * longest_s)
    start_s = min(settle_s, end_s / 2)
    return RECORD_S * round(start_s / RECORD_S), RECORD_S * round(end_s / RECORD_S)


def _run_all(
    pool: WorkerPool,
    jobs: list[Job],
    options: BenchOptions,
    board: Board,
    stopped: Callable[[], bool],
    progress: Progress,
) -> Iterable[Run]:
    def start(function: Callable[..., Any], index: int, *arguments: object) -> Future[Any]:
        return pool.submit(_call, function, index, *arguments)

    def wait(futures: list[Future[Any]]) -> Iterable[Any]:
        while not all(future.done() for future in futures):
            time.sleep(POLL_S)
            # when one side has failed, the other must not wait for it
            failed = any(future.done() and future.exception() for future in futures)
            board.stop.value = stopped() or failed
            if board.ready.value == len(futures) and not board.begin_ns.value:
                board.begin_ns.value = time.monotonic_ns() + BEGIN_AFTER_NS
            for job, done in zip(jobs, board.done_s, strict=True):
                progress(job.name, done.value)
        return whole_first(futures)

    if not options.real_time:
        yield from wait([start(run_lockstep, index, job) for index, job in enumerate(jobs)])
        return
    for index, job in enumerate(jobs):
        if stopped():
            return
        if options.channel is None:
            yield from wait([start(run_in_one_process, index, job)])
        else:
            board.ready.value = board.begin_ns.value = 0
            ship, controller = wait(
                [
                    start(run_ship, index, job, options.channel),
                    start(run_controller, index, job, options.channel),
                ]
            )
            yield join(job.name, ship, controller)
