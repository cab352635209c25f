"""Workers of a campaign: one process per core of this machine, or an existing cluster."""

import logging
import os
from collections.abc import Iterator
from contextlib import contextmanager
from multiprocessing import resource_tracker
from typing import Final

import dask
from distributed import Client, LocalCluster, Status

from utank_hil.base.background import one_thread_each
from utank_hil.runners.stopping import signals_waiting

LOOPBACK: Final = "127.0.0.1"
MOST_DEATHS: Final = 10
"""Worker deaths after which a batch is abandoned; three is too few for preemptible workers."""
RESTART_S: Final = 120
"""Time in s allowed for a worker to restart: imports are slow on a busy machine."""
CONNECT_S: Final = 10.0  #: Time in s allowed for the scheduler to answer. Chosen; no study.


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
