"""Leads the pump drive through its CiA 402 states to where the supervisor wants it."""

from typing import Final

from utank_hil.canbus import ControlWord, DriveState

QUICK_STOPS: Final = 25
"""Commands, half a second of them: a drive that brakes for longer, or waits for a word, is off."""


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
        self._resetting = False
        self._stops = 0

    def request_reset(self) -> None:
        """Reset the drive's fault with the next commands; only ever on an operator's order."""
        self._resetting = True

    def next_word(self, state: DriveState | None, *, wanted: bool) -> ControlWord:
        """Return the control word that leads from `state` towards operation enabled, or off.

        Parameters
        ----------
        state : DriveState or None
            State the drive last reported, None if unknown.
        wanted : bool
            Whether the supervisor wants the drive in operation enabled.
        """
        if self._resetting and state is DriveState.FAULT:
            return ControlWord.FAULT_RESET
        self._resetting = False
        self._stops = self._stops + 1 if state is DriveState.QUICK_STOP_ACTIVE else 0
        if self._stops > QUICK_STOPS:
            return ControlWord.DISABLE_VOLTAGE
        if wanted and state is not None:
            return _TOWARDS_ENABLED.get(state, ControlWord.DISABLE_VOLTAGE)
        if state in _STOPPING:
            return ControlWord.QUICK_STOP
        return ControlWord.DISABLE_VOLTAGE
