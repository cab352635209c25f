"""Processes that compute, when one of them is killed and when a signal reaches all of them."""

import os
import signal
import subprocess
import sys
import time
from concurrent.futures import Future
from concurrent.futures.process import BrokenProcessPool
from pathlib import Path

import pytest

from firmware_sim.worker_pool import WorkerPool, shared, whole_first
from utank_hil.console.common import KILLED
from utank_hil.console.exit_codes import ExitCode
from utank_hil.runners.stopping import SIGNALS

COMMANDS = {
    "bench": ("configs/scenarios/storm_all.yaml", "--duration", "36000", "--out"),
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


def test_what_is_whole_is_kept_beside_what_was_lost() -> None:
    lost, whole = Future[str](), Future[str]()
    lost.set_exception(BrokenProcessPool())
    whole.set_result("whole")
    found = []
    with pytest.raises(BrokenProcessPool):
        found.extend(whole_first([lost, whole]))
    assert found == ["whole"]


def in_session(number: int) -> dict[int, float]:
    """Processes of a session that live, and the seconds that each and its children computed."""
    found = {}
    for file in Path("/proc").glob("[0-9]*/stat"):
        try:
            fields = file.read_text().rpartition(")")[2].split()
        except OSError:
            continue
        if int(fields[3]) == number and fields[0] != "Z":
            ticks = sum(map(int, fields[11:15]))
            found[int(file.parent.name)] = ticks / os.sysconf("SC_CLK_TCK")
    return found


def at_work(name: str, out: Path) -> "subprocess.Popen[str]":
    """A command in a session of its own."""
    return subprocess.Popen(
        [
            *(sys.executable, "-c", "from utank_hil.cli import main; main()"),
            *(name, *COMMANDS[name], str(out)),
        ],
        stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
        env=os.environ | {"COLUMNS": "200"},
    )


def a_worker(process: "subprocess.Popen[str]", busy_s: float = 2.0) -> int:
    """One of the command's processes, when it has computed for so long."""
    while True:
        for pid, seconds in in_session(process.pid).items():
            if pid != process.pid and seconds > busy_s:
                return pid
        assert process.poll() is None
        time.sleep(0.02)


@pytest.mark.evidence
@pytest.mark.parametrize("name", ["faults", "bench", "campaign"])
def test_sigterm_to_all_processes_ends_a_command_in_order(tmp_path: Path, name: str) -> None:
    with at_work(name, tmp_path) as process:
        a_worker(process)
        os.killpg(process.pid, signal.SIGTERM)
        _, errors = process.communicate()
    assert process.returncode == ExitCode.INTERRUPTED, errors
    assert "Traceback" not in errors
    while in_session(process.pid):  # what keeps account of shared memory ends after it
        time.sleep(0.02)


@pytest.mark.evidence
@pytest.mark.parametrize("name", ["bench", "faults"])
def test_a_process_that_is_killed_is_said_with_a_code_of_its_own(tmp_path: Path, name: str) -> None:
    with at_work(name, tmp_path) as process:
        os.kill(a_worker(process), signal.SIGKILL)
        _, errors = process.communicate()
    assert process.returncode == ExitCode.SYSTEM, errors
    assert errors.splitlines()[-1] == f"error: {KILLED}"
    assert "Traceback" not in errors


@pytest.mark.evidence
def test_processes_end_with_the_command_that_is_killed(tmp_path: Path) -> None:
    with at_work("faults", tmp_path) as process:  # whose processes have copies of their own
        a_worker(process, 0.1)
        process.kill()
        process.communicate()
    while in_session(process.pid):
        time.sleep(0.02)
