import os
import signal
import subprocess
import sys
import time
import warnings
from itertools import pairwise

import pytest
from hypothesis import given
from hypothesis import strategies as st
from toy_nodes import MS, START_NS, FakeClock, SelectiveNode, ToyNode, ToyPort, frame

from utank_hil.runners import (
    LoopStatistics,
    MonotonicClock,
    NodeError,
    RealTimeLoop,
    stop_on_signals,
)


class Observer(ToyNode):
    """A node with both optional methods."""

    def __init__(self, name, last=None):
        super().__init__(name)
        self.errors: list[tuple[int, str]] = []
        self.last = last

    def link_error(self, now_ns, reason):
        self.errors.append((now_ns, reason))

    def stop(self, now_ns):
        return [] if self.last is None else [self.last]


def elapsed(node):
    """When the node ticked, in ms since the start."""
    return [(now_ns - START_NS) / MS for now_ns in node.ticked]


def test_ticks_lie_on_the_grid_from_the_start_to_the_end():
    fast, slow = ToyNode("fast"), ToyNode("slow", period_ns=25 * MS)
    loop = RealTimeLoop([slow, fast], clock=FakeClock())
    loop.run(duration_ns=60 * MS)
    assert elapsed(fast) == [0, 10, 20, 30, 40, 50]
    assert elapsed(slow) == [0, 25, 50]
    assert loop.statistics.ticks == 12  # the base is 5 ms
    assert loop.statistics.overruns == loop.statistics.skipped == 0


# What the machine does to one tick: how late it wakes, how long the tick takes, in us.
delays = st.lists(
    st.tuples(
        st.one_of(st.just(0), st.integers(0, 9_999), st.integers(0, 60_000)),
        st.one_of(st.just(0), st.integers(0, 9_999), st.integers(0, 60_000)),
    ),
    min_size=1,
    max_size=50,
)


def run_disturbed(disturbances, *nodes):
    """Run as many ticks as there are disturbances; note when each really began."""
    clock, begun = FakeClock(), []
    late = iter([late_us for late_us, _ in disturbances])
    busy = iter([busy_us for _, busy_us in disturbances])
    clock.late_ns = lambda: 1000 * next(late, 0)

    def says(now_ns):
        begun.append(clock.time_ns)
        clock.time_ns += 1000 * next(busy)
        return ()

    base = ToyNode("base", says=says)
    loop = RealTimeLoop([base, *nodes], clock=clock)
    loop.run(stop=lambda: len(base.ticked) == len(disturbances))
    return base, begun, loop.statistics, clock


@given(delays)
def test_grid_never_drifts_and_late_ticks_are_never_caught_up(disturbances):
    base, begun, _, clock = run_disturbed(disturbances)
    for now_ns, begun_ns in zip(base.ticked, begun, strict=True):
        assert (now_ns - START_NS) % (10 * MS) == 0
        assert 0 <= begun_ns - now_ns < 10 * MS  # each is the latest point of the grid
    assert all(later - earlier >= 10 * MS for earlier, later in pairwise(base.ticked))
    for waited_until_ns, (earlier, later) in zip(
        clock.sleeps_ns[1:], pairwise(begun), strict=False
    ):
        assert earlier < waited_until_ns <= later  # never back to back


@given(delays)
def test_every_point_of_the_grid_was_ticked_or_counted_as_skipped(disturbances):
    base, begun, statistics, _ = run_disturbed(disturbances)
    ended_ns = begun[-1] + 1000 * disturbances[-1][1]
    points = len(range(START_NS, max(ended_ns, base.ticked[-1] + 1), 10 * MS))
    assert statistics.ticks == len(base.ticked)
    assert statistics.ticks + statistics.skipped == points
    assert (statistics.overruns > 0) == (statistics.skipped > 0)


@given(delays, st.integers(1, 40))
def test_run_of_given_length_accounts_for_each_of_its_points_and_no_other(disturbances, points):
    clock = FakeClock()
    late = iter([late_us for late_us, _ in disturbances])
    busy = iter([busy_us for _, busy_us in disturbances])
    clock.late_ns = lambda: 1000 * next(late, 0)

    def says(_now_ns):
        clock.time_ns += 1000 * next(busy, 0)
        return ()

    base = ToyNode("base", says=says)
    loop = RealTimeLoop([base], clock=clock)
    loop.run(duration_ns=points * 10 * MS - 1)
    assert loop.statistics.ticks == len(base.ticked)
    assert loop.statistics.ticks + loop.statistics.skipped == points
    assert base.ticked[-1] < START_NS + points * 10 * MS


@given(delays)
def test_lateness_and_duration_are_what_happened(disturbances):
    _, begun, statistics, clock = run_disturbed(disturbances)
    lateness = [
        begun_ns - until_ns for begun_ns, until_ns in zip(begun, clock.sleeps_ns, strict=False)
    ]
    assert statistics.lateness.recent_ns == statistics.lateness.max_ns == max(lateness)
    assert statistics.duration.max_ns == 1000 * max(busy for _, busy in disturbances)
    assert statistics.duration.counts.sum() == len(disturbances)


@given(delays)
def test_slow_node_ticks_once_after_a_gap_and_returns_to_its_own_grid(disturbances):
    slow = ToyNode("slow", period_ns=30 * MS)
    base, *_ = run_disturbed(disturbances, slow)
    # By definition: it ticks with the first base tick at or after each point of its own grid.
    expected, passed = [], -1
    for now_ns in base.ticked:
        if (now_ns - START_NS) // (30 * MS) > passed:
            passed = (now_ns - START_NS) // (30 * MS)
            expected.append(now_ns)
    assert slow.ticked == expected


def test_arrived_frames_are_heard_by_every_node_before_it_ticks():
    port, order = ToyPort(), []
    node = ToyNode("a", says=lambda now: order.append("tick") or ())
    node.receive = lambda frame, now: order.append((frame.can_id, now))
    other = ToyNode("b")
    port.arriving = [frame(3), frame(1)]
    RealTimeLoop([node, other], port, clock=FakeClock(0)).run(duration_ns=1)
    assert order == [(3, 0), (1, 0), "tick"]
    assert other.heard == [(0, frame(3)), (0, frame(1))]


def test_sent_frames_go_out_and_to_the_siblings_but_not_back():
    port = ToyPort()
    nodes = [
        ToyNode(name, says=lambda now, can_id=can_id: [frame(can_id)])
        for can_id, name in enumerate("ab")
    ]
    loop = RealTimeLoop(nodes, port, clock=FakeClock(0))
    loop.run(duration_ns=20 * MS)
    assert port.sent == [frame(0), frame(1)] * 2
    assert nodes[0].heard == [(0, frame(1)), (10 * MS, frame(1))]
    assert nodes[1].heard == [(0, frame(0)), (10 * MS, frame(0))]
    assert loop.statistics.frames_sent == 4


def test_siblings_are_heard_after_the_tick_as_on_a_bus():
    talker, listener = ToyNode("talker", says=lambda now: [frame(1)]), ToyNode("listener")
    heard_at_tick: list[int] = []
    listener.says = lambda now: heard_at_tick.append(len(listener.heard)) or ()
    RealTimeLoop([talker, listener], clock=FakeClock()).run(duration_ns=30 * MS)
    assert heard_at_tick == [0, 1, 2]


def test_unreadable_bus_is_told_before_the_tick_and_the_loop_goes_on():
    port, watcher = ToyPort(), Observer("watcher")
    errors_at_tick: list[int] = []
    watcher.says = lambda now: errors_at_tick.append(len(watcher.errors)) or ()
    port.receive_fails = True
    loop = RealTimeLoop([watcher, ToyNode("other")], port, clock=FakeClock(0))
    loop.run(duration_ns=20 * MS)
    assert watcher.errors == [(0, "interface down"), (10 * MS, "interface down")]
    assert errors_at_tick == [1, 2]
    assert loop.statistics.receive_errors == 2


def test_refused_frame_is_told_counted_and_kept_from_the_siblings():
    port, watcher = ToyPort(), Observer("watcher")
    port.send_fails = True
    talker = ToyNode("talker", says=lambda now: [frame(1)])
    loop = RealTimeLoop([talker, watcher], port, clock=FakeClock(0))
    loop.run(duration_ns=20 * MS)
    assert watcher.errors == [(0, "transmit queue full"), (10 * MS, "transmit queue full")]
    assert watcher.heard == []
    assert (loop.statistics.send_errors, loop.statistics.frames_sent) == (2, 0)


def test_last_frames_go_out_when_the_loop_is_stopped():
    port = ToyPort()
    nodes = [ToyNode("a", says=lambda now: [frame(1)]), Observer("b", last=frame(2))]
    RealTimeLoop(nodes, port, clock=FakeClock()).run(stop=lambda: len(port.sent) == 2)
    assert port.sent == [frame(1), frame(1), frame(2)]


def test_last_frames_go_out_when_a_node_raises():
    port = ToyPort()
    broken = Observer("broken")
    broken.says = broken.stop = lambda now: 1 / 0
    nodes = [broken, Observer("sound", last=frame(2))]
    with pytest.raises(NodeError, match="'broken'"):
        RealTimeLoop(nodes, port, clock=FakeClock()).run()
    assert port.sent == [frame(2)]


def test_link_error_that_raises_is_named():
    port, watcher = ToyPort(), Observer("watcher")
    port.receive_fails = True
    watcher.link_error = lambda now, reason: 1 / 0
    with pytest.raises(NodeError, match="'watcher' failed in link_error"):
        RealTimeLoop([watcher], port, clock=FakeClock()).run()


def test_counts_into_the_statistics_handed_in():
    statistics = LoopStatistics()
    RealTimeLoop([ToyNode("a")], statistics=statistics, clock=FakeClock()).run(duration_ns=20 * MS)
    assert statistics.ticks == 2


@pytest.mark.parametrize(
    ("policy", "real_time"),
    [
        (os.SCHED_OTHER, False),
        (os.SCHED_RR, True),
        (os.SCHED_FIFO, True),
        (os.SCHED_FIFO | os.SCHED_RESET_ON_FORK, True),
    ],
)
def test_counts_whether_the_system_runs_the_loop_in_real_time(monkeypatch, policy, real_time):
    monkeypatch.setattr(os, "sched_getscheduler", lambda _pid: policy)
    loop = RealTimeLoop([ToyNode("a")], clock=FakeClock())
    loop.run(duration_ns=MS)
    assert loop.statistics.real_time is real_time


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
def test_signal_ends_the_loop_and_the_handlers_are_put_back(number):
    found = signal.getsignal(number)
    node = ToyNode("a")
    node.says = lambda now: (os.kill(os.getpid(), number) if len(node.ticked) == 3 else None) or ()
    with stop_on_signals() as stop:
        assert not stop()
        RealTimeLoop([node], clock=FakeClock()).run(stop)
        assert stop()
    assert len(node.ticked) == 3
    assert signal.getsignal(number) is found


def test_a_warning_in_the_loop_is_printed_nowhere(capfd):
    """A terminal that nobody reads would hold up the tick."""
    node = ToyNode("a")
    node.says = lambda now: warnings.warn("of the loop", stacklevel=1) or ()
    RealTimeLoop([node], clock=FakeClock()).run(duration_ns=50 * MS)
    assert "of the loop" not in capfd.readouterr().err
    with pytest.warns(UserWarning, match="outside"):
        warnings.warn("outside", stacklevel=1)


def test_a_sighup_that_is_ignored_stays_so_for_nohup():
    found = signal.signal(signal.SIGHUP, signal.SIG_IGN)
    try:
        with stop_on_signals() as stop:
            os.kill(os.getpid(), signal.SIGHUP)
            assert not stop()
            os.kill(os.getpid(), signal.SIGTERM)
            assert stop()
        assert signal.getsignal(signal.SIGHUP) is signal.SIG_IGN
    finally:
        signal.signal(signal.SIGHUP, found)


def test_clock_never_returns_early_even_if_the_system_does(monkeypatch):
    sleep = time.sleep
    monkeypatch.setattr(time, "sleep", lambda seconds: sleep(seconds / 2))
    clock = MonotonicClock()
    wanted_ns = clock.now_ns() + 5 * MS
    clock.sleep_until(wanted_ns)
    assert clock.now_ns() >= wanted_ns


def test_half_a_second_on_the_real_clock():
    node = ToyNode("a")
    loop = RealTimeLoop([node])
    began = time.monotonic()
    loop.run(duration_ns=500 * MS)
    assert time.monotonic() - began > 0.49
    assert loop.statistics.ticks + loop.statistics.skipped == 50
    assert all((now - node.ticked[0]) % (10 * MS) == 0 for now in node.ticked)


LOOP_PROCESS = """
import sys, threading
from utank_hil.runners import RealTimeLoop, real_time_scheduling

class Watcher:
    name, period_ns, threads = "watcher", 5_000_000, 0
    def receive(self, frame, now_ns): pass
    def tick(self, now_ns):
        self.threads = max(self.threads, len(threading.enumerate()))
        return ()

watcher = Watcher()
with real_time_scheduling():
    RealTimeLoop([watcher]).run(duration_ns=50_000_000)
heavy = {"numba", "matplotlib", "rerun", "control"} & set(sys.modules)
print(watcher.threads, sorted(heavy))
"""


@pytest.mark.slow
def test_loop_process_has_one_python_thread_and_no_compiler_or_plotting():
    run = subprocess.run(
        [sys.executable, "-c", LOOP_PROCESS], capture_output=True, text=True, check=True
    )
    assert run.stdout == "1 []\n"


def test_selective_node_hears_what_it_names_from_the_port_and_from_its_group():
    port = ToyPort()
    port.arriving = [frame(1), frame(2), frame(3)]
    selective = SelectiveNode("selective", hears=frozenset({2, 4}))
    other = ToyNode("other", says=lambda now: [frame(4), frame(5)])
    RealTimeLoop([selective, other], port, clock=FakeClock()).run(duration_ns=MS)
    assert [sent.can_id for _, sent in selective.heard] == [2, 4]
    assert [sent.can_id for _, sent in other.heard] == [1, 2, 3]
