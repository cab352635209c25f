"""The retuner in processes of its own: records go out and answers come back through mailboxes.

The controller's loop writes one mailbox and polls one number of the other. There is no other
connection, so the loop never waits. If the retuner hangs, dies or writes garbage, the number never
arrives or the message is refused, and the controller keeps its law. There are two processes:

    watchdog   started before the loop; forks the worker, again whenever it has died or hangs
    worker     stores heartbeats while idle, and answers requests

A retuning begins only while the worker's heartbeat is recent.
"""

import multiprocessing
import os
import signal
import time
from contextlib import suppress
from typing import Final

import numpy as np

from utank_hil.arrays import FloatArray
from utank_hil.closing import Closing
from utank_hil.one_thread import one_thread_each
from utank_hil.retuning.answer import LONGEST_BYTES, Answer, Refusal, read_answer
from utank_hil.retuning.mailbox import Mailbox
from utank_hil.retuning.retuner import RetuneFunction
from utank_hil.retuning.worker import run_watchdog

_START_S: Final = 30.0
_ALIVE_NS: Final = 5_000_000_000  # low priority: may wait long for a busy machine
_HANGS_S: Final = 600.0
_END_S: Final = 2.0


class RetunerProcess(Closing):
    """A `Retuner` in processes of its own; start it before the loop.

    It is ready when the constructor returns. If it does not start within half a minute, the
    constructor returns as well; `alive` is then False and no retuning begins.

    Parameters
    ----------
    retune : RetuneFunction
        Importable in another process (a function, or a `functools.partial` of one).
    longest_record : tuple of int
        Rows and columns of the longest record.
    hangs_after_s : float
        A worker that is busy for longer is killed and replaced.

    Attributes
    ----------
    pid : int
        Process id of the watchdog, and id of the process group of both.
    """

    def __init__(
        self,
        retune: RetuneFunction,
        longest_record: tuple[int, int],
        hangs_after_s: float = _HANGS_S,
    ) -> None:
        rows, columns = longest_record
        self._requests = Mailbox(8 * (rows * columns + 1))
        self._answers = Mailbox(LONGEST_BYTES)
        self._process = multiprocessing.get_context("spawn").Process(
            target=run_watchdog,
            args=(retune, self._requests, self._answers, os.getpid(), hangs_after_s),
            daemon=True,
        )
        with one_thread_each():
            self._process.start()
        assert self._process.pid is not None
        self.pid: int = self._process.pid
        self._closed = False
        deadline_s = time.monotonic() + _START_S
        while not self.alive and self._process.is_alive() and time.monotonic() < deadline_s:
            time.sleep(0.01)

    @property
    def alive(self) -> bool:
        """Whether the worker's heartbeat is recent."""
        return abs(time.monotonic_ns() - self._answers.beat_ns) < _ALIVE_NS

    def submit(self, number: int, record: FloatArray, now_ns: int) -> None:  # noqa: ARG002
        """Post a record."""
        self._requests.post(number, np.float64(record.shape[1]).tobytes() + record.tobytes())

    def answer(self, number: int, now_ns: int) -> Answer | None:  # noqa: ARG002
        """The answer, if it has arrived; a message that cannot be decoded is a refusal."""
        data = self._answers.read(number)
        if data is None:
            return None
        try:
            return read_answer(data)
        except ValueError as error:
            return Refusal((f"the retuner answered nonsense: {error}",))

    def close(self) -> None:
        """End both processes; idempotent."""
        if self._closed:
            return
        self._closed = True
        with suppress(ProcessLookupError):  # no group yet, or no process left
            os.killpg(self.pid, signal.SIGKILL)
        self._process.kill()
        self._process.join(_END_S)
