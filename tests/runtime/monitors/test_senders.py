from dataclasses import dataclass, field

import pytest

from utank_hil.canbus import Rejection
from utank_hil.runtime.monitors.finding import Finding
from utank_hil.runtime.monitors.senders import Senders, Stream

STEP_S = 0.1


@dataclass
class Counted:
    cycle_ns: int = 10_000_000
    heard: int = 0
    lost: int = 0
    can_id: int = 1
    rejected: dict[Rejection, int] = field(default_factory=lambda: dict.fromkeys(Rejection, 0))


def first_found(
    heard: float,
    lost: float,
    cycle_ms: int = 10,
    seconds: float = 5.0,
    what: Finding = Finding.SECOND_SENDER | Finding.NODE_SILENT,
) -> float | None:
    """When a stream is found that hears and loses so many frames every ten cycles."""
    counted = Counted(cycle_ms * 1_000_000)
    senders = Senders([Stream(counted, silent_s=1.0)], 1700.0)
    for k in range(1, round(seconds / STEP_S) + 1):
        share = k * STEP_S / (10 * cycle_ms * 1e-3)
        counted.heard, counted.lost = int(heard * share), int(lost * share)
        if senders.update(0, STEP_S) & what:
            return k * STEP_S
    return None


def test_message_at_its_cycle_is_left_alone_lost_frames_or_not() -> None:
    for heard in (10, 7, 5):
        assert first_found(heard, 10 - heard) is None


@pytest.mark.parametrize(
    ("share", "cycle_ms", "within_s"),
    [(0.05, 10, 1.3), (0.005, 10, 14.4), (0.05, 100, 12.4), (0.0009, 10, None), (0.0, 10, None)],
)
def test_more_than_one_frame_of_a_thousand_lost_is_found(
    share: float, cycle_ms: int, within_s: float | None
) -> None:
    found_s = first_found(
        10 * (1 - share), 10 * share, cycle_ms, seconds=60.0, what=Finding.FRAMES_LOST
    )
    assert (found_s is None) is (within_s is None)
    assert found_s is None or within_s is None or 0.6 * within_s <= found_s <= within_s


def test_frames_lost_once_are_left_alone_and_a_loss_that_ended_is_forgotten() -> None:
    counted = Counted()
    senders = Senders([Stream(counted)], 1700.0)
    found = []
    for k in range(1, 800):
        counted.heard = 10 * k
        # five at once, and later 50 % for a while
        counted.lost = 0 if k < 10 else 5 if k < 600 else 5 + 5 * min(k - 600, 50)
        found.append(bool(senders.update(0, STEP_S) & Finding.FRAMES_LOST))
    assert not any(found[:600])
    assert all(found[605:650])
    assert not any(found[755:])


@pytest.mark.parametrize("cycle_ms", [10, 20])
@pytest.mark.parametrize(("share", "found"), [(0.5, True), (0.7, True), (0.8, False), (0.0, False)])
def test_message_slower_than_its_cycle_is_found_as_frames_lost(
    share: float, found: bool, cycle_ms: int
) -> None:
    found_s = first_found(10 * share, 0, cycle_ms, what=Finding.FRAMES_LOST)
    assert (found_s is not None) is found
    assert found_s is None or 2.0 < found_s < 2.5


def test_a_pause_is_no_slow_sender_and_one_that_ended_is_forgotten() -> None:
    counted = Counted()
    senders = Senders([Stream(counted)], 1700.0)
    found = []
    for k in range(100):
        counted.heard += 10 if k < 10 or 30 <= k < 40 or k >= 70 else 0 if k < 30 else 5
        found.append(bool(senders.update(0, STEP_S) & Finding.FRAMES_LOST))
    assert not any(found[:60])
    assert all(found[62:70])
    assert not any(found[73:])


@pytest.mark.parametrize(("cycle_ms", "within_s"), [(10, 0.31), (20, 0.41), (100, 1.7)])
def test_second_sender_doubles_the_pace(cycle_ms: int, within_s: float) -> None:
    found_s = first_found(20, 0, cycle_ms)
    assert found_s is not None
    assert found_s <= within_s


def test_counter_that_skips_runs_ahead_of_the_cycle() -> None:
    found_s = first_found(10, 30)
    assert found_s is not None
    assert found_s <= 0.21


def test_frames_that_waited_while_the_controller_did_are_no_second_sender() -> None:
    counted = Counted()
    senders = Senders([Stream(counted)], 1700.0)
    counted.heard = 10
    senders.update(0, STEP_S)
    counted.heard += 200
    assert not senders.update(0, 2.0)


def test_frames_before_the_first_look_do_not_count() -> None:
    counted = Counted(heard=280)
    assert not Senders([Stream(counted)], 1700.0).update(0, STEP_S)


def test_silent_node_is_found_after_a_second() -> None:
    counted = Counted(100_000_000, heard=5)
    senders = Senders([Stream(counted, silent_s=1.0)], 1700.0)
    found = [senders.update(0, STEP_S) for _ in range(14)]
    assert found.index(Finding.NODE_SILENT) in (10, 11)


@pytest.mark.parametrize(("share", "expected"), [(0.05, False), (0.3, True), (0.8, True)])
def test_frames_of_nobody_are_a_flood(share: float, expected: bool) -> None:
    senders, found = Senders([], 1700.0), 0
    for k in range(1, 13):
        found |= senders.update(int(share * 1700.0 * k * STEP_S), STEP_S)
    assert bool(found & Finding.FLOOD) is expected


@pytest.mark.parametrize(("every_s", "found"), [(0.2, True), (0.3, True), (0.6, False)])
def test_three_frames_a_second_with_a_wrong_crc_are_found(every_s: float, found: bool) -> None:
    counted = Counted()
    senders = Senders([Stream(counted)], 1700.0)
    seen = 0
    for k in range(1, 51):
        counted.heard = 10 * k
        counted.rejected[Rejection.CRC] = int(k * STEP_S / every_s)
        counted.rejected[Rejection.REPEATED] = k  # others do not count
        seen |= senders.update(0, STEP_S)
    assert bool(seen & Finding.DAMAGED) is found
