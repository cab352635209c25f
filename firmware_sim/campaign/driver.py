"""Driver of a campaign: computes the missing cases of a study, and stores their rows."""

import time
from collections import deque
from collections.abc import Callable, Iterable
from concurrent.futures import FIRST_COMPLETED, Executor, Future, wait
from concurrent.futures.process import BrokenProcessPool
from contextlib import suppress
from dataclasses import dataclass, field
from typing import Final

from firmware_sim.campaign.simulations import FAILED, LOST, Batch, Row, failed_row, run_batch
from firmware_sim.campaign.stopping import Stopping
from firmware_sim.campaign.store import Store
from firmware_sim.campaign.study import Case, LoadedStudy, Scalar, as_text, code_digest
from firmware_sim.worker_pool import WorkerPool
from utank_hil.base.background import one_thread_each

BATCH_S: Final = 0.5
"""Work per batch in s: large beside the 10 ms of sending it, small enough to lose."""
MOST_TOGETHER: Final = 200  #: Most cases in a batch. Chosen; no study.
AHEAD: Final = 2  #: Number of batches queued or running at each worker.
FLUSH_S: Final = 1.0  #: Longest delay in s between the return of rows and their writing to disk.

CONNECT_S: Final = 10.0  #: Time in s allowed for the scheduler to answer. Chosen; no study.
KILLED: Final = "each process that computed it was killed: too little memory?"

Work = Callable[[Batch], list[Row]]


@dataclass(slots=True)
class Count:
    """Progress of a campaign."""

    needed: int
    #: done, failed, lost: number of cases computed, failed, and ended from outside.
    done: int = 0
    failed: int = 0
    lost: int = 0
    case_s: float = 0.0

    def add(self, rows: Iterable[Row]) -> None:
        """Count the cases in some rows."""
        for row in {row["case"]: row for row in rows}.values():
            self.done += 1
            self.failed += row["status"] == FAILED
            self.lost += row["status"] == LOST
            self.case_s += (float(row["wall_s"]) - self.case_s) / self.done


Progress = Callable[[Count], None]


@dataclass(slots=True)
class Driver:
    """Sender of the missing cases of a study to processes of this machine or of a cluster."""

    loaded: LoadedStudy
    store: Store
    progress: Progress
    work: Work = run_batch
    count: Count = field(init=False)
    _stopping: Stopping = field(init=False)
    _waiting: deque[Case] = field(init=False)
    #: Batches that were under way when a process was killed.
    _suspected: deque[list[Case]] = field(init=False, default_factory=deque)
    _unwritten: list[Row] = field(init=False, default_factory=list)
    _written_s: float = field(init=False, default=0.0)

    def __post_init__(self) -> None:
        done = self.store.done()
        # a study may contain the same case twice
        missing = {case.name: case for case in self.loaded.cases if case.name not in done}
        groups: dict[tuple[Scalar, ...], list[str]] = {}
        for case in self.loaded.cases:
            groups.setdefault(case.group, []).append(case.name)
        self._stopping = Stopping(self.loaded.study.stop, groups)
        self._stopping.add(row for row in self.store.rows().to_pylist() if row["case"] in done)
        self._waiting = deque(case for case in missing.values() if self._stopping.needs(case.name))
        self.count = Count(len(self._waiting))

    def run(self, workers: int, scheduler: str | None = None) -> None:
        """Compute the missing cases, in processes of this machine or of a Dask `scheduler`.

        Raises `OtherCodeError` if the code is another one there, or has changed meanwhile, and
        `OSError` if the scheduler does not answer.
        """
        self._written_s = time.monotonic()
        try:
            if scheduler is not None:
                self._run_on(scheduler)
            while self._waiting or self._suspected:
                with (
                    suppress(BrokenProcessPool),  # a killed process ends its pool
                    one_thread_each(),
                    WorkerPool(workers, None) as pool,
                ):
                    while self._suspected:  # one at a time: that shows which kills its process
                        self._compute_alone(pool, self._suspected.popleft())
                    self._compute(pool, AHEAD * workers)
        finally:
            self._write()
        self.store.gather()

    def _run_on(self, scheduler: str) -> None:
        from distributed import Client, KilledWorker

        with Client(scheduler, timeout=CONNECT_S) as client:
            workers = len(client.scheduler_info(n_workers=-1)["workers"])
            # Dask has tried a batch that kills its worker on several
            self._compute(client.get_executor(pure=False), AHEAD * max(1, workers), KilledWorker)

    def _compute(self, pool: Executor, most: int, *killed: type[Exception]) -> None:
        sent: dict[Future[list[Row]], list[Case]] = {}
        try:
            while True:
                while len(sent) < most and (cases := self._next()):
                    sent[self._submit(pool, cases)] = cases
                if not sent:
                    return
                for future in wait(sent, return_when=FIRST_COMPLETED).done:
                    try:
                        self._take(future.result())
                    except killed:
                        self._lose(sent[future])
                    del sent[future]
        except BrokenProcessPool:
            self._suspected += sent.values()
            raise

    def _compute_alone(self, pool: WorkerPool, cases: list[Case]) -> None:
        try:
            self._take(pool.submit(self.work, batch_of(self.loaded, cases)).result())
        except BrokenProcessPool:
            self._lose(cases)
            raise

    def _lose(self, cases: list[Case]) -> None:
        self._take([failed_row(case.name, LOST, KILLED) for case in cases])

    def _submit(self, pool: Executor, cases: list[Case]) -> Future[list[Row]]:
        try:
            return pool.submit(self.work, batch_of(self.loaded, cases))
        except BrokenProcessPool:
            self._waiting.extendleft(reversed(cases))
            raise

    def _next(self) -> list[Case]:
        """The next cases, about `BATCH_S` of work."""
        size = 1
        if self.count.done:
            size = round(BATCH_S / max(self.count.case_s, BATCH_S / MOST_TOGETHER))
        taken: list[Case] = []
        while self._waiting and len(taken) < max(size, 1):
            case = self._waiting.popleft()
            if self._stopping.needs(case.name):
                taken.append(case)
            else:
                self.count.needed -= 1
        return taken

    def _take(self, rows: list[Row]) -> None:
        self._unwritten += rows
        self._stopping.add(rows)
        self.count.add(rows)
        if time.monotonic() - self._written_s > FLUSH_S:
            self._write()
        self.progress(self.count)

    def _write(self) -> None:
        self.store.write(self._unwritten)
        self._unwritten = []
        self._written_s = time.monotonic()


def batch_of(loaded: LoadedStudy, cases: Iterable[Case]) -> Batch:
    """Batch of cases, ready to be sent."""
    study = loaded.study
    return Batch(
        study.simulation,
        as_text(study.scenario),
        code_digest(),
        loaded.allow_code,
        tuple((case.name, case.seed, as_text(case.values)) for case in cases),
    )
