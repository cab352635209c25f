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
import time
from contextlib import suppress
from typing import Final

from utank_hil.base.background import one_thread_each
from utank_hil.base.closing import Closing
from utank_hil.retuning.desk import Desk
from utank_hil.retuning.retuner import Work
from utank_hil.retuning.worker import run_watchdog

_START_S: Final = 30.0  # scipy has to be imported, on a busy machine
_HANGS_S: Final = 600.0  # This is the longest `answer_within_s`; later answers are not used.
_END_S: Final = 2.0  # This is the wait for a killed process.


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
