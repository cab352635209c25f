"""Ctrl-C while the command line loads."""

import signal
import subprocess
import sys

import pytest

from utank_hil.console.interruptible import quietly_interruptible

LOADING = """
import time
from utank_hil.console.interruptible import quietly_interruptible
with quietly_interruptible():
    print("loading", flush=True)
    time.sleep(60)
"""


def test_interrupt_ends_it_at_once_and_without_a_traceback() -> None:
    with subprocess.Popen(
        [sys.executable, "-c", LOADING],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        # a shell's background job ignores it, and its children with it
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.default_int_handler),
    ) as process:
        process.stdout.readline()
        process.send_signal(signal.SIGINT)
        _, errors = process.communicate(timeout=30)
    assert process.returncode == -signal.SIGINT
    assert errors == ""


TERMINATED = (
    LOADING.replace(
        "with quietly_interruptible():\n",
        "from utank_hil.console.interruptible import end_as_by_ctrl_c\nend_as_by_ctrl_c()\ntry:\n",
    )
    + """
except KeyboardInterrupt:
    print("closing", flush=True)
    time.sleep(0.5)
    print("closed")
"""
)


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGHUP])
def test_a_closed_terminal_and_a_stopped_service_end_it_as_ctrl_c_and_once(number: int) -> None:
    with subprocess.Popen(
        [sys.executable, "-c", TERMINATED], stdout=subprocess.PIPE, text=True
    ) as process:
        assert process.stdout.readline() == "loading\n"
        process.send_signal(number)
        assert process.stdout.readline() == "closing\n"
        process.send_signal(number)
        assert process.communicate()[0] == "closed\n"
    assert process.returncode == 0


def test_handlers_are_as_before_and_others_are_left_alone() -> None:
    found = signal.getsignal(signal.SIGINT)
    try:
        for handler, meanwhile in (
            (signal.default_int_handler, signal.SIG_DFL),
            (signal.SIG_IGN, signal.SIG_IGN),
        ):
            signal.signal(signal.SIGINT, handler)
            with quietly_interruptible():
                assert signal.getsignal(signal.SIGINT) is meanwhile
            assert signal.getsignal(signal.SIGINT) is handler
    finally:
        signal.signal(signal.SIGINT, found)


INTERRUPTED = """
import utank_hil.console.common as common
def load(*_, **__):
    raise KeyboardInterrupt
common.load = load
from utank_hil.cli import main
main()
"""


def test_ctrl_c_in_a_command_without_a_loop_of_its_own_is_said() -> None:
    words = ["check", "configs/ships/thesis_first.yaml"]
    done = subprocess.run(
        [sys.executable, "-c", INTERRUPTED, *words], capture_output=True, text=True, check=False
    )
    assert done.returncode == 130
    assert done.stderr.strip() == "interrupted before there was a result"
