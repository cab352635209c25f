"""CiA 402 state machine of a drive (IEC 61800-7-201), reduced to the needs of a pump drive.

QUICK_STOP and a fault brake the motor before it is switched off. DISABLE_VOLTAGE and SHUTDOWN
switch it off at once, as in the standard, and its rotor coasts.
"""

from utank_hil.canbus import ControlWord, DriveFault, DriveState

_S, _C = DriveState, ControlWord

# bound once: in Python 3.11 class access to an enum member is eight times slower
_NOT_READY = DriveState.NOT_READY_TO_SWITCH_ON
_STOPPING = (DriveState.QUICK_STOP_ACTIVE, DriveState.FAULT_REACTION_ACTIVE)

# state -> control word -> next state; an unlisted word changes nothing
_TRANSITIONS: dict[DriveState, dict[ControlWord, DriveState]] = {
    _S.SWITCH_ON_DISABLED: {_C.SHUTDOWN: _S.READY_TO_SWITCH_ON},
    _S.READY_TO_SWITCH_ON: {
        _C.SWITCH_ON: _S.SWITCHED_ON,
        _C.QUICK_STOP: _S.SWITCH_ON_DISABLED,
        _C.DISABLE_VOLTAGE: _S.SWITCH_ON_DISABLED,
    },
    _S.SWITCHED_ON: {
        _C.ENABLE_OPERATION: _S.OPERATION_ENABLED,
        _C.SHUTDOWN: _S.READY_TO_SWITCH_ON,
        _C.QUICK_STOP: _S.SWITCH_ON_DISABLED,
        _C.DISABLE_VOLTAGE: _S.SWITCH_ON_DISABLED,
    },
    _S.OPERATION_ENABLED: {
        _C.SWITCH_ON: _S.SWITCHED_ON,
        _C.SHUTDOWN: _S.READY_TO_SWITCH_ON,
        _C.QUICK_STOP: _S.QUICK_STOP_ACTIVE,
        _C.DISABLE_VOLTAGE: _S.SWITCH_ON_DISABLED,
    },
    _S.QUICK_STOP_ACTIVE: {_C.DISABLE_VOLTAGE: _S.SWITCH_ON_DISABLED},
}


class DriveStates:
    """State and fault of the drive; the fault is NONE outside FAULT."""

    def __init__(self) -> None:
        self.state = DriveState.NOT_READY_TO_SWITCH_ON
        self.fault = DriveFault.NONE
        self._word: ControlWord | None = None

    @property
    def stopping(self) -> bool:
        """Whether a quick stop or a fault reaction is in progress."""
        return self.state in _STOPPING

    def tick(self, *, stopped: bool = True) -> None:
        """Make the transitions that need no command; `stopped` ends a stop in progress."""
        if self.state is _NOT_READY:
            self.state = _S.SWITCH_ON_DISABLED
        elif self.stopping and stopped:
            faulted = self.state is _S.FAULT_REACTION_ACTIVE
            self.state = _S.FAULT if faulted else _S.SWITCH_ON_DISABLED

    def command(self, word: ControlWord | None) -> None:
        """Follow a control word; None, an unknown word, disables the voltage."""
        word = _C.DISABLE_VOLTAGE if word is None else word
        rising = word is not self._word
        self._word = word
        if self.state is _S.FAULT:
            if word is _C.FAULT_RESET and rising:
                self.state, self.fault = _S.SWITCH_ON_DISABLED, DriveFault.NONE
            return
        if word is _C.FAULT_RESET:
            word = _C.DISABLE_VOLTAGE  # without a fault the word means this: bit 1 is not set
        self.state = _TRANSITIONS.get(self.state, {}).get(word, self.state)

    def trip(self, fault: DriveFault) -> None:
        """Enter the fault state by way of its reaction; the first fault is kept."""
        if self.fault is DriveFault.NONE:
            self.state, self.fault = _S.FAULT_REACTION_ACTIVE, fault
