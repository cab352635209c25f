"""Plain lines on standard error while a loop runs, for alarms and for a panel."""

import contextlib
import os
import subprocess
from collections.abc import Iterator
from typing import Final

from utank_hil.canbus.events import AlarmEvent
from utank_hil.console.common import failing
from utank_hil.console.exit_codes import ExitCode
from utank_hil.telemetry.events import event_text

_END_S: Final = 10.0  #: Time for the last line on a slow terminal.
_STANDARD_ERROR: Final = 2  #: By POSIX.


class Lines:
    """Prints lines through a separate process, ``cat``; OSError if it can't be started.

    A terminal or a journal may block, and the loop must not wait for it: it writes into a pipe, and
    drops a line when that is full.
    """

    def __init__(self) -> None:
        self._process = subprocess.Popen(
            ["cat"],
            stdin=subprocess.PIPE,
            stdout=_STANDARD_ERROR,
            start_new_session=True,  # Ctrl-C in the terminal does not end it before the last line.
        )
        assert self._process.stdin is not None
        self._pipe = self._process.stdin.fileno()
        os.set_blocking(self._pipe, False)

    def tell(self, event: AlarmEvent, start_ns: int) -> None:
        """Print the change of an alarm with the time since the start; never waits."""
        self.say(f"{(event.time_ns - start_ns) * 1e-9:8.1f} s {event_text(event)}")

    def say(self, line: str) -> None:
        """Print a line; never waits."""
        with contextlib.suppress(OSError):  # The command's last words name the fault too.
            os.write(self._pipe, f"{line}\n".encode())

    def close(self, within_s: float = _END_S) -> None:
        """Let the last line be printed; idempotent."""
        process = self._process
        if process.stdin is not None and not process.stdin.closed:
            process.stdin.close()
            try:
                process.wait(within_s)
            except subprocess.TimeoutExpired:  # The terminal takes no output.
                process.kill()
                process.wait()


@contextlib.contextmanager
def printed_lines() -> Iterator[Lines]:
    """Yield lines while a loop runs; the command fails if no process can be started."""
    with failing(OSError, at="no process to print on the terminal", code=ExitCode.SYSTEM):
        lines = Lines()
    try:
        yield lines
    finally:
        lines.close()
