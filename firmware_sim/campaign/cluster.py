"""Workers of a campaign: a process for each core of this machine, or a cluster that is there."""

import logging
import os
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Final

import dask
from distributed import Client, LocalCluster

from utank_hil.one_thread import one_thread_each

LOOPBACK: Final = "127.0.0.1"
MOST_DEATHS: Final = 10
"""A batch whose workers died so often is given up; three is too few where workers are preempted."""
CONNECT_S: Final = 10.0


@contextmanager
def workers(scheduler: str | None, count: int | None) -> Iterator[Client]:
    """Connect with a scheduler, or start one on this machine that nobody else can reach.

    Parameters
    ----------
    scheduler : str, optional
        Address, as ``tcp://10.0.0.5:8786``; without it the workers are processes of this machine.
    count : int, optional
        Of processes here; one a core if not given.

    Raises
    ------
    OSError
        If the scheduler does not answer.
    """
    if scheduler is not None:
        with Client(scheduler, timeout=CONNECT_S) as client:
            yield client
        return
    # what is said of workers that die and are started anew is the campaign's to say
    silent = {"distributed.scheduler.allowed-failures": MOST_DEATHS, "logging.distributed": "error"}
    with (
        one_thread_each(),
        dask.config.set(silent),
        LocalCluster(
            n_workers=count or len(os.sched_getaffinity(0)),
            threads_per_worker=1,
            processes=True,
            host=LOOPBACK,
            dashboard_address=f"{LOOPBACK}:0",
            silence_logs=logging.CRITICAL,
        ) as cluster,
        Client(cluster) as client,
    ):
        yield client
