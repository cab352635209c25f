"""Workers of a campaign: a process for each core of this machine, or a cluster that is there."""

import logging
import os
from collections.abc import Iterator
from contextlib import contextmanager
from multiprocessing import resource_tracker
from typing import Final

import dask
from distributed import Client, LocalCluster, Status

from utank_hil.base.one_thread import one_thread_each
from utank_hil.runners.stopping import signals_waiting

LOOPBACK: Final = "127.0.0.1"
MOST_DEATHS: Final = 10
"""A batch whose workers died so often is given up; three is too few where workers are preempted."""
RESTART_S: Final = 120
"""A worker is given so long to come back: importing takes a while on a busy machine."""
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
    settings = {
        "distributed.scheduler.allowed-failures": MOST_DEATHS,
        "distributed.deploy.lost-worker-timeout": f"{RESTART_S}s",
        "logging.distributed": "error",
    }
    resource_tracker.ensure_running()  # its start would let Ctrl-C through again
    with one_thread_each(), dask.config.set(settings):
        with signals_waiting():  # Ctrl-C reaches all of the process group: the driver decides
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
    """Start workers of this machine anew that nothing watches any more.

    One that dies is started anew at once by its nanny; a nanny whose worker dies while it starts,
    or takes too long, gives up.
    """
    cluster = client.cluster
    if cluster is not None:
        cluster.loop.add_callback(_replace_lost, cluster)


def _replace_lost(cluster: LocalCluster) -> None:
    for name, nanny in list(cluster.workers.items()):
        if nanny.status in (Status.closed, Status.failed):
            del cluster.workers[name]
    cluster.scale(len(cluster.worker_spec))
