"""The retuner's two processes: a worker that answers requests, and a watchdog that restarts it.

A new worker finds an open request by itself (`Desk`). The watchdog refuses requests that were open
when a worker was killed; they are not tried again.
"""

import os
import signal
import sys
import time
import traceback
from collections.abc import Sequence
from typing import Final

from utank_hil.base.background import give_way
from utank_hil.retuning.desk import Desk

_POLL_S: Final = 0.1  # An answer takes seconds.
_RESTART_DELAY_S: Final = 1.0  # A worker that dies at once does not occupy the processor.
_NICENESS: Final = 10  # This is a tenth of the processor beside a busy process of normal priority.
_SECOND_NS: Final = 1_000_000_000


def run_watchdog(desks: Sequence[Desk], parent_pid: int, hangs_after_s: float) -> None:
    """Run a worker until the parent is gone, as main function of the watchdog."""
    os.setpgid(0, 0)  # Ctrl-C does not reach it; the loop ends this group.
    give_way(_NICENESS)
    watchdog_pid = os.getpid()
    while os.getppid() == parent_pid:
        worker_pid = os.fork()  # This is safe with one thread and no resources but the mailboxes.
        if worker_pid == 0:
            try:
                run_worker(desks, watchdog_pid)
            except BaseException:
                traceback.print_exc(file=sys.stderr)
            finally:
                os._exit(1)
        end = _watch(worker_pid, desks[0], parent_pid, hangs_after_s)
        if end is not None:
            for desk in desks:
                desk.refuse_open(f"the retuner {end}, and was restarted")
        time.sleep(_RESTART_DELAY_S)


def _watch(worker_pid: int, desk: Desk, parent_pid: int, hangs_after_s: float) -> str | None:
    """Return how a worker ended, in words; None if it was ended because the parent is gone."""
    begun_ns = time.monotonic_ns()
    while os.getppid() == parent_pid:
        pid, status = os.waitpid(worker_pid, os.WNOHANG)
        if pid:
            code = os.waitstatus_to_exitcode(status)
            return f"ended with code {code}" if code >= 0 else f"was killed by signal {-code}"
        silent_ns = time.monotonic_ns() - max(begun_ns, desk.beat_ns)
        if silent_ns > hangs_after_s * _SECOND_NS:
            _kill(worker_pid)
            return f"was busy for more than {hangs_after_s:g} s"
        time.sleep(_POLL_S)
    _kill(worker_pid)
    return None


def _kill(pid: int) -> None:
    os.kill(pid, signal.SIGKILL)
    os.waitpid(pid, 0)


def run_worker(desks: Sequence[Desk], watchdog_pid: int) -> None:
    """Answer requests until the watchdog is gone, as main function of a worker."""
    while os.getppid() == watchdog_pid:
        idle = True
        for desk in desks:
            now_ns = time.monotonic_ns()
            for each in desks:
                each.beat(now_ns)
            if desk.serve():
                idle = False
        if idle:
            time.sleep(_POLL_S)
