"""Stop by signal: SIGINT, SIGTERM and SIGHUP set a flag, and the loop ends between two ticks."""

import signal
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from types import FrameType
from typing import Final

SIGNALS: Final = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)


@contextmanager
def stop_on_signals() -> Iterator[Callable[[], bool]]:
    """Yield a function that returns whether SIGINT, SIGTERM or SIGHUP (a closed terminal) arrived.

    A SIGHUP that is ignored stays so: ``nohup`` asks for it. Main thread only, as Python requires.
    """
    stopped = False

    def note(_number: int, _frame: FrameType | None) -> None:
        nonlocal stopped
        stopped = True

    ignored = signal.getsignal(signal.SIGHUP) is signal.SIG_IGN
    numbers = [number for number in SIGNALS if not (ignored and number is signal.SIGHUP)]
    found = {number: signal.signal(number, note) for number in numbers}
    try:
        yield lambda: stopped
    finally:
        for number, handler in found.items():
            signal.signal(number, handler)


@contextmanager
def signals_waiting() -> Iterator[None]:
    """Let processes start with `SIGNALS` held back: they must not end them as they import."""
    before = signal.pthread_sigmask(signal.SIG_BLOCK, SIGNALS)
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)
