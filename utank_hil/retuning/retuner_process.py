"""The retuner in processes of its own: records go out and answers come back through mailboxes.

The controller's loop writes one mailbox and polls one number of the other. There is no other
connection, so the loop never waits. If the retuner hangs, dies or writes garbage, the number never
arrives or the message is refused, and the controller keeps its law. There are two processes:

    watchdog   started before the loop; forks the worker again whenever it has died or hangs
    worker     stores heartbeats while idle, and answers the requests of every desk

A request is made only while the worker's heartbeat is recent.
"""

import multiprocessing
import os
import signal
import sys
import time
import traceback
from collections.abc import Sequence
from contextlib import suppress
from typing import Final

from utank_hil.base.background import give_way, one_thread_each
from utank_hil.base.closing import Closing
from utank_hil.retuning.desk import Desk
from utank_hil.retuning.retuner import Work

_POLL_S: Final = 0.1  # An answer takes seconds.
_RESTART_DELAY_S: Final = 1.0  # A worker that dies at once does not occupy the processor.
_NICENESS: Final = 10  # This is a tenth of the processor beside a busy process of normal priority.
_SECOND_NS: Final = 1_000_000_000


_START_S: Final = 30.0  # scipy has to be imported, on a busy machine
_HANGS_S: Final = 600.0  # This is the longest `answer_within_s`; later answers are not used.
_END_S: Final = 2.0  # This is the wait for a killed process.


def run_watchdog(desks: Sequence[Desk], parent_pid: int, hangs_after_s: float) -> None:
    """Run a worker until the parent is gone, as main function of the watchdog.

    A new worker finds an open request by itself (`Desk`). Requests that were open when a worker was
    killed are refused, not tried again.
    """
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


class RetunerProcess(Closing):
    """One desk for each kind of work, served by a separate process; start it before the loop.

    The constructor returns when the process is ready, or after half a minute; then no desk is alive
    and nothing is requested. `works` can be imported in another process (functions, or
    `functools.partial` of them). A worker that is busy for `hangs_after_s` is killed and replaced.
    """

    def __init__(self, *works: Work, hangs_after_s: float = _HANGS_S) -> None:
        self.desks = tuple(Desk(work) for work in works)  #: Desks in the order of `works`.
        self._process = multiprocessing.get_context("spawn").Process(
            target=run_watchdog, args=(self.desks, os.getpid(), hangs_after_s), daemon=True
        )
        with one_thread_each():
            self._process.start()
        assert self._process.pid is not None
        #: Process id of the watchdog, and id of the process group of both.
        self.pid: int = self._process.pid
        self._closed = False
        deadline_s = time.monotonic() + _START_S
        while not self.alive and self._process.is_alive() and time.monotonic() < deadline_s:
            time.sleep(0.01)

    @property
    def alive(self) -> bool:
        """Whether the worker's heartbeat is recent."""
        return self.desks[0].alive

    def close(self) -> None:
        """End both processes; idempotent."""
        if self._closed:
            return
        self._closed = True
        with suppress(ProcessLookupError):  # There may be no group yet, or no process left.
            os.killpg(self.pid, signal.SIGKILL)
        self._process.kill()
        self._process.join(_END_S)
