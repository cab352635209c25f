"""What surrounds the imports of a command line, which take seconds on a busy machine."""

import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager


@contextmanager
def quietly_interruptible() -> Iterator[None]:
    """Let Ctrl-C end the process at once, as it does any program, instead of by a traceback.

    Only where Python's own handler is in place: what is ignored, or is handled by somebody, stays
    so.
    """
    handler = signal.getsignal(signal.SIGINT)
    if (
        handler is not signal.default_int_handler
        or threading.current_thread() is not threading.main_thread()
    ):
        yield
        return
    signal.signal(signal.SIGINT, signal.SIG_DFL)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, handler)
