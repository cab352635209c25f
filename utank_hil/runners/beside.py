"""Processes beside the loop: they write and print what must not wait in it."""

import json
import multiprocessing
import os
import signal
from collections.abc import Callable
from contextlib import suppress
from multiprocessing.connection import Connection
from typing import Any, Final

from utank_hil.base.background import give_way
from utank_hil.runners.stopping import SIGNALS, signals_waiting

_READY: Final = b"ready"
_NICENESS: Final = 5  #: Below what controls, above idle.
_START_S, END_S = 30.0, 15.0
"""Times for a process to start, and to end what it has to do, on a busy machine."""
_SILENT_S: Final = 1.0  #: Wait for an end of which nothing is said.


class Beside:
    """A process that runs `main` with these arguments, ready when the constructor returns.

    The last argument of `main`, a function of a module, is a connection, on which it calls `ready`
    and may send one last message as JSON. It must end by itself when the rings that it reads do.
    OSError with the reason is raised if it does not start.
    """

    def __init__(self, what: str, main: Callable[..., None], *arguments: object) -> None:
        self.error = ""  #: Why the process failed; empty if it did not.
        self._what = what
        self._last: dict[str, Any] = {}
        context = multiprocessing.get_context("spawn")
        self._heard, says = context.Pipe(duplex=False)
        self._process = context.Process(target=main, args=(*arguments, says))
        try:
            with signals_waiting():
                self._process.start()
        finally:
            says.close()  # The process has its own copy, so that its end is detected.
        said = b""
        with suppress(EOFError):
            if self._heard.poll(_START_S):
                said = self._heard.recv_bytes()
        if said == _READY:
            return
        self._kill()
        self._heard.close()
        why = said.decode() or f"exit code {self._process.exitcode}"
        raise OSError(f"{what} did not start: {why}")

    @property
    def pid(self) -> int | None:
        """Number of the process."""
        return self._process.pid

    def failure(self) -> str:
        """Return once why the process ended before the run; never waits."""
        if self.error or self._process.is_alive():
            return ""
        self.error = f"{self._what} ended with code {self._process.exitcode}"
        return self.error

    def stop(self, say: Callable[[str], None]) -> dict[str, Any]:
        """Wait for the end and return the last message, {} without one; idempotent."""
        if self._heard.closed:
            return self._last
        self._process.join(_SILENT_S)
        if self._process.is_alive():
            with suppress(OSError, SystemExit):  # The output is full or gone (Rich's SystemExit).
                say(f"waiting up to {END_S:g} s for {self._what} to end")
            self._process.join(END_S - _SILENT_S)
        if self._process.is_alive():
            self._kill()
            self.error = f"{self._what} did not end and was killed"
        elif self._process.exitcode:
            self.error = f"{self._what} ended with code {self._process.exitcode}"
        with suppress(EOFError), self._heard:
            if self._heard.poll():
                self._last = json.loads(self._heard.recv_bytes())
        return self._last

    def _kill(self) -> None:
        self._process.kill()
        self._process.join()


def ready(told: Connection) -> None:
    """Say that this process is ready; from here on the end of its rings ends it, and no signal.

    Ctrl-C, a closed terminal or a stopped service must not, before the loop's last records.
    """
    os.setsid()
    for number in SIGNALS:
        signal.signal(number, signal.SIG_IGN)
    give_way(_NICENESS)
    told.send_bytes(_READY)
