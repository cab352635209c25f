"""The keyboard of ``utank-hil panel``: words to actions, and the controller's state in words."""

import os
import select
from collections.abc import Callable
from typing import Final

from utank_hil.canbus import AlarmState, ControllerStatus, Fault, Mode, Station
from utank_hil.nodes.panel import SILENT_NS, Action, OperatorPanel
from utank_hil.safety.faults import fault_text

ANSWER_NS: Final = 1_000_000_000
"""Time within which a reset is answered: 500 ms for the button, 100 ms for the status."""
LEAVE_NS: Final = 3_000_000_000  #: Time that a panel waits for the answer to a stop before it ends.
HELP: Final = """\
  arm, disarm          take charge; ramp to zero, pump enabled and passive
  stop                 zero at once, as what looks like it: s, stop!; on a terminal Enter alone
  standby, passive     pump off; pump enabled at zero pressure
  accept, reset        accept the alarms; leave FAULT when its cause is gone
  take                 take the command from the other station
  retune, undo         identify the ship and design anew; back to the law before
  forbid, permit       no retuning; retuning again, where no other station forbids it
  help, quit           Words may be cut short: d for disarm."""

_READ_BYTES: Final = 4096
_STOP: Final = Action.STOP.value
_LONGEST_LINE: Final = 256
_WORDS: Final = (*(action.value for action in Action), "help", "quit")
_LASTING: Final = (AlarmState.ACTIVE_UNACKNOWLEDGED, AlarmState.ACTIVE_ACKNOWLEDGED)
_UNACCEPTED: Final = (AlarmState.ACTIVE_UNACKNOWLEDGED, AlarmState.RECTIFIED_UNACKNOWLEDGED)


class Keyboard:
    """Reads words from a terminal or a pipe between two ticks, and shows changes.

    The end of a pipe only ends the input; that of a terminal stops the controller and ends the
    panel. `say` shows a line. If a person types (`terminal`), Enter alone stops, and a new alarm
    rings.
    """

    def __init__(
        self, node: OperatorPanel, descriptor: int, say: Callable[[str], None], *, terminal: bool
    ) -> None:
        self._node = node
        self._descriptor = descriptor
        self._say = say
        self._terminal = terminal
        self._open = True
        self._typed = b""
        self._shown = ""
        self._silent = True
        self._began_ns: int | None = None
        self._leave_ns: int | None = None
        self._now_ns = 0
        self._reset_ns: int | None = None
        self._alarms: dict[Fault | None, AlarmState | None] = {}

    def look(self, now_ns: int, *, signalled: bool = False) -> bool:
        """Execute new lines and show changes; return whether to leave.

        A signal (`signalled`) acts like ``quit``, so that the stop of a closed terminal, whose
        input has ended, is still sent.
        """
        was_open, self._now_ns = self._open, now_ns
        lines = self._lines()
        self._show(now_ns)
        for line in lines:
            if self._obey(line) and self._leave_ns is None:
                self._leave_ns = now_ns + LEAVE_NS
        if was_open and not self._open:
            self._end(now_ns)
        if signalled and self._leave_ns is None:
            self._leave_ns = now_ns + LEAVE_NS
        self._tell_of_reset(now_ns)
        # The last press must arrive: a stop is kept until it is answered.
        return self._leave_ns is not None and (not self._node.busy or now_ns >= self._leave_ns)

    def _lines(self) -> list[str]:
        """Return the complete lines so far; the end of a pipe completes one.

        Python's own buffer would hold a line back until more can be read. There is one read per
        look, so that a pipe that is never empty does not block the panel.
        """
        if self._open and select.select([self._descriptor], [], [], 0)[0]:
            try:
                data = os.read(self._descriptor, _READ_BYTES)
            except OSError:  # The terminal is gone.
                data = b""
            self._open = bool(data)
            self._typed += data
        *lines, begun = self._typed.split(b"\n")
        # A line longer than any word is cut to its beginning.
        self._typed = begun[:_LONGEST_LINE] if self._open else b""
        if begun and not self._open:
            lines.append(begun)
        return [line.decode(errors="replace").strip().lower() for line in lines]

    def _end(self, now_ns: int) -> None:
        if self._terminal:  # without input a panel must not stay armed
            self._press(Action.STOP)
            self._leave_ns = self._leave_ns or now_ns + LEAVE_NS
        elif self._leave_ns is None:
            self._say("the input has ended; what was asked for stays, Ctrl-C leaves")

    def _tell_of_reset(self, now_ns: int) -> None:
        """Report that a reset was refused: the controller is still in FAULT."""
        if self._reset_ns is None or now_ns - self._reset_ns < ANSWER_NS:
            return
        self._reset_ns = None
        status = self._node.status
        if status is not None and status.mode is Mode.FAULT and not self._silent:
            lasting = [
                alarm.code.name
                for alarm in self._node.alarms
                if alarm.code is not None and alarm.state in _LASTING
            ]
            self._say(f"reset REFUSED while this lasts: {', '.join(lasting)}")

    def _obey(self, word: str) -> bool:
        """Execute a line; return whether to leave."""
        if not word:
            if self._terminal:
                self._press(Action.STOP)
            return False
        found = [word] if word in _WORDS else [each for each in _WORDS if each.startswith(word)]
        if word.startswith(_STOP) or _STOP in found:  # hasty spellings stop: st, stopp, stop!
            self._press(Action.STOP)
        elif len(found) != 1:
            self._say(f"{word!r} is {' or '.join(found) or 'no action; help lists them'}")
        elif found[0] == "help":
            self._say(HELP)
        elif found[0] == "quit":
            return True
        else:
            self._press(Action(found[0]))
        return False

    def _press(self, action: Action) -> None:
        refusal = self._node.why_not(action, self._now_ns)
        self._say(refusal or action.value)
        if not refusal:
            self._node.press(action)
            if action is Action.RESET:
                self._reset_ns = self._now_ns

    def _show(self, now_ns: int) -> None:
        node = self._node
        if self._began_ns is None:
            self._began_ns = now_ns
        self._silent = node.silent(now_ns)
        if node.status is not None or now_ns - self._began_ns > SILENT_NS:
            said = "controller: SILENT"
            if node.status is not None and not self._silent:
                said = _status_text(node.status, node.station)
            if said != self._shown:
                self._say(said)
                self._shown = said
        alarms = {alarm.code: alarm.state for alarm in node.alarms}
        for code, state in alarms.items():
            if code is not None and state in _UNACCEPTED and self._alarms.get(code) is not state:
                there = state is AlarmState.ACTIVE_UNACKNOWLEDGED
                bell = "\a" if self._terminal and there else ""
                what = "ALARM" if there else "alarm, its cause gone,"
                self._say(f"{bell}{what} {fault_text(code)} accept?")
        for code in self._alarms.keys() - alarms.keys():
            if code is not None:
                self._say(f"alarm over: {code.name}")
        self._alarms = alarms


def _status_text(status: ControllerStatus, own: Station) -> str:
    parts = [f"controller: {'unknown mode' if status.mode is None else status.mode.name}"]
    if status.fault:
        parts.append(fault_text(status.fault))
    if status.degraded:
        parts.append("degraded")
    if status.retuning is not None:
        parts.append(f"retuning {status.retuning.name}")
    if status.station not in (None, own):
        parts.append("the other station has the command")
    return ", ".join(parts)
