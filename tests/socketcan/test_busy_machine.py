"""What fails is tried again where the machine did not keep time, and fails at once where it did."""

import busy_machine
import pytest
from busy_machine import ATTEMPTS, Timekeeping, first_that_can_be_judged, judged_by


class Clock:
    """Time that passes by itself, and more of it with each nap."""

    def __init__(self, late_s):
        self.now_s, self.late_s = 0.0, late_s

    def monotonic(self):
        return self.now_s

    def sleep(self, seconds):
        self.now_s += seconds + self.late_s


@pytest.fixture
def machine_late_by(monkeypatch):
    def make(late_s, after_naps=1000):
        clock = Clock(0.0)
        monkeypatch.setattr(busy_machine, "time", clock)
        machine = Timekeeping()
        for _ in range(after_naps):
            machine.nap()
        clock.late_s = late_s
        machine.nap()
        return machine

    monkeypatch.setattr(busy_machine, "RETRIED", [])
    return make


@pytest.mark.parametrize(
    ("late_s", "naps", "kept"),
    [(0.0, 1000, True), (0.03, 1000, True), (0.04, 1000, False), (0.03, 50, False)],
)
def test_machine_keeps_time_unless_it_takes_long_or_often(machine_late_by, late_s, naps, kept):
    assert (machine_late_by(late_s, naps).failure() == "") == kept


def test_failure_on_a_punctual_machine_is_a_failure_at_once(machine_late_by, tmp_path):
    def attempt(folder):
        with judged_by(machine_late_by(0.0).failure):
            assert folder.name == "never"

    with pytest.raises(AssertionError, match="never"):
        first_that_can_be_judged(attempt, tmp_path)
    assert busy_machine.RETRIED == []


def test_busy_machine_is_tried_again_and_said(machine_late_by, tmp_path):
    def attempt(folder):
        with judged_by(machine_late_by(0.5).failure):
            assert folder.name == "2", "the ship is not found"
        return folder.name

    assert first_that_can_be_judged(attempt, tmp_path) == "2"
    assert len(busy_machine.RETRIED) == 2
    assert "for 495 ms at a time (30 ms allowed); then: the ship is not" in busy_machine.RETRIED[0]


def test_machine_that_stays_busy_is_the_reason_of_the_failure(machine_late_by, tmp_path):
    def attempt(folder):
        with judged_by(machine_late_by(0.5).failure):
            raise AssertionError

    with pytest.raises(pytest.fail.Exception, match="machine too busy to judge, 3 times; at last"):
        first_that_can_be_judged(attempt, tmp_path)
    assert len(busy_machine.RETRIED) == ATTEMPTS
