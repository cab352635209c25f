"""Ending a loop from outside: SIGINT and SIGTERM set a flag, the loop ends between two ticks."""

import signal
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from types import FrameType


@contextmanager
def stop_on_signals() -> Iterator[Callable[[], bool]]:
    """Catch SIGINT and SIGTERM; give a function that says whether one has come.

    The handlers found are put back at the end. Main thread only, as Python demands of handlers.
    """
    stopped = False

    def note(_number: int, _frame: FrameType | None) -> None:
        nonlocal stopped
        stopped = True

    found = {number: signal.signal(number, note) for number in (signal.SIGINT, signal.SIGTERM)}
    try:
        yield lambda: stopped
    finally:
        for number, handler in found.items():
            signal.signal(number, handler)
