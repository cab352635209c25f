"""What follows from the frames of a live bus: from logs made by hand."""

from types import SimpleNamespace
from typing import ClassVar

import pytest

from firmware_sim.live_faults import rows
from firmware_sim.live_faults.bench import LiveError, LiveLog, LiveTimes, times_of
from utank_hil.canbus import DriveState, Mode

FAULT_S = 100.0
OFF = DriveState.FAULT


def every(cycle_s, begin_s, end_s):
    return [begin_s + index * cycle_s for index in range(round((end_s - begin_s) / cycle_s))]


def log_of(commands=None, motions=None, off_s=1000000000.0, faulted_s=1000000000.0):
    """A log from 99 s to 103 s."""
    return LiveLog(
        every(0.02, 99.0, 103.0) if commands is None else commands,
        every(0.01, 99.0, 103.0) if motions is None else motions,
        [(t, Mode.FAULT if t >= faulted_s else Mode.ACTIVE) for t in every(0.1, 99.0, 103.0)],
        [(t, OFF if t >= off_s else DriveState.OPERATION_ENABLED) for t in every(0.02, 99.0, 103)],
    )


def told(log, **changed):
    chosen = {"silences": "commands", "judged": "zero", **changed}
    return times_of(log, FAULT_S, 103.0, **chosen)


def test_times_count_from_the_last_frame_of_who_was_silenced():
    sent = every(0.02, 99.0, 100.0)
    log = log_of(sent, off_s=100.071)
    assert told(log).zero_ms == pytest.approx(100.08e3 - 99.98e3, abs=0.1)
    late = log_of(
        [*every(0.02, 99.0, 99.985), 100.002, 101.1], off_s=100.071
    )  # on its way; SIGCONT
    assert told(late).zero_ms == pytest.approx(78.0, abs=0.1)


def test_times_count_from_the_signal_where_nobody_is_silenced():
    times = told(log_of(off_s=100.25, faulted_s=100.1), silences=None)
    assert times.zero_ms == pytest.approx(260.0, abs=0.1)
    assert times.found_ms == pytest.approx(100.0, abs=0.1)


def test_what_was_off_before_the_fault_does_not_count():
    log = log_of()
    log.states.insert(0, (99.5, OFF))
    log.modes.insert(0, (99.5, Mode.FAULT))
    assert told(log) == LiveTimes(None, None, 0.0)


@pytest.mark.parametrize("judged", ["found", "zero"])
def test_a_process_that_was_held_up_shows_in_its_frames(judged):
    motions = [t for t in every(0.01, 99.0, 103.0) if not 100.02 < t < 100.2]
    log = log_of(motions=motions, off_s=100.21, faulted_s=100.3)
    assert told(log, judged=judged).held_up_ms == pytest.approx(170.0, abs=0.2)
    after = [t for t in every(0.01, 99.0, 103.0) if not 100.5 < t < 100.9]
    assert told(log_of(motions=after, off_s=100.21, faulted_s=100.3)).held_up_ms < 0.2
    # the silence that was made is no holding up
    silent = log_of(motions=every(0.01, 99.0, 100.0), faulted_s=100.15)
    times = told(silent, silences="motions", judged="found")
    assert times.held_up_ms < 0.2
    assert times.found_ms == pytest.approx(210.0, abs=0.2)


class Bench:
    """Of a controller that never comes into charge, or in its last start."""

    starts: list["Bench"]

    def __init__(self, *_):
        self.start, self.log, self.code = 1, log_of(), None
        self.controller = self.ship = SimpleNamespace(poll=lambda: self.code)
        self.starts.append(self)

    def close(self):
        pass

    def wait_in_charge(self):
        if len(self.starts) < rows.STARTS:
            raise LiveError("OVERRUN before there was a fault")


@pytest.mark.parametrize(
    ("missing_s", "code", "starts"), [(0.2, None, 3), (0.0, None, 1), (0.2, 1, 1)]
)
def test_only_a_start_that_the_machine_spoilt_is_made_again(missing_s, code, starts, monkeypatch):
    """A program that ends, or a fault that has another cause, fails the row."""
    made: list[Bench] = []

    class Spoilt(Bench):
        starts = made

        def __init__(self, *_):
            super().__init__()
            self.code = code
            if missing_s:
                kept = [t for t in self.log.motions if not 101 < t < 101 + missing_s]
                self.log.motions[:] = kept

    monkeypatch.setattr(rows, "LiveBench", Spoilt)
    if starts == rows.STARTS:
        with rows.in_charge("vcan0"):
            assert len(made) == starts
    else:
        with pytest.raises(LiveError, match="OVERRUN"), rows.in_charge("vcan0"):
            raise AssertionError
    assert len(made) == starts


@pytest.mark.parametrize(
    ("judged", "times", "said"),
    [
        ("found", (None, 90.0), "was not found; instead: the drive stopped after 90 ms; at the"),
        (
            "zero",
            (80.0, None),
            "the drive went on; instead: FAULT after 80 ms; at the end FAULT, no fault",
        ),
        ("zero", (None, None), "the drive went on; at the end"),
    ],
)
def test_what_happened_instead_is_said(monkeypatch, judged, times, said):
    class Watched(Bench):
        starts: ClassVar[list[Bench]] = []
        mode, fault, state, in_charge = Mode.FAULT, "", OFF, False

        def wait_in_charge(self):
            pass

        def watch(self, _):
            return 1.0

    monkeypatch.setattr(rows, "LiveBench", Watched)
    monkeypatch.setattr(rows, "times_of", lambda *_, **__: LiveTimes(*times, 0.0))
    row = rows.LiveRow(lambda _: None, 100.0, judged=judged)
    assert rows.attempted(row, "vcan0")[0][0].startswith(said)


@pytest.mark.parametrize(
    ("attempts", "passed", "tried"),
    [
        ([([], 500.0)], True, 1),
        ([(["after 130 ms"], 0.0)], False, 1),
        ([(["after 130 ms"], 40.0), ([], 0.0)], True, 2),
        ([(["after 130 ms"], 40.0), (["after 140 ms"], 0.0)], False, 2),
        ([(["after 130 ms"], 40.0)] * 4, False, 3),
    ],
)
def test_only_what_the_machine_spoilt_is_tried_again(monkeypatch, attempts, passed, tried):
    waiting = list(attempts)

    def attempt(row, bus):
        problems, held_up_ms = waiting.pop(0)
        return [*problems], LiveTimes(None, 130.0, held_up_ms)

    monkeypatch.setattr(rows, "attempted", attempt)
    told = rows.as_json("live-controller-killed", rows.ROWS["live-controller-killed"], "vcan0")
    problems = told["problems"]
    assert told["verdict"] == ("pass" if passed else "fail")
    assert (told["zero_ms"], told["zero_limit_ms"], told["limit_ms"]) == (130.0, 120, None)
    assert (not problems) is passed
    assert len(attempts) - len(waiting) == tried
    held_up = any("the machine held processes up for 40 ms" in each for each in problems)
    assert held_up is (tried == 3)
