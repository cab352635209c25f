import pytest
from hypothesis import given
from hypothesis import strategies as st

from firmware_sim.drive import DriveStates
from utank_hil.canbus import ControlWord, DriveFault, DriveState

S, C = DriveState, ControlWord

# how to get there from power-up
PATHS: dict[DriveState, tuple[ControlWord, ...]] = {
    S.SWITCH_ON_DISABLED: (),
    S.READY_TO_SWITCH_ON: (C.SHUTDOWN,),
    S.SWITCHED_ON: (C.SHUTDOWN, C.SWITCH_ON),
    S.OPERATION_ENABLED: (C.SHUTDOWN, C.SWITCH_ON, C.ENABLE_OPERATION),
    S.QUICK_STOP_ACTIVE: (C.SHUTDOWN, C.SWITCH_ON, C.ENABLE_OPERATION, C.QUICK_STOP),
}
# IEC 61800-7-201, transitions that a command causes: number, from, command, to
STANDARD = [
    (2, S.SWITCH_ON_DISABLED, C.SHUTDOWN, S.READY_TO_SWITCH_ON),
    (3, S.READY_TO_SWITCH_ON, C.SWITCH_ON, S.SWITCHED_ON),
    (4, S.SWITCHED_ON, C.ENABLE_OPERATION, S.OPERATION_ENABLED),
    (5, S.OPERATION_ENABLED, C.SWITCH_ON, S.SWITCHED_ON),
    (6, S.SWITCHED_ON, C.SHUTDOWN, S.READY_TO_SWITCH_ON),
    (7, S.READY_TO_SWITCH_ON, C.QUICK_STOP, S.SWITCH_ON_DISABLED),
    (7, S.READY_TO_SWITCH_ON, C.DISABLE_VOLTAGE, S.SWITCH_ON_DISABLED),
    (8, S.OPERATION_ENABLED, C.SHUTDOWN, S.READY_TO_SWITCH_ON),
    (9, S.OPERATION_ENABLED, C.DISABLE_VOLTAGE, S.SWITCH_ON_DISABLED),
    (10, S.SWITCHED_ON, C.QUICK_STOP, S.SWITCH_ON_DISABLED),
    (10, S.SWITCHED_ON, C.DISABLE_VOLTAGE, S.SWITCH_ON_DISABLED),
    (11, S.OPERATION_ENABLED, C.QUICK_STOP, S.QUICK_STOP_ACTIVE),
    (12, S.QUICK_STOP_ACTIVE, C.DISABLE_VOLTAGE, S.SWITCH_ON_DISABLED),
]
TABLE = {(start, word): end for _, start, word, end in STANDARD}
# the word that resets a fault has the bits of "disable voltage" where there is none
TABLE |= {
    (start, C.FAULT_RESET): end for _, start, word, end in STANDARD if word is C.DISABLE_VOLTAGE
}


def states_in(state: DriveState) -> DriveStates:
    states = DriveStates()
    states.tick()
    for word in PATHS[state]:
        states.command(word)
    assert states.state is state
    return states


@pytest.mark.parametrize("start", PATHS)
@pytest.mark.parametrize("word", ControlWord)
def test_commands_cause_the_standards_transitions_and_no_others(
    start: DriveState, word: ControlWord
) -> None:
    states = states_in(start)
    states.command(word)
    assert states.state is TABLE.get((start, word), start)


def test_power_up_goes_through_self_test_to_switch_on_disabled() -> None:
    states = DriveStates()
    assert states.state is S.NOT_READY_TO_SWITCH_ON  # transition 0
    states.command(C.SHUTDOWN)
    assert states.state is S.NOT_READY_TO_SWITCH_ON
    states.tick()
    assert states.state is S.SWITCH_ON_DISABLED  # transition 1


def test_finished_quick_stop_switches_off() -> None:
    states = states_in(S.QUICK_STOP_ACTIVE)
    states.tick(stopped=False)
    assert states.stopping
    assert states.state is S.QUICK_STOP_ACTIVE
    states.tick()
    assert not states.stopping
    assert states.state is S.SWITCH_ON_DISABLED  # transition 12


@pytest.mark.parametrize("start", PATHS)
def test_fault_from_any_state_goes_through_its_reaction_to_fault(start: DriveState) -> None:
    states = states_in(start)
    states.trip(DriveFault.COMMAND_TIMEOUT)
    assert states.state is S.FAULT_REACTION_ACTIVE  # transition 13
    states.command(C.ENABLE_OPERATION)
    states.command(C.FAULT_RESET)
    states.tick(stopped=False)
    assert states.stopping
    assert states.state is S.FAULT_REACTION_ACTIVE
    states.tick()
    assert not states.stopping
    assert states.state is S.FAULT  # transition 14
    for word in ControlWord:
        if word is not C.FAULT_RESET:
            states.command(word)
            assert states.state is S.FAULT
    states.command(C.FAULT_RESET)
    assert states.state is S.SWITCH_ON_DISABLED  # transition 15
    assert states.fault is DriveFault.NONE


def test_fault_reset_needs_a_rising_edge() -> None:
    states = states_in(S.OPERATION_ENABLED)
    states.command(C.FAULT_RESET)
    states.trip(DriveFault.OVERCURRENT)
    states.tick()
    states.command(C.FAULT_RESET)  # held since before the fault
    assert states.state is S.FAULT
    states.command(C.DISABLE_VOLTAGE)
    states.command(C.FAULT_RESET)
    assert states.state is S.SWITCH_ON_DISABLED


def test_first_fault_is_kept() -> None:
    states = states_in(S.OPERATION_ENABLED)
    states.trip(DriveFault.STALL)
    states.tick()
    states.trip(DriveFault.OVERSPEED)
    assert (states.state, states.fault) == (S.FAULT, DriveFault.STALL)


def test_unknown_word_switches_the_voltage_off() -> None:
    states = states_in(S.OPERATION_ENABLED)
    states.command(None)
    assert states.state is S.SWITCH_ON_DISABLED


steps = st.lists(
    st.sampled_from([*ControlWord, *ControlWord, None, "tick", DriveFault.OVERCURRENT]),
    max_size=60,
)


@given(steps)
def test_never_enabled_without_the_sequence(history: list[object]) -> None:
    states = DriveStates()
    reached: list[DriveState] = [states.state]
    for step in history:
        if step == "tick":
            states.tick()
        elif isinstance(step, DriveFault):
            states.trip(step)
        else:
            assert step is None or isinstance(step, ControlWord)
            states.command(step)
        if states.state is not reached[-1]:
            reached.append(states.state)
        assert (states.fault is not DriveFault.NONE) == (
            states.state in (S.FAULT_REACTION_ACTIVE, S.FAULT)
        )
    for index, state in enumerate(reached):
        if state is S.OPERATION_ENABLED:
            assert reached[index - 1] is S.SWITCHED_ON
        if state is S.SWITCHED_ON:
            assert reached[index - 1] in (S.READY_TO_SWITCH_ON, S.OPERATION_ENABLED)
        if state is S.READY_TO_SWITCH_ON:
            assert reached[index - 1] in (
                S.SWITCH_ON_DISABLED, S.SWITCHED_ON, S.OPERATION_ENABLED
            )  # fmt: skip
