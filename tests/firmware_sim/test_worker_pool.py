"""Processes that compute, when one of them is killed and when a signal reaches all of them."""

import os
import signal
import subprocess
import sys
import time
from concurrent.futures.process import BrokenProcessPool
from pathlib import Path

import pytest

from firmware_sim.worker_pool import WorkerPool, shared
from utank_hil.commands.exit_codes import ExitCode
from utank_hil.runtime.stopping import SIGNALS

BUSY_S = 2.0
COMMANDS = {
    "bench": ("--duration", "36000", "--out"),
    "faults": ("--rows", "motion", "--seeds", "30", "--out"),
    "campaign": ("configs/studies/storm_seeds.yaml", "--out"),
}


def signalled(word: str) -> str:
    for number in SIGNALS:
        os.kill(os.getpid(), number)
    return f"{word} {shared()}"


def killed() -> None:
    os.kill(os.getpid(), signal.SIGKILL)


def test_processes_share_what_they_are_given_and_heed_no_signal() -> None:
    with WorkerPool(1, "all the same") as pool:
        assert pool.submit(signalled, "works").result() == "works all the same"


def test_one_that_is_killed_takes_the_others_along() -> None:
    with pytest.raises(BrokenProcessPool), WorkerPool(2, None) as pool:  # noqa: PT012
        pool.submit(time.sleep, 3600)
        pool.submit(time.sleep, 0).result()  # the pool watches it from its first result on
        pool.submit(killed).result()


def in_session(number: int) -> dict[int, float]:
    """Processes of a session that live, and the seconds that each has computed."""
    found = {}
    for file in Path("/proc").glob("[0-9]*/stat"):
        try:
            fields = file.read_text().rpartition(")")[2].split()
        except OSError:
            continue
        if int(fields[3]) == number and fields[0] != "Z":
            ticks = int(fields[11]) + int(fields[12])
            found[int(file.parent.name)] = ticks / os.sysconf("SC_CLK_TCK")
    return found


@pytest.mark.slow
@pytest.mark.parametrize("name", COMMANDS)
def test_sigterm_to_all_processes_ends_a_command_in_order(tmp_path: Path, name: str) -> None:
    words = [name, *COMMANDS[name], str(tmp_path)]
    with subprocess.Popen(
        [sys.executable, "-c", "from utank_hil.cli import main; main()", *words],
        stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
    ) as process:
        while not any(
            seconds > BUSY_S
            for pid, seconds in in_session(process.pid).items()
            if pid != process.pid
        ):
            assert process.poll() is None
            time.sleep(0.02)
        os.killpg(process.pid, signal.SIGTERM)
        _, errors = process.communicate()
    assert process.returncode == ExitCode.INTERRUPTED, errors
    assert "Traceback" not in errors
    while in_session(process.pid):  # what keeps account of shared memory ends after it
        time.sleep(0.02)
