"""The CiA 402 state machine of a drive (IEC 61800-7-201), as far as a pump drive needs it.

QUICK_STOP and a fault brake the motor before it is switched off. DISABLE_VOLTAGE and SHUTDOWN
switch it off at once, as by the standard, and its rotor runs down.
"""

from utank_hil.canbus import ControlWord, DriveFault, DriveState

_S, _C = DriveState, ControlWord

# read once: in Python 3.11 a member costs eight times as much from its class as from here
_NOT_READY = DriveState.NOT_READY_TO_SWITCH_ON
_STOPPING = (DriveState.QUICK_STOP_ACTIVE, DriveState.FAULT_REACTION_ACTIVE)

# state -> control word -> next state; what is not listed changes nothing
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
    """State and fault of the drive.

    Attributes
    ----------
    state : DriveState
    fault : DriveFault
        Why the drive is in FAULT; NONE otherwise.
    """

    def __init__(self) -> None:
        self.state = DriveState.NOT_READY_TO_SWITCH_ON
        self.fault = DriveFault.NONE
        self._word: ControlWord | None = None

    @property
    def stopping(self) -> bool:
        """Whether a quick stop or the reaction to a fault is under way."""
        return self.state in _STOPPING

    def tick(self, *, stopped: bool = True) -> None:
        """Take the transitions that need no command.

        Parameters
        ----------
        stopped : bool
            Whether a stop that is under way has come to its end.
        """
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
            word = _C.DISABLE_VOLTAGE  # which it is where there is no fault: bit 1 is not set
        self.state = _TRANSITIONS.get(self.state, {}).get(word, self.state)

    def trip(self, fault: DriveFault) -> None:
        """Go to fault, by way of its reaction; the first fault stays."""
        if self.fault is DriveFault.NONE:
            self.state, self.fault = _S.FAULT_REACTION_ACTIVE, fault
