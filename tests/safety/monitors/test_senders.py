from dataclasses import dataclass, field

import pytest

from utank_hil.canbus import Rejection
from utank_hil.safety.monitors.finding import Finding
from utank_hil.safety.monitors.senders import Senders, Stream

STEP_S = 0.1


@dataclass
class Counted:
    cycle_ns: int = 10_000_000
    heard: int = 0
    lost: int = 0
    changes: int = 0
    can_id: int = 1
    may_speak: bool = True
    rejected: dict[Rejection, int] = field(default_factory=lambda: dict.fromkeys(Rejection, 0))


def first_found(
    heard, lost, cycle_ms=10, seconds=5.0, what=Finding.SECOND_SENDER | Finding.NODE_SILENT
):
    """When a stream is found that hears and loses so many frames every ten cycles."""
    counted = Counted(cycle_ms * 1_000_000)
    senders = Senders([Stream(counted, silent_s=1.0)], 1700.0)
    for k in range(1, round(seconds / STEP_S) + 1):
        share = k * STEP_S / (10 * cycle_ms * 1e-3)
        counted.heard, counted.lost = int(heard * share), int(lost * share)
        if senders.update(0, STEP_S) & what:
            return k * STEP_S
    return None


def test_message_at_its_cycle_is_left_alone_lost_frames_or_not():
    for heard in (10, 7, 5):
        assert first_found(heard, 10 - heard) is None


@pytest.mark.parametrize(
    ("share", "cycle_ms", "within_s"),
    [(0.05, 10, 1.3), (0.005, 10, 14.4), (0.05, 100, 12.4), (0.0009, 10, None), (0.0, 10, None)],
)
def test_more_than_one_frame_of_a_thousand_lost_is_found(share, cycle_ms, within_s):
    found_s = first_found(
        10 * (1 - share), 10 * share, cycle_ms, seconds=60.0, what=Finding.FRAMES_LOST
    )
    assert (found_s is None) is (within_s is None)
    assert found_s is None or within_s is None or 0.6 * within_s <= found_s <= within_s


def test_frames_lost_once_are_left_alone_and_a_loss_that_ended_is_forgotten():
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
def test_message_slower_than_its_cycle_is_found_as_frames_lost(share, found, cycle_ms):
    found_s = first_found(10 * share, 0, cycle_ms, what=Finding.FRAMES_LOST)
    assert (found_s is not None) is found
    assert found_s is None or found_s < 1.2


@pytest.mark.parametrize(("share", "found"), [(0.5, True), (0.8, False)])
def test_message_with_a_long_cycle_that_is_slower_is_found_after_two_seconds(share, found):
    found_s = first_found(10 * share, 0, 100, what=Finding.FRAMES_LOST)
    assert (found_s is not None) is found
    assert found_s is None or 2.0 < found_s < 2.5


def test_bursts_too_long_for_the_counter_are_found_and_a_silence_is_not():
    """Seven frames of four hundred: the counter does not count them as lost."""
    for gap, found_s in ((7, 4.3), (2, None), (40, None)):
        counted = Counted()
        senders = Senders([Stream(counted)], 1700.0)
        first = None
        for k in range(1, 201):
            missing = max(min(gap - 10 * (k % 40), 10), 0) if k % 40 < 4 else 0
            counted.heard += 10 - missing
            if senders.update(0, STEP_S) & Finding.FRAMES_LOST and first is None:
                first = k * STEP_S
        assert first == (None if found_s is None else pytest.approx(found_s))


def paced(*heard, cycle_ns=10_000_000, every_s=STEP_S):
    """What a stream finds of so many frames in each look."""
    counted = Counted(cycle_ns)
    stream, found = Stream(counted), []
    for frames in heard:
        counted.heard += frames
        found.append(stream.update(every_s) & Finding.FRAMES_LOST)
    return found


def test_a_burst_counts_when_the_next_frames_come_and_only_of_a_sender_that_was_heard():
    lost = Finding.FRAMES_LOST
    assert paced(10, 3, 10) == [0, 0, lost]
    assert paced(10, 8, 10) == paced(3, 10, 10) == paced(0, 3, 10) == [0, 0, 0]
    assert paced(0, 1, 3, 10) == [0, 0, 0, lost]
    assert not any(paced(*[10, 0] * 10))
    assert not any(paced(*[10, 3, 0] * 10))
    # eight cycles are enough
    assert paced(8, 2, 8, cycle_ns=125_000_000, every_s=1.0) == [0, 0, lost]
    assert paced(8, 2, 8, cycle_ns=125_000_000, every_s=0.99) == [0, 0, 0]


def test_a_sender_that_begins_or_ends_between_two_looks_has_no_gap():
    counted = Counted()
    stream = Stream(counted)
    found = 0
    for heard in (0, 3, 10, 10, 2, 0, 0, 1, 10, 10, 5, 0):
        counted.heard += heard
        found |= stream.update(STEP_S)
    assert found == 0


def test_a_pause_is_no_slow_sender_and_one_that_ended_is_forgotten():
    counted = Counted()
    senders = Senders([Stream(counted)], 1700.0)
    found = []
    for k in range(100):
        counted.heard += 10 if k < 10 or 30 <= k < 40 or k >= 70 else 0 if k < 30 else 5
        found.append(bool(senders.update(0, STEP_S) & Finding.FRAMES_LOST))
    assert not any(found[:41])
    assert all(found[44:70])


@pytest.mark.parametrize(("cycle_ms", "within_s"), [(10, 0.31), (20, 0.41), (100, 1.7)])
def test_second_sender_doubles_the_pace(cycle_ms, within_s):
    found_s = first_found(20, 0, cycle_ms)
    assert found_s is not None
    assert found_s <= within_s


def panel(frames_per_s, changes_per_s, rejected_per_s=0.0):
    """When a panel's stream is found, that sends on changes of its levers beside its cycle."""
    counted = Counted(200_000_000)
    senders = Senders([Stream(counted)], 1700.0)
    for k in range(1, 600):
        counted.heard = int(frames_per_s * k * STEP_S)
        counted.changes = int(changes_per_s * k * STEP_S)
        counted.rejected[Rejection.REPEATED] = int(rejected_per_s * k * STEP_S)
        if senders.update(0, STEP_S) & Finding.SECOND_SENDER:
            return k * STEP_S
    return None


@pytest.mark.parametrize("changes_per_s", [2, 5, 20])
def test_frames_on_a_change_may_come_beside_the_cycle(changes_per_s):
    assert panel(5 + changes_per_s, changes_per_s) is None
    assert panel(5 + changes_per_s, 0) is not None


def test_more_than_twenty_changes_a_second_are_counted():
    assert panel(5 + 24, 24) is not None


def test_what_was_rejected_or_changed_before_says_nothing_of_now():
    counted = Counted(200_000_000, heard=90, changes=50)
    counted.rejected[Rejection.REPEATED] = 7
    senders = Senders([Stream(counted)], 1700.0)
    found = []
    for k in range(200):
        counted.heard += 1  # ten a second, of which five are of the cycle
        counted.changes += k % 2 if k < 100 else 0
        found.append(bool(senders.update(0, STEP_S) & Finding.SECOND_SENDER))
    assert not any(found[:100])
    assert any(found[100:130])


def test_changes_are_no_excuse_for_a_flood_nor_for_a_second_sender():
    flood_s = panel(100, 95)
    assert flood_s is not None
    assert flood_s < 0.5
    # two panels that contradict each other: of each pair one frame is rejected
    second_s = panel(10, 5, rejected_per_s=5)
    assert second_s is not None
    assert second_s < 3.0


def test_counter_that_skips_runs_ahead_of_the_cycle():
    found_s = first_found(10, 30)
    assert found_s is not None
    assert found_s <= 0.21


def test_frames_that_waited_while_the_controller_did_are_no_second_sender():
    counted = Counted()
    senders = Senders([Stream(counted)], 1700.0)
    counted.heard = 10
    senders.update(0, STEP_S)
    counted.heard += 200
    assert not senders.update(0, 2.0)


def test_frames_before_the_first_look_do_not_count():
    counted = Counted(heard=280)
    assert not Senders([Stream(counted)], 1700.0).update(0, STEP_S)


def test_silent_node_is_found_after_a_second():
    counted = Counted(100_000_000, heard=5)
    senders = Senders([Stream(counted, silent_s=1.0)], 1700.0)
    found = [senders.update(0, STEP_S) for _ in range(14)]
    assert found.index(Finding.NODE_SILENT) in (10, 11)


def test_a_device_that_may_not_speak_yet_is_silent_from_when_it_may():
    counted = Counted(CYCLE_NS, may_speak=False)
    stream = Stream(counted, silent_s=1.0)
    assert [stream.update(0.5) for _ in range(9)] == [0] * 9
    counted.may_speak = True
    assert [stream.update(0.5) for _ in range(4)] == [0, 0, SILENT, SILENT]


@pytest.mark.parametrize(("share", "expected"), [(0.05, False), (0.3, True), (0.8, True)])
def test_frames_of_nobody_are_a_flood(share, expected):
    senders, found = Senders([], 1700.0), 0
    for k in range(1, 13):
        found |= senders.update(int(share * 1700.0 * k * STEP_S), STEP_S)
    assert bool(found & Finding.FLOOD) is expected


@pytest.mark.parametrize(("every_s", "found"), [(0.2, True), (0.3, True), (0.6, False)])
def test_three_frames_a_second_with_a_wrong_crc_are_found(every_s, found):
    counted = Counted()
    senders = Senders([Stream(counted)], 1700.0)
    seen = 0
    for k in range(1, 51):
        counted.heard = 10 * k
        counted.rejected[Rejection.CRC] = int(k * STEP_S / every_s)
        counted.rejected[Rejection.REPEATED] = k  # others do not count
        seen |= senders.update(0, STEP_S)
    assert bool(seen & Finding.DAMAGED) is found


CYCLE_NS = 125_000_000
"""Four in a look of half a second: nothing is rounded."""


def looks(*came, silent_s=1.0):
    """What a stream finds, every half a second, of so many frames heard and lost since then."""
    counted = Counted(CYCLE_NS, heard=7, lost=3)
    stream, found = Stream(counted, silent_s=silent_s), []
    for heard, lost in came:
        counted.heard += heard
        counted.lost += lost
        found.append(stream.update(0.5))
    return found


SECOND, LOST, SILENT = Finding.SECOND_SENDER, Finding.FRAMES_LOST, Finding.NODE_SILENT


@pytest.mark.parametrize("looks_before", [0, 3])
def test_more_than_eight_frames_above_a_quarter_are_a_second_sender_and_soon_forgotten(
    looks_before,
):
    before = [(4, 0)] * looks_before
    none = [0] * looks_before
    assert looks(*before, (5 + 8, 0)) == [*none, 0]
    assert looks(*before, (5 + 9, 0)) == [*none, SECOND]
    assert looks(*before, (5 + 4, 0), (5 + 5, 0)) == [*none, 0, SECOND]
    assert looks(*before, (999, 0), (0, 0), (0, 0)) == [*none, SECOND, SECOND, 0]
    # lost ones too, of which five are besides too many
    assert looks(*before, (13, 1)) == [*none, SECOND]


def test_fewer_than_three_quarters_for_more_than_two_seconds_are_frames_lost():
    assert looks(*[(2, 0)] * 5) == [0, 0, 0, 0, LOST]
    assert looks(*[(3, 0)] * 5) == looks(*[(1, 2)] * 1, *[(3, 0)] * 4) == [0] * 5
    assert looks(*[(2, 0)] * 4, (3, 0), *[(2, 0)] * 5) == [0] * 9 + [LOST]
    # a silence is not counted and ends nothing
    assert looks(*[(2, 0)] * 4, (0, 0), (2, 0)) == [0] * 5 + [LOST]


def test_a_silence_of_more_than_its_limit_is_found_until_a_frame_comes():
    quiet = [(0, 0)] * 3
    assert looks(*quiet, (4, 0), *quiet) == [0, 0, SILENT, 0, 0, 0, SILENT]
    assert looks(*[(0, 0)] * 9, silent_s=3.75) == [0] * 7 + [SILENT] * 2
    assert looks(*[(2, 0)] * 5, *quiet) == [0] * 4 + [LOST] * 3 + [LOST | SILENT]


@pytest.mark.parametrize("looks_before", [0, 3])
def test_more_than_five_above_a_thousandth_are_frames_lost_and_forgotten_in_a_thousand(
    looks_before,
):
    before = [(4, 0)] * looks_before

    def lost(*came):
        return [bool(found & LOST) for found in looks(*before, *came)[looks_before:]]

    assert lost((994, 6)) == [False]
    assert lost((993, 6)) == [True]
    assert lost((4, 5)) == [False]
    assert lost((4, 3), (4, 3)) == [False, True]
    assert lost((4, 99), (999, 0), (4, 0)) == [True, True, False]
    assert lost((4, 99), (1000, 0)) == [True, False]


def test_a_stream_that_nobody_awaits_may_be_silent_and_has_no_damaged_frame_before_a_look():
    counted = Counted(CYCLE_NS, rejected=dict.fromkeys(Rejection, 0) | {Rejection.CRC: 5})
    stream = Stream(counted)
    assert stream.damaged == 0
    assert not any(stream.update(10.0) for _ in range(10))
    assert stream.damaged == 0


def test_a_wrong_proof_of_the_key_is_found_in_its_look_alone():
    counted = Counted(CYCLE_NS, rejected=dict.fromkeys(Rejection, 0) | {Rejection.PROOF: 5})
    stream, found = Stream(counted), []
    for proofs in (0, 1, 0, 2, 0):
        counted.heard += 4
        counted.rejected[Rejection.PROOF] += proofs
        found.append(stream.update(0.5))
    assert found == [0, Finding.WRONG_PROOF, 0, Finding.WRONG_PROOF, 0]


@pytest.mark.parametrize("quiet", range(4))
def test_every_stream_is_looked_at_in_every_second_call(quiet):
    streams = [Counted(CYCLE_NS) for _ in range(4)]
    senders = Senders([Stream(each, silent_s=1.0) for each in streams], 1600.0)
    found = []
    for k in range(10):
        for index, each in enumerate(streams):
            each.heard += 2 * (index != quiet or k >= 6)
        found.append(senders.update(0, 0.25))
    # half a second a look, in the first a quarter of the one, and said again in the next call
    if quiet % 2 == 0:
        assert found == [0] * 4 + [SILENT] * 2 + [0] * 4
    else:
        assert found == [0] * 5 + [SILENT] * 2 + [0] * 3


def test_a_look_spans_both_calls_however_long_each_was():
    senders = Senders([Stream(Counted(CYCLE_NS), silent_s=1.0), Stream(Counted())], 1600.0)
    calls_s = (0.25, 0.125, 0.5, 0.125, 0.0625, 0.5)
    assert [senders.update(0, each_s) for each_s in calls_s] == [0, 0, 0, 0, SILENT, SILENT]


def damage(frames, step_s=0.25):
    """Whether so many damaged frames in each call are found."""
    counted = Counted(CYCLE_NS, heard=1)
    senders, found = Senders([Stream(counted)], 1600.0), []
    for each in frames:
        counted.rejected[Rejection.CRC] += each
        found.append(bool(senders.update(0, step_s) & Finding.DAMAGED))
    return found


def test_three_damaged_frames_within_a_second_are_found_and_forgotten_after_it():
    # looked at in every second call
    assert damage([3, *[0] * 7]) == [True] * 5 + [False] * 3
    assert damage([2, *[0] * 7]) == [False] * 8
    assert damage([99, *[0] * 7]) == [True] * 5 + [False] * 3
    assert damage([1, 0, 1, 0, 1, 0, 0]) == [False] * 4 + [True] + [False] * 2
    assert damage([2, 0, 0, 0, 1, 0, 0]) == [False] * 4 + [True] + [False] * 2
    assert damage([2, 0, 0, 0, 0, 0, 1]) == [False] * 7
    assert damage([1, 0, 2, 0, 0, 0, 0, 0]) == [False, False, True, True, True] + [False] * 3
    assert damage([3, 0, 0, 0, 1], step_s=0.3125) == [True] * 4 + [False]


@pytest.mark.parametrize("calls_before", [0, 3])
def test_more_than_forty_frames_above_a_tenth_of_the_bus_are_a_flood_and_soon_forgotten(
    calls_before,
):
    def floods(*new):
        senders, foreign, found = Senders((), 1600.0), 0, []
        for each in (*[40] * calls_before, *new):
            foreign += each
            found.append(senders.update(foreign, 0.25))
        assert found[:calls_before] == [0] * calls_before
        return found[calls_before:]

    assert floods(80) == [0]
    assert floods(81, 40, 39) == [Finding.FLOOD, Finding.FLOOD, 0]
    assert floods(999, 1, 0, 0) == [Finding.FLOOD, Finding.FLOOD, 0, 0]
    assert floods(0, 0, 0, 80) == [0] * 4


def test_a_flood_hides_nothing_else_that_is_found_in_this_call_or_the_one_before():
    senders = Senders([Stream(Counted(CYCLE_NS), silent_s=0.125)], 1600.0)
    assert [senders.update(999 * k, 0.25) for k in (1, 2)] == [Finding.FLOOD | SILENT] * 2


def test_what_came_before_the_beginning_is_not_judged():
    counted = Counted(heard=7, lost=3)
    senders = Senders([Stream(counted), Stream(Counted())], 1700.0)
    counted.heard, counted.lost = 1000, 500
    counted.rejected[Rejection.CRC] = 100
    senders.begin(10**6)
    for k in range(1, 20):
        counted.heard = 1000 + 10 * k
        assert not senders.update(10**6, STEP_S)
