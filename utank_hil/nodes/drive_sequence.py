"""Leads the pump drive through its CiA 402 states to where the supervisor wants it."""

from typing import Final

from utank_hil.canbus import ControlWord, DriveState

QUICK_STOPS: Final = 26
"""Commands, the first and half a second of them: a drive that brakes for longer, waits for a word
or stays in operation is told to be off."""
DISABLES: Final = 10
"""Commands that tell it so, after which it does not obey."""
AT_REST: Final = 10
"""Commands to a drive that neither drives nor brakes, after which it has stopped: one status in
between proves nothing of a drive whose enable chatters."""
RESETS: Final = 5
"""Commands that reset a fault of drive or valve: the first is the edge, some may be lost. Where its
cause lasts another edge is needed later, so the bit is taken back."""


_TOWARDS_ENABLED = {
    DriveState.SWITCH_ON_DISABLED: ControlWord.SHUTDOWN,
    DriveState.READY_TO_SWITCH_ON: ControlWord.SWITCH_ON,
    DriveState.SWITCHED_ON: ControlWord.ENABLE_OPERATION,
    DriveState.OPERATION_ENABLED: ControlWord.ENABLE_OPERATION,
    DriveState.QUICK_STOP_ACTIVE: ControlWord.QUICK_STOP,
}
_STOPPING = (DriveState.OPERATION_ENABLED, DriveState.QUICK_STOP_ACTIVE)
"""Here the motor brakes; to disable the voltage would leave the rotor running down."""


class DriveSequence:
    """Chooses the control word of each pump command."""

    def __init__(self) -> None:
        self._resets_left = 0
        self._stops = self._rests = self._out = 0
        #: Whether the drive has been told to be off in vain, and was not seen off since.
        self.ignored = False

    def request_reset(self) -> None:
        """Reset the drive's fault with the next commands; only ever on an operator's order."""
        self._resets_left = RESETS

    def next_word(self, state: DriveState | None, *, wanted: bool) -> ControlWord:
        """Return the control word that leads from `state` towards operation enabled, or off.

        `state` is what the drive last reported, None if unknown; `wanted` says whether the
        supervisor wants the drive in operation enabled.
        """
        if self._resets_left and state is DriveState.FAULT:
            self._resets_left -= 1
            return ControlWord.FAULT_RESET
        self._resets_left = 0
        word = ControlWord.DISABLE_VOLTAGE
        if wanted and state is not None:
            word = _TOWARDS_ENABLED.get(state, word)
        elif state in _STOPPING:
            word = ControlWord.QUICK_STOP
        if word is ControlWord.QUICK_STOP:
            self._stops += 1
            self._rests = 0
        else:
            self._rests += 1
            if wanted or self._rests >= AT_REST:
                self._stops = 0
        self._out = 0 if state in _STOPPING else self._out + 1
        if self._stops > QUICK_STOPS + DISABLES:
            self.ignored = True
        elif self._out >= AT_REST:  # not because it is to be on again
            self.ignored = False
        return ControlWord.DISABLE_VOLTAGE if self._stops > QUICK_STOPS else word
