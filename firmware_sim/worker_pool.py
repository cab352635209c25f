"""Pool of processes that leave the handling of signals to their parent."""

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
_PR_SET_PDEATHSIG: Final = 1  # Option of Linux's prctl for the signal at the parent's death.


class WorkerPool(ProcessPoolExecutor):
    """Pool whose processes ignore `SIGNALS`; shared values tell them when to end.

    Ctrl-C, ``timeout`` and service managers signal all processes of a command. The pool's processes
    end with this process if it is killed. `shared` is what `shared` returns in the processes:
    shared values cannot be sent with a job.
    """

    def __init__(self, workers: int, shared: object) -> None:
        super().__init__(workers, multiprocessing.get_context("spawn"), _begin, (shared,))

    def submit(self, fn: Callable[P, T], /, *args: P.args, **kwargs: P.kwargs) -> Future[T]:
        """Call a function in a process, which is started if fewer than allowed run."""
        with signals_waiting():
            return super().submit(fn, *args, **kwargs)

    def __exit__(self, kind: Any, error: BaseException | None, trace: Any) -> bool | None:
        """Wait for the processes; after Ctrl-C, or if one was killed, kill the others."""
        # the base class sends a SIGTERM, which the processes ignore
        if isinstance(error, BrokenProcessPool | KeyboardInterrupt):
            for process in multiprocessing.active_children():
                process.kill()
        return super().__exit__(kind, error, trace)


def shared() -> Any:
    """Shared values of the pool, in one of its processes."""
    return _shared[0]


def whole_first(futures: Iterable[Future[T]]) -> Iterator[T]:
    """Yield the results of completed futures, then raise the error of a failed one, if any."""
    for future in sorted(futures, key=lambda each: each.exception() is not None):
        yield future.result()


def end_with(parent_pid: int) -> None:
    """Kill this process when the thread that started it ends for any reason."""
    ctypes.CDLL(None).prctl(_PR_SET_PDEATHSIG, signal.SIGKILL, 0, 0, 0)
    if os.getppid() != parent_pid:  # the parent has already ended
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
