"""The bench: the same sea without a tank, with the passive tank, and with each controller."""

import multiprocessing
import signal
import time
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import Future, ProcessPoolExecutor
from contextlib import contextmanager
from dataclasses import dataclass
from multiprocessing.sharedctypes import Synchronized
from typing import Any, Final

from firmware_sim.assembly import PASSIVE_SCRIPT
from firmware_sim.run import (
    RECORD_S,
    Job,
    Run,
    join,
    run_controller,
    run_in_one_process,
    run_lockstep,
    run_ship,
)
from firmware_sim.scenario import PASSIVE, Scenario
from utank_hil.analysis.bare_ship import roll_without_tank
from utank_hil.arrays import FloatArray
from utank_hil.config_laws import PassiveLaw
from utank_hil.runtime import stop_on_signals

POLL_S: Final = 0.1

Progress = Callable[[str, float], None]
"""Told a run's name and the seconds of it that are done."""


@dataclass(frozen=True, slots=True, eq=False)
class BenchResult:
    """Everything a bench measured.

    Attributes
    ----------
    scenario : Scenario
    mode : str
        "lockstep", "real time" or "real time on" and the interface.
    seed : int
    duration_s, settle_s : float
        Length of each run, and what the statistics leave out at its start.
    without_tank_rad : ndarray, shape (n,)
        Roll of the bare ship in the same waves, every `RECORD_S`.
    runs : tuple of Run
        The passive tank first.
    wall_s : float
        Time all of it took.
    """

    scenario: Scenario
    mode: str
    seed: int
    duration_s: float
    settle_s: float
    without_tank_rad: FloatArray
    runs: tuple[Run, ...]
    wall_s: float


@dataclass(frozen=True, slots=True)
class BenchOptions:
    """What a caller may choose about a bench.

    Attributes
    ----------
    real_time : bool
        In real time instead of lockstep.
    channel : str, optional
        SocketCAN interface for real time; without it both sides share one process.
    seed : int, optional
        Instead of the scenario's.
    duration_s : float, optional
        Instead of the scenario's.
    """

    real_time: bool = False
    channel: str | None = None
    seed: int | None = None
    duration_s: float | None = None


class _Watch:
    """Progress and end of a run, shared with the process that shows it."""

    def __init__(self, done_s: "Synchronized[float]", stop: "Synchronized[bool]") -> None:
        self._done_s = done_s
        self._stop = stop

    def stopped(self, done_s: float) -> bool:
        self._done_s.value = done_s
        return bool(self._stop.value)


# what the processes of the pool inherit: shared values can't be sent along with a job
_watches: list[_Watch] = []


def _prepare(done_s: "list[Synchronized[float]]", stop: "Synchronized[bool]") -> None:
    # Ctrl-C reaches the whole process group; the parent alone decides what it means
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.pthread_sigmask(signal.SIG_UNBLOCK, {signal.SIGINT})
    _watches[:] = [_Watch(done, stop) for done in done_s]


@contextmanager
def _interrupts_waiting() -> Iterator[None]:
    """Let processes start with Ctrl-C held back: it must not end them while they import."""
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def _call(function: Callable[..., Any], index: int, *arguments: object) -> Any:
    return function(*arguments, _watches[index])


def jobs_of(scenario: Scenario, seed: int, duration_s: float) -> list[Job]:
    """The passive tank's run, then one for each controller."""
    first = next(iter(scenario.controllers.values()))
    passive = first.model_copy(update={"law": PassiveLaw(kind="passive")})
    return [
        Job(PASSIVE, scenario, passive, PASSIVE_SCRIPT, seed, duration_s),
        *(
            Job(name, scenario, controller, scenario.operator, seed, duration_s)
            for name, controller in scenario.controllers.items()
        ),
    ]


def run_bench(scenario: Scenario, options: BenchOptions, progress: Progress) -> BenchResult:
    """Run a scenario: passive, then with each controller, all in the same waves.

    Each run has a process of its own. Ctrl-C ends the runs between two ticks, with the pump at
    zero; what was recorded until then is returned.

    Parameters
    ----------
    scenario : Scenario
    options : BenchOptions
    progress : callable
        Called several times a second while runs go on.

    Returns
    -------
    BenchResult
        Without the runs that were ended before their first sample.

    Raises
    ------
    OSError
        If the interface can't be used, or everything was ended before the first sample.
    """
    seed = scenario.seed if options.seed is None else options.seed
    duration_s = scenario.duration_s if options.duration_s is None else options.duration_s
    jobs = jobs_of(scenario, seed, duration_s)
    started = time.monotonic()
    context = multiprocessing.get_context("spawn")
    done_s = [context.Value("d", 0.0, lock=False) for _ in jobs]
    stop = context.Value("b", False, lock=False)
    workers = 2 if options.channel is not None or not options.real_time else 1
    with (
        stop_on_signals() as stopped,
        ProcessPoolExecutor(
            workers, mp_context=context, initializer=_prepare, initargs=(done_s, stop)
        ) as pool,
    ):
        runs = list(_run_all(pool, jobs, options, done_s, stop, stopped, progress))
    if len(runs[0].rows) == 0:
        raise InterruptedError("ended before the first sample")
    runs = [run for run in runs if len(run.rows)]
    moment = scenario.wave_moment(seed)
    count = max(len(run.rows) for run in runs)
    shortest = min(len(run.rows) for run in runs)
    return BenchResult(
        scenario,
        _mode(options),
        seed,
        count * RECORD_S,
        min(scenario.settle_s, shortest * RECORD_S / 2),
        roll_without_tank(scenario.sailing_ship, moment, RECORD_S, count),
        tuple(runs),
        time.monotonic() - started,
    )


def _run_all(
    pool: ProcessPoolExecutor,
    jobs: list[Job],
    options: BenchOptions,
    done_s: "list[Synchronized[float]]",
    stop: "Synchronized[bool]",
    stopped: Callable[[], bool],
    progress: Progress,
) -> Iterable[Run]:
    def start(function: Callable[..., Any], index: int, *arguments: object) -> Future[Any]:
        with _interrupts_waiting():
            return pool.submit(_call, function, index, *arguments)

    def wait(futures: list[Future[Any]]) -> list[Any]:
        while not all(future.done() for future in futures):
            time.sleep(POLL_S)
            stop.value = stopped()
            for job, done in zip(jobs, done_s, strict=True):
                progress(job.name, done.value)
        return [future.result() for future in futures]

    if not options.real_time:
        yield from wait([start(run_lockstep, index, job) for index, job in enumerate(jobs)])
        return
    for index, job in enumerate(jobs):
        if options.channel is None:
            yield from wait([start(run_in_one_process, index, job)])
        else:
            ship, controller = wait(
                [
                    start(run_ship, index, job, options.channel),
                    start(run_controller, index, job, options.channel),
                ]
            )
            yield join(job.name, ship, controller)


def _mode(options: BenchOptions) -> str:
    if not options.real_time:
        return "lockstep"
    return "real time" if options.channel is None else f"real time on {options.channel}"
