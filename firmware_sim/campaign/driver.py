"""Driver of a campaign: runs the missing cases of a study and stores their rows as they come.

The workers are one process per core of this machine, or an existing cluster.
"""

import logging
import os
import time
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from multiprocessing import resource_tracker
from queue import Empty, SimpleQueue
from typing import Final

import dask
from distributed import Client, Future, KilledWorker, LocalCluster, Status

from firmware_sim.campaign.case_name import as_text, code_digest
from firmware_sim.campaign.simulations import Row
from firmware_sim.campaign.stopping import Stopping
from firmware_sim.campaign.store import Store
from firmware_sim.campaign.study import Case, LoadedStudy
from firmware_sim.campaign.work import FAILED, LOST, Batch, failed_row, run_batch
from utank_hil.base.background import one_thread_each
from utank_hil.runners.stopping import signals_waiting

BATCH_S: Final = 0.5
"""Work per batch in s: large beside the 10 ms of sending it, small enough to lose."""
MOST_TOGETHER: Final = 200  #: Most cases in a batch. Chosen; no study.
AHEAD: Final = 2  #: Number of batches queued or running at each worker.
LOOK_S: Final = 5.0  #: Interval in s at which dead workers are replaced.
FLUSH_S: Final = 1.0  #: Longest delay in s between the return of rows and their writing to disk.

LOOPBACK: Final = "127.0.0.1"
MOST_DEATHS: Final = 10
"""Worker deaths after which a batch is abandoned; three is too few for preemptible workers."""
RESTART_S: Final = 120
"""Time in s allowed for a worker to restart: imports are slow on a busy machine."""
CONNECT_S: Final = 10.0  #: Time in s allowed for the scheduler to answer. Chosen; no study.

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
    """Sender of the missing cases of a study to workers."""

    loaded: LoadedStudy
    store: Store
    progress: Progress
    work: Work = run_batch
    stopping: Stopping = field(init=False)
    count: Count = field(init=False)
    _waiting: deque[Case] = field(init=False)
    _unwritten: list[Row] = field(init=False, default_factory=list)
    _written_s: float = field(init=False, default=0.0)

    def __post_init__(self) -> None:
        done = self.store.done()
        self.stopping = Stopping(self.loaded.study.stop, self.loaded.cases)
        self.stopping.add(self.store.rows().to_pylist())
        # a study may contain the same case twice
        missing = {case.name: case for case in self.loaded.cases if case.name not in done}
        self._waiting = deque(case for case in missing.values() if self.stopping.needs(case))
        self.count = Count(len(self._waiting))

    def run(self, client: Client) -> None:
        """Compute the missing cases; raise `OtherCodeError` if a worker has different code."""
        self._written_s = looked_s = time.monotonic()
        ended: SimpleQueue[Future[list[Row]]] = SimpleQueue()
        batches: dict[str, list[Case]] = {}
        try:
            self._send(client, ended, batches)
            while batches:
                if time.monotonic() - looked_s > LOOK_S:
                    replace_lost(client)
                    looked_s = time.monotonic()
                try:
                    future = ended.get(timeout=LOOK_S)
                except Empty:
                    continue
                self._take(self._rows(client, future, batches.pop(str(future.key))))
                self._send(client, ended, batches)
        finally:
            self._write()
        self.store.gather()

    def _send(
        self,
        client: Client,
        ended: SimpleQueue["Future[list[Row]]"],
        batches: dict[str, list[Case]],
    ) -> None:
        most = AHEAD * max(1, len(client.scheduler_info(n_workers=-1)["workers"]))
        while len(batches) < most and (cases := self._next()):
            future = client.submit(self.work, batch_of(self.loaded, cases), pure=False)
            batches[str(future.key)] = cases
            future.add_done_callback(ended.put)

    def _next(self) -> list[Case]:
        """The next cases, about `BATCH_S` of work."""
        size = 1
        if self.count.done:
            size = round(BATCH_S / max(self.count.case_s, BATCH_S / MOST_TOGETHER))
        taken: list[Case] = []
        while self._waiting and len(taken) < max(size, 1):
            case = self._waiting.popleft()
            if self.stopping.needs(case):
                taken.append(case)
            else:
                self.count.needed -= 1
        return taken

    def _rows(self, client: Client, future: "Future[list[Row]]", cases: list[Case]) -> list[Row]:
        while True:
            try:
                return future.result(timeout=LOOK_S)
            except TimeoutError:  # the result is lost with its worker and must be recomputed
                replace_lost(client)
            except KilledWorker:
                reason = "the workers that computed it died again and again: too little memory?"
                return [failed_row(case.name, LOST, reason) for case in cases]

    def _take(self, rows: list[Row]) -> None:
        self._unwritten += rows
        self.stopping.add(rows)
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


@contextmanager
def workers(scheduler: str | None, count: int | None) -> Iterator[Client]:
    """Connect to a scheduler, or start a local one that no other machine can reach.

    `scheduler` is an address such as ``tcp://10.0.0.5:8786``; without it there are `count` local
    processes, one per core by default. Raises `OSError` if the scheduler does not answer.
    """
    if scheduler is not None:
        with Client(scheduler, timeout=CONNECT_S) as client:
            yield client
        return
    # the campaign itself reports workers that die and are restarted
    settings = {
        "distributed.scheduler.allowed-failures": MOST_DEATHS,
        "distributed.deploy.lost-worker-timeout": f"{RESTART_S}s",
        "logging.distributed": "error",
    }
    resource_tracker.ensure_running()  # its start would unblock Ctrl-C
    with one_thread_each(), dask.config.set(settings):
        with signals_waiting():  # Ctrl-C reaches the whole process group: the driver decides
            cluster = LocalCluster(
                n_workers=count or len(os.sched_getaffinity(0)),
                threads_per_worker=1,
                processes=True,
                host=LOOPBACK,
                dashboard_address=f"{LOOPBACK}:0",
                silence_logs=logging.CRITICAL,
            )
        with cluster, Client(cluster) as client:
            yield client


def replace_lost(client: Client) -> None:
    """Restart local workers that no nanny watches any more.

    A nanny restarts a worker that dies, but gives up when the restart fails or takes too long.
    """
    cluster = client.cluster
    if cluster is not None:
        cluster.loop.add_callback(_replace_lost, cluster)


def _replace_lost(cluster: LocalCluster) -> None:
    for name, nanny in list(cluster.workers.items()):
        if nanny.status in (Status.closed, Status.failed):
            del cluster.workers[name]
    cluster.scale(len(cluster.worker_spec))
