"""Runner of a campaign in lockstep on all cores."""

import multiprocessing
import os
import time
from collections import defaultdict
from collections.abc import Callable, Sequence
from concurrent.futures import Future
from concurrent.futures.process import BrokenProcessPool
from contextlib import suppress
from typing import Final

from firmware_sim.fault_campaign.campaign import Campaign, Row
from firmware_sim.fault_campaign.trial import Outcome, Sea, Window
from firmware_sim.worker_pool import WorkerPool, shared, whole_first
from utank_hil.assembly import build_law
from utank_hil.control import BuiltLaw

POLL_S: Final = 0.1  #: Interval in s of the progress display and the check for an early end.
ROWS_A_TASK: Final = 30
"""Most rows that share one ship under way: few enough for the cores to end together."""

_laws: dict[str, BuiltLaw] = {}


def _do(setup_name: str, seed: int, rows: list[Row], first: bool) -> list[Outcome]:
    """Run rows of one setup in one sea, in a process of the pool."""
    campaign, window, recorded, done, stop = shared()
    setup = campaign.setups[setup_name]
    if setup_name not in _laws:
        _laws[setup_name] = build_law(setup.config)
    sea = Sea(
        campaign, setup, _laws[setup_name], seed, window,
        recorded=recorded and first, patient=first,
        stopped=lambda: bool(stop.value),
    )  # fmt: skip
    outcomes = []
    with suppress(InterruptedError):
        sea.prepare(rows)
        for row in rows:
            try:
                outcomes.append(sea.outcome(row))
            except BrokenProcessPool:  # too little memory is no fault of the row
                raise
            except RuntimeError as error:
                outcomes.append(Outcome(row.id, seed, error=str(error).strip().splitlines()[-1]))
            with done.get_lock():
                done.value += 1
    return outcomes


def run_rows(
    campaign: Campaign,
    rows: Sequence[Row],
    seeds: Sequence[int],
    window: Window,
    progress: Callable[[int], None],
    stopped: Callable[[], bool],
    *,
    recorded: bool = False,
) -> dict[str, list[Outcome]]:
    """Run rows in the seas of some seeds.

    `progress` takes the number of completed trials; `stopped` says whether to end early;
    `recorded`, whether the outcomes of the first seed have
    recordings. There is a process for each core. The outcomes of a row are in the order of the
    seeds, and incomplete after an early end or a killed process.
    """
    context = multiprocessing.get_context("spawn")
    done, stop = context.Value("i", 0), context.Value("b", 0, lock=False)
    by_setup: dict[str, list[Row]] = defaultdict(list)
    for row in rows:
        by_setup[row.fault.setup].append(row)
    futures: list[Future[list[Outcome]]] = []
    found: dict[str, list[Outcome]] = {row.id: [] for row in rows}
    common = campaign, window, recorded, done, stop
    with suppress(BrokenProcessPool), WorkerPool(len(os.sched_getaffinity(0)), common) as pool:
        for seed in seeds:
            for setup, its in by_setup.items():
                tasks = -(-len(its) // ROWS_A_TASK)
                for n in range(tasks):
                    work = setup, seed, its[n::tasks], seed == seeds[0]
                    futures.append(pool.submit(_do, *work))
        while not all(future.done() for future in futures):
            time.sleep(POLL_S)
            done_so_far = (each for each in futures if each.done() and not each.cancelled())
            stop.value = stopped() or any(each.exception() for each in done_so_far)
            for future in futures if stop.value else ():
                future.cancel()  # a task that has begun still builds its setup first
            progress(done.value)
        ended = (future for future in futures if not future.cancelled())
        for outcomes in whole_first(ended):
            for outcome in outcomes:
                found[outcome.row].append(outcome)
    for outcomes in found.values():
        outcomes.sort(key=lambda outcome: seeds.index(outcome.seed))
    return found
