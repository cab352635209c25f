"""Processes that compute for this one, which alone decides what a signal means."""

import ctypes
import multiprocessing
import os
import signal
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import Future, ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from typing import Any, Final, ParamSpec, TypeVar

from utank_hil.runners.stopping import SIGNALS, signals_waiting

P = ParamSpec("P")
T = TypeVar("T")

_shared: list[Any] = []
_PR_SET_PDEATHSIG: Final = 1


class WorkerPool(ProcessPoolExecutor):
    """A pool whose processes ignore `SIGNALS`: what they share tells them when to end.

    Ctrl-C, ``timeout`` and service managers reach all processes of a command. They end with this
    process, if it is killed.

    Parameters
    ----------
    shared : object
        What `shared` returns in the processes: shared values can't be sent along with a job.
    """

    def __init__(self, workers: int, shared: object) -> None:
        super().__init__(workers, multiprocessing.get_context("spawn"), _begin, (shared,))

    def submit(self, fn: Callable[P, T], /, *args: P.args, **kwargs: P.kwargs) -> Future[T]:
        """Have a process call a function; it is started if there are less than allowed."""
        with signals_waiting():
            return super().submit(fn, *args, **kwargs)

    def __exit__(self, kind: Any, error: BaseException | None, trace: Any) -> bool | None:
        """Wait for the processes; if one was killed, kill the others."""
        if isinstance(error, BrokenProcessPool):  # the base class sends a SIGTERM
            for process in multiprocessing.active_children():
                process.kill()
        return super().__exit__(kind, error, trace)


def shared() -> Any:
    """What the processes of the pool share, in one of them."""
    return _shared[0]


def whole_first(futures: Iterable[Future[T]]) -> Iterator[T]:
    """Results of those that are done, then the error of one that failed, if one did."""
    for future in sorted(futures, key=lambda each: each.exception() is not None):
        yield future.result()


def end_with(parent_pid: int) -> None:
    """Have this process killed when the thread that started it ends, however that does."""
    ctypes.CDLL(None).prctl(_PR_SET_PDEATHSIG, signal.SIGKILL, 0, 0, 0)
    if os.getppid() != parent_pid:  # it has ended already
        os._exit(1)


def _begin(shared: object) -> None:
    parent = multiprocessing.parent_process()
    assert parent is not None
    assert parent.pid is not None
    end_with(parent.pid)
    for number in SIGNALS:
        signal.signal(number, signal.SIG_IGN)
    signal.pthread_sigmask(signal.SIG_UNBLOCK, SIGNALS)
    _shared.append(shared)
