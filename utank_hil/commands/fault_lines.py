"""One plain line for each fault, at once: on standard error, while the loop goes on."""

import contextlib
import os
import subprocess
from typing import Final

from utank_hil.canbus import Fault, Mode
from utank_hil.runtime.controller_node import ControllerNode
from utank_hil.runtime.faults import fault_text

_END_S: Final = 10.0
_STANDARD_ERROR: Final = 2


class FaultLines:
    """Prints a line when the controller's fault changes, through a process of its own.

    A terminal or a journal may be held up, and the loop must not wait for it: it writes into a
    pipe, and ``cat`` copies from there. A line is left out when the pipe is full.

    Raises
    ------
    OSError
        If the process can't be started.
    """

    def __init__(self) -> None:
        self._said = (Mode.INIT, Fault.NONE)
        self._process = subprocess.Popen(
            ["cat"],
            stdin=subprocess.PIPE,
            stdout=_STANDARD_ERROR,
            start_new_session=True,  # Ctrl-C in the terminal does not end it before the last line
        )
        assert self._process.stdin is not None
        self._pipe = self._process.stdin.fileno()
        os.set_blocking(self._pipe, False)

    def look(self, node: ControllerNode) -> None:
        """Print the fault if it is new; never waits. What is awaited in INIT is no fault yet."""
        now = (node.mode, node.fault)
        if now == self._said:
            return
        self._said = now
        if node.mode is not Mode.INIT and node.fault is not Fault.NONE:
            with contextlib.suppress(OSError):  # the fault is also the last word of the command
                os.write(self._pipe, f"{fault_line(node)}\n".encode())

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


def fault_line(node: ControllerNode) -> str:
    """Time, mode, code, what happened and what to do, in one line."""
    fault = node.fault
    return f"{node.time_s:8.1f} s {node.mode.name}, fault {fault.value}, {fault_text(fault)}"
