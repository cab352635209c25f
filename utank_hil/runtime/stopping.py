"""Stop by signal: SIGINT and SIGTERM set a flag, and the loop ends between two ticks."""

import signal
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from types import FrameType


@contextmanager
def stop_on_signals() -> Iterator[Callable[[], bool]]:
    """Handle SIGINT and SIGTERM; yield a function that returns whether one has arrived.

    The former handlers are restored at the end. Main thread only, as Python requires.
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
