"""The set-up of the loop process; each case in a process of its own, which it may spoil."""

import json
import subprocess
import sys
import threading

import pytest

from utank_hil.runners import real_time_scheduling

pytestmark = pytest.mark.slow

STATE = """
import gc, json, os, pathlib, resource, sys
from utank_hil.runners import real_time_scheduling

at_start = gc.get_freeze_count()  # Python 3.12.1 has some

def state():
    status = pathlib.Path("/proc/self/status").read_text().splitlines()
    locked = next(int(line.split()[1]) for line in status if line.startswith("VmLck"))
    latency = any(os.path.realpath(f"/proc/self/fd/{fd}") == "/dev/cpu_dma_latency"
                  for fd in os.listdir("/proc/self/fd"))
    return {"policy": os.sched_getscheduler(0) & ~os.SCHED_RESET_ON_FORK,
            "priority": os.sched_getparam(0).sched_priority, "locked": locked > 0,
            "latency": latency, "gc": gc.isenabled(), "frozen": gc.get_freeze_count() > at_start}

before = state()
"""

HOLD = """
with real_time_scheduling() as report:
    inside = state()
    named = [line.partition(": ") for line in report]
    measures = {name: [said.startswith("yes"), said.partition(", ")[2]] for name, _, said in named}
print(json.dumps([before, inside, state(), measures]))
"""

UNPRIVILEGED = """
for limit in (resource.RLIMIT_RTPRIO, resource.RLIMIT_MEMLOCK):
    resource.setrlimit(limit, (0, 0))
if os.geteuid() == 0:
    os.setgroups([])
    os.setresgid(65534, 65534, 65534)
    os.setresuid(65534, 65534, 65534)
"""


def run(script):
    done = subprocess.run(
        [sys.executable, "-c", STATE + script], capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout)


def test_report_says_what_is_really_in_force():
    _, inside, _, measures = run(HOLD)
    assert (inside["policy"] == 1) == measures["SCHED_FIFO"][0]  # SCHED_FIFO is 1
    assert (inside["priority"] == 80) == measures["SCHED_FIFO"][0]
    assert inside["locked"] == measures["memory locked"][0]
    assert inside["latency"] == measures["no deep CPU sleep"][0]
    assert inside["frozen"]
    assert not inside["gc"]


def test_children_start_without_real_time_priority():
    assert (
        run(
            """
import subprocess
with real_time_scheduling():
    policy = subprocess.run([sys.executable, "-c", "import os; print(os.sched_getscheduler(0))"],
                            capture_output=True, text=True, check=True).stdout
print(json.dumps(int(policy)))
"""
        )
        == 0
    )


def test_everything_is_undone_at_the_end():
    before, _, after, *_ = run(HOLD)
    assert after == before


def test_everything_is_undone_after_an_exception():
    before, after = run(
        """
try:
    with real_time_scheduling():
        raise KeyError
except KeyError:
    print(json.dumps([before, state()]))
"""
    )
    assert after == before


def test_without_permission_it_says_why_and_goes_on():
    before, inside, after, measures = run(UNPRIVILEGED + HOLD)
    assert measures["SCHED_FIFO"] == [
        False,
        "real-time priority limit is 0, needs 80 (LimitRTPRIO=)",
    ]
    assert measures["memory locked"][0] is False
    assert "LimitMEMLOCK=infinity" in measures["memory locked"][1]
    assert measures["no deep CPU sleep"][0] is False
    assert measures["garbage collector off"][0] is True
    assert (inside["policy"], inside["locked"], inside["gc"]) == (0, False, False)
    assert after == before
    assert len(measures) == 4


def test_collector_that_was_off_stays_off():
    assert (
        run(
            """
gc.disable()
with real_time_scheduling():
    pass
print(json.dumps(gc.isenabled()))
"""
        )
        is False
    )


def test_another_python_thread_is_refused_by_name():
    release = threading.Event()
    thread = threading.Thread(target=release.wait, name="notifier")
    thread.start()
    try:
        with pytest.raises(RuntimeError, match="notifier"), real_time_scheduling():
            pass
    finally:
        release.set()
        thread.join()
