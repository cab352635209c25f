"""The line that `run` prints when a fault is latched."""

import os
import signal
import time
from types import SimpleNamespace
from typing import cast

import pytest

from utank_hil.canbus import Fault, Mode
from utank_hil.commands.fault_lines import FaultLines
from utank_hil.runtime.controller_node import ControllerNode
from utank_hil.runtime.faults import FAULTS


def node(mode: Mode, fault: Fault, time_s: float = 1.5) -> ControllerNode:
    return cast(ControllerNode, SimpleNamespace(mode=mode, fault=fault, time_s=time_s))


def test_a_latched_fault_is_one_line_with_code_words_and_remedy(capfd) -> None:
    lines = FaultLines()
    for mode, fault in (
        (Mode.INIT, Fault.DRIVE_SILENT),  # still waited for
        (Mode.STANDBY, Fault.NONE),
        (Mode.ACTIVE, Fault.NONE),
        (Mode.FAULT, Fault.MOTION_SILENT),
        (Mode.FAULT, Fault.MOTION_SILENT),
        (Mode.STANDBY, Fault.NONE),
        (Mode.FAULT, Fault.MOTION_SILENT),
    ):
        lines.look(node(mode, fault))
    lines.close()
    lines.close()
    told = capfd.readouterr().err.splitlines()
    row = next(row for row in FAULTS if row.code is Fault.MOTION_SILENT)
    expected = (
        f"     1.5 s FAULT, fault {Fault.MOTION_SILENT.value}, MOTION_SILENT: {row.happened} "
        f"{row.remedy}"
    )
    assert told == [expected, expected]


def test_it_is_printed_at_once(capfd) -> None:
    lines = FaultLines()
    lines.look(node(Mode.FAULT, Fault.DRIVE_FAULT))
    told, deadline = "", time.monotonic() + 20
    while "DRIVE_FAULT" not in told:
        assert time.monotonic() < deadline
        time.sleep(0.01)
        told += capfd.readouterr().err
    lines.close()


@pytest.mark.parametrize("number", [signal.SIGSTOP, signal.SIGKILL])
def test_a_terminal_that_is_held_up_or_gone_never_stops_the_loop(capfd, number: int) -> None:
    lines = FaultLines()
    os.kill(lines._process.pid, number)
    for _ in range(1000):  # over twice what the pipe holds
        lines.look(node(Mode.FAULT, Fault.DRIVE_FAULT))
        lines.look(node(Mode.FAULT, Fault.DRIVE_SILENT))
    os.kill(lines._process.pid, signal.SIGCONT)
    lines.close()
    assert ("DRIVE_FAULT" in capfd.readouterr().err) == (number == signal.SIGSTOP)
