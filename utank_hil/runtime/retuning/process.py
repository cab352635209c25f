"""The retuner as a process of its own: records go there and answers come back through mailboxes.

The controller's loop writes one mailbox and looks at one number of the other; that is all that
connects them. The process may hang, die or write nonsense: the number never comes, or its message
is refused, and the controller goes on with the law it has.
"""

import multiprocessing
import os
import signal
import time
from collections.abc import Iterator
from contextlib import contextmanager
from types import TracebackType
from typing import Final, Self

import numpy as np

from utank_hil.arrays import FloatArray
from utank_hil.runtime.retuning.answer import Answer, Refusal, answer_bytes, read_answer
from utank_hil.runtime.retuning.mailbox import Mailbox
from utank_hil.runtime.retuning.retuner import Work

_ANSWER_BYTES: Final = 1 << 20
_LOOK_S: Final = 0.1
_NICENESS: Final = 10
_END_S: Final = 2.0
_THREADS: Final = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")


class RetunerProcess:
    """A `Retuner` in a process of its own; start it before the loop.

    Parameters
    ----------
    work : callable
        Importable in another process (a function, or a `functools.partial` of one).
    longest_record : tuple of int
        Rows and columns of the longest record.

    Attributes
    ----------
    pid : int
        Of the process.
    """

    def __init__(self, work: Work, longest_record: tuple[int, int]) -> None:
        rows, columns = longest_record
        self._orders = Mailbox(8 * (rows * columns + 1))
        self._answers = Mailbox(_ANSWER_BYTES)
        self._process = multiprocessing.get_context("spawn").Process(
            target=serve, args=(work, self._orders, self._answers, os.getpid()), daemon=True
        )
        with _one_thread():
            self._process.start()
        assert self._process.pid is not None
        self.pid: int = self._process.pid

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
        """End the process; idempotent."""
        if self._process.is_alive():
            self._process.kill()
        self._process.join(_END_S)

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.close()


@contextmanager
def _one_thread() -> Iterator[None]:
    """Have a process that is started meanwhile compute in one thread.

    Linear algebra spread over all cores takes them from the loop; and on a busy machine its
    threads wait for one another and take twenty times as long.
    """
    before = {name: os.environ.get(name) for name in _THREADS}
    os.environ.update(dict.fromkeys(_THREADS, "1"))
    try:
        yield
    finally:
        for name, value in before.items():
            if value is None:
                del os.environ[name]
            else:
                os.environ[name] = value


def serve(work: Work, orders: Mailbox, answers: Mailbox, parent_pid: int) -> None:
    """Work off orders until the parent is gone; the whole life of the process."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C is for the loop; it ends this process
    os.nice(_NICENESS)
    done = 0
    while os.getppid() == parent_pid:
        number = orders.number
        data = orders.read(number) if number != done else None
        if data is None:
            time.sleep(_LOOK_S)
            continue
        values = np.frombuffer(data)
        answers.post(number, answer_bytes(work(values[1:].reshape(-1, int(values[0])))))
        done = number
