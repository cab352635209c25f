"""The lines that are printed while a loop goes on."""

import os
import signal
import time

import pytest

from utank_hil.canbus import AlarmState, Fault, Mode
from utank_hil.canbus.events import AlarmEvent
from utank_hil.commands.lines import Lines
from utank_hil.safety.faults import FAULTS

START_NS = 7_000_000_000


def event(
    code: Fault, state: AlarmState | None = AlarmState.ACTIVE_UNACKNOWLEDGED, time_s: float = 1.5
) -> AlarmEvent:
    return AlarmEvent(START_NS + round(time_s * 1e9), code, state, Mode.FAULT)


def test_an_alarm_is_one_line_with_mode_words_and_remedy(capfd) -> None:
    lines = Lines()
    for state in (*AlarmState, None):
        lines.tell(event(Fault.MOTION_SILENT, state), START_NS)
    lines.close()
    lines.close()
    told = capfd.readouterr().err.splitlines()
    row = next(row for row in FAULTS if row.code is Fault.MOTION_SILENT)
    words = f"in FAULT: MOTION_SILENT: {row.happened} {row.remedy}"
    assert told == [
        f"     1.5 s {what} {words}"
        for what in ("ALARM", "alarm accepted", "cause of an alarm gone", "alarm over",
                     "reset REFUSED while this lasts,")
    ]  # fmt: skip


def test_what_ends_the_command_does_not_end_it_before_the_last_line(capfd) -> None:
    """Ctrl-C, and a terminal that is closed, go to all of a session."""
    lines = Lines()
    assert os.getsid(lines._process.pid) == lines._process.pid != os.getsid(0)
    lines.close()


def test_it_is_printed_at_once(capfd) -> None:
    lines = Lines()
    lines.tell(event(Fault.DRIVE_FAULT), START_NS)
    told, deadline = "", time.monotonic() + 20
    while "DRIVE_FAULT" not in told:
        assert time.monotonic() < deadline
        time.sleep(0.01)
        told += capfd.readouterr().err
    lines.close()


@pytest.mark.parametrize("number", [signal.SIGSTOP, signal.SIGKILL])
def test_a_terminal_that_is_held_up_or_gone_never_stops_the_loop(capfd, number: int) -> None:
    lines = Lines()
    os.kill(lines._process.pid, number)
    for _ in range(2000):  # over twice what the pipe holds
        lines.tell(event(Fault.DRIVE_FAULT), START_NS)
    os.kill(lines._process.pid, signal.SIGCONT)
    lines.close()
    assert ("DRIVE_FAULT" in capfd.readouterr().err) == (number == signal.SIGSTOP)
