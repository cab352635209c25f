"""One plain line for each alarm, at once: on standard error, while the loop goes on."""

import contextlib
import os
import subprocess
from typing import Final

from utank_hil.runtime.alarms import AlarmEvent
from utank_hil.telemetry.event_ring import event_text

_END_S: Final = 10.0
_STANDARD_ERROR: Final = 2


class AlarmLines:
    """Prints what becomes of the alarms, through a process of its own.

    A terminal or a journal may be held up, and the loop must not wait for it: it writes into a
    pipe, and ``cat`` copies from there. A line is left out when the pipe is full.

    Raises
    ------
    OSError
        If the process can't be started.
    """

    def __init__(self) -> None:
        self._process = subprocess.Popen(
            ["cat"],
            stdin=subprocess.PIPE,
            stdout=_STANDARD_ERROR,
            start_new_session=True,  # Ctrl-C in the terminal does not end it before the last line
        )
        assert self._process.stdin is not None
        self._pipe = self._process.stdin.fileno()
        os.set_blocking(self._pipe, False)

    def tell(self, event: AlarmEvent, start_ns: int) -> None:
        """Print an event, with the time since the start; never waits."""
        self.say(f"{(event.time_ns - start_ns) * 1e-9:8.1f} s {event_text(event)}")

    def say(self, line: str) -> None:
        """Print a line; never waits."""
        with contextlib.suppress(OSError):  # the fault is also the last word of the command
            os.write(self._pipe, f"{line}\n".encode())

    def close(self) -> None:
        """Have the last line printed; idempotent."""
        process = self._process
        if process.stdin is not None and not process.stdin.closed:
            process.stdin.close()
            try:
                process.wait(_END_S)
            except subprocess.TimeoutExpired:  # the terminal takes nothing
                process.kill()
                process.wait()
