"""The retuner as a process of its own: records go there and answers come back through mailboxes.

The controller's loop writes one mailbox and looks at one number of the other; that is all that
connects them. The process may hang, die or write nonsense: the number never comes, or its message
is refused, and the controller goes on with the law it has. There are two of them:

    keeper   started before the loop; forks the worker, and forks it anew when it has died or hangs
    worker   beats its heart between orders, and works them off

Neither needs the loop for that, nor the loop them: it asks for a heartbeat before it begins.
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
from utank_hil.retuning.answer import Answer, Refusal, read_answer
from utank_hil.retuning.mailbox import Mailbox
from utank_hil.retuning.retuner import Work
from utank_hil.retuning.worker import keep

_ANSWER_BYTES: Final = 1 << 20
_START_S: Final = 30.0
_ALIVE_NS: Final = 5_000_000_000  # a nice process on a busy machine may have to wait for its turn
_HANGS_S: Final = 600.0
_END_S: Final = 2.0


class RetunerProcess(Closing):
    """A `Retuner` in a process of its own; start it before the loop.

    It is ready when the constructor returns. If it does not come up, the constructor returns too,
    after half a minute: the loop goes on with the law it has, and refuses to begin.

    Parameters
    ----------
    work : callable
        Importable in another process (a function, or a `functools.partial` of one).
    longest_record : tuple of int
        Rows and columns of the longest record.
    hangs_after_s : float
        A worker that is busy for longer is killed, and another takes its place.

    Attributes
    ----------
    pid : int
        Of the keeper, and of the process group that both are in.
    """

    def __init__(
        self, work: Work, longest_record: tuple[int, int], hangs_after_s: float = _HANGS_S
    ) -> None:
        rows, columns = longest_record
        self._orders = Mailbox(8 * (rows * columns + 1))
        self._answers = Mailbox(_ANSWER_BYTES)
        self._process = multiprocessing.get_context("spawn").Process(
            target=keep,
            args=(work, self._orders, self._answers, os.getpid(), hangs_after_s),
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
        """Whether the worker's heart beats."""
        return abs(time.monotonic_ns() - self._answers.beat_ns) < _ALIVE_NS

    def submit(self, number: int, record: FloatArray, now_ns: int) -> None:  # noqa: ARG002
        """Hand over a record."""
        self._orders.post(number, np.float64(record.shape[1]).tobytes() + record.tobytes())

    def answer(self, number: int, now_ns: int) -> Answer | None:  # noqa: ARG002
        """The answer, if it is there; what is not an answer counts as a refusal."""
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
        with suppress(ProcessLookupError):  # the keeper has not made the group yet, or all are gone
            os.killpg(self.pid, signal.SIGKILL)
        self._process.kill()
        self._process.join(_END_S)
