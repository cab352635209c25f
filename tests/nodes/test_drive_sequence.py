import pytest

from firmware_sim.drive import DriveStates
from utank_hil.canbus import ControlWord, DriveFault, DriveState
from utank_hil.nodes.actuators import AT_REST, DISABLES, QUICK_STOPS, RESETS, DriveSequence

S, C = DriveState, ControlWord


def led(states, sequence, *, wanted, cycles=6):
    """States of a drive that hears each word and reports before the next."""
    passed = [states.state]
    for _ in range(cycles):
        states.command(sequence.next_word(states.state, wanted=wanted))
        passed.append(states.state)
        states.tick()
    return passed


@pytest.mark.parametrize("state", [*DriveState, None])
def test_nothing_but_a_wanted_drive_is_led_towards_enabled(state):
    word = DriveSequence().next_word(state, wanted=False)
    assert word in (C.DISABLE_VOLTAGE, C.QUICK_STOP)
    # while it drives or brakes; the voltage is taken away when it has stopped
    assert (word is C.QUICK_STOP) == (state in (S.OPERATION_ENABLED, S.QUICK_STOP_ACTIVE))


def test_wanted_drive_is_enabled_in_three_words_and_kept_there():
    states = DriveStates()
    states.tick()
    assert led(states, DriveSequence(), wanted=True) == [
        S.SWITCH_ON_DISABLED, S.READY_TO_SWITCH_ON, S.SWITCHED_ON, *[S.OPERATION_ENABLED] * 4,
    ]  # fmt: skip


def test_unwanted_drive_is_stopped_and_then_switched_off():
    states, sequence = DriveStates(), DriveSequence()
    states.tick()
    led(states, sequence, wanted=True)
    assert sequence.next_word(states.state, wanted=False) is C.QUICK_STOP
    assert led(states, sequence, wanted=False)[-1] is S.SWITCH_ON_DISABLED


@pytest.mark.parametrize("wanted", [True, False])
def test_unknown_or_faulted_drive_is_never_enabled(wanted):
    for state in (None, S.FAULT, S.FAULT_REACTION_ACTIVE, S.NOT_READY_TO_SWITCH_ON):
        assert DriveSequence().next_word(state, wanted=wanted) is C.DISABLE_VOLTAGE


def test_fault_is_reset_once_and_only_on_request():
    states, sequence = DriveStates(), DriveSequence()
    states.tick()
    led(states, sequence, wanted=True)
    states.trip(DriveFault.STALL)
    states.tick()
    assert set(led(states, sequence, wanted=True)) == {S.FAULT}
    sequence.request_reset()
    assert led(states, sequence, wanted=False)[1] is S.SWITCH_ON_DISABLED
    states.trip(DriveFault.STALL)  # a second fault needs a second request
    states.tick()
    assert set(led(states, sequence, wanted=False)) == {S.FAULT}


def test_no_reset_is_sent_while_the_drive_reacts_to_its_fault():
    sequence = DriveSequence()
    sequence.request_reset()
    for _ in range(3):
        word = sequence.next_word(S.FAULT_REACTION_ACTIVE, wanted=False)
        assert word is C.DISABLE_VOLTAGE


def test_reset_requested_of_a_healthy_drive_is_not_saved_for_later():
    states, sequence = DriveStates(), DriveSequence()
    states.tick()
    sequence.request_reset()
    led(states, sequence, wanted=True)
    states.trip(DriveFault.STALL)
    states.tick()
    assert set(led(states, sequence, wanted=False)) == {S.FAULT}


@pytest.mark.parametrize("wanted", [True, False])
def test_a_drive_that_stays_in_quick_stop_is_switched_off_when_it_had_its_time(wanted):
    states, sequence = DriveStates(), DriveSequence()
    states.tick()
    led(states, sequence, wanted=True)
    words = []
    for _ in range(QUICK_STOPS + 5):
        words.append(sequence.next_word(states.state, wanted=wanted and bool(words)))
        states.command(words[-1])
        states.tick(stopped=False)  # by its quick stop option code it waits for a word
    assert words[:QUICK_STOPS] == [C.QUICK_STOP] * QUICK_STOPS
    assert words[QUICK_STOPS] is C.DISABLE_VOLTAGE
    assert states.state is (S.OPERATION_ENABLED if wanted else S.SWITCH_ON_DISABLED)
    # the next stop has its time again
    led(states, sequence, wanted=True)
    for _ in range(QUICK_STOPS):
        states.command(sequence.next_word(states.state, wanted=False))
        assert states.state is S.QUICK_STOP_ACTIVE


def test_a_drive_that_stays_in_operation_on_quick_stop_is_switched_off_when_it_had_its_time():
    sequence = DriveSequence()
    words = [sequence.next_word(S.OPERATION_ENABLED, wanted=False) for _ in range(QUICK_STOPS + 2)]
    assert words == [C.QUICK_STOP] * QUICK_STOPS + [C.DISABLE_VOLTAGE] * 2
    for _ in range(DISABLES - 2):
        assert not sequence.ignored
        sequence.next_word(S.OPERATION_ENABLED, wanted=False)
    assert not sequence.ignored
    sequence.next_word(S.OPERATION_ENABLED, wanted=False)
    assert sequence.ignored
    for _ in range(AT_REST):
        assert sequence.ignored
        sequence.next_word(S.SWITCH_ON_DISABLED, wanted=False)
    assert not sequence.ignored


def test_a_drive_that_stayed_on_is_not_obedient_because_it_is_to_be_on_again():
    """Else PASSIVE, in which it is enabled, would let the next arming pass."""
    sequence = DriveSequence()
    for _ in range(QUICK_STOPS + DISABLES + 1):
        sequence.next_word(S.OPERATION_ENABLED, wanted=False)
    for _ in range(100):
        sequence.next_word(S.OPERATION_ENABLED, wanted=True)
        assert sequence.ignored
    for _ in range(AT_REST):
        assert sequence.ignored
        sequence.next_word(S.SWITCH_ON_DISABLED, wanted=True)
    assert not sequence.ignored


@pytest.mark.parametrize("every", [2, 3, AT_REST])
def test_a_drive_that_is_off_only_now_and_then_does_not_obey(every):
    sequence = DriveSequence()
    states = [S.SWITCHED_ON if k % every == 0 else S.OPERATION_ENABLED for k in range(100)]
    words = [sequence.next_word(state, wanted=False) for state in states]
    assert sequence.ignored
    assert words[-1] is C.DISABLE_VOLTAGE


@pytest.mark.parametrize(("rests", "word"), [(9, C.DISABLE_VOLTAGE), (10, C.QUICK_STOP)])
def test_a_drive_that_was_at_rest_for_ten_commands_may_brake_for_half_a_second_again(rests, word):
    sequence = DriveSequence()
    # one each 20 ms, from 0 to 500 ms
    words = {sequence.next_word(S.OPERATION_ENABLED, wanted=False) for _ in range(26)}
    assert words == {C.QUICK_STOP}
    for _ in range(rests):
        sequence.next_word(S.SWITCH_ON_DISABLED, wanted=False)
    assert sequence.next_word(S.OPERATION_ENABLED, wanted=False) is word


def test_a_drive_whose_cause_lasts_gets_an_edge_for_each_request():
    sequence = DriveSequence()
    for _ in range(3):
        sequence.request_reset()
        words = [sequence.next_word(S.FAULT, wanted=False) for _ in range(50)]
        assert words == [C.FAULT_RESET] * RESETS + [C.DISABLE_VOLTAGE] * (50 - RESETS)
