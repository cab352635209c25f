"""The operator panel: requests modes, arms and disarms."""

from collections.abc import Iterable
from dataclasses import dataclass
from enum import Enum

from utank_hil.canbus import (
    Address,
    Catalogue,
    ControllerStatus,
    Frame,
    Mode,
    OperatorCommand,
)
from utank_hil.parameters import NotNegative, range_problems, refuse
from utank_hil.runtime.housekeeping import Housekeeping
from utank_hil.tick import TICK_NS

EDGE_NS = 500_000_000
"""How long an edge-triggered button stays pressed: longer than two lost messages."""
_UNDER_POWER = (Mode.ACTIVE, Mode.PASSIVE, None)
"""Modes that a stop has not ended yet."""


class Action(Enum):
    """A button of the panel."""

    STANDBY = "standby"
    PASSIVE = "passive"
    ARM = "arm"
    DISARM = "disarm"
    STOP = "stop"
    RESET = "reset"
    RETUNE = "retune"
    UNDO = "undo"
    FORBID = "forbid"
    PERMIT = "permit"


_EDGES = (Action.RESET, Action.RETUNE, Action.UNDO)


@dataclass(frozen=True, slots=True)
class TimedAction:
    """A button press at a time after the panel first receives the status of a ready controller.

    The panel's own start is no reference: a controller that starts later would miss the rising edge
    of an earlier press.

    Raises
    ------
    ValueError
        If the time is negative or not finite.
    """

    time_s: NotNegative
    action: Action

    def __post_init__(self) -> None:
        refuse("action", range_problems(self))


class OperatorPanel:
    """Sends OPERATOR_CMD in its cycle of the catalogue, and on change.

    Stop is held until the controller answers with a mode without power, and for `EDGE_NS` at least.
    Until then arming is refused.

    Parameters
    ----------
    catalogue : Catalogue
    configuration_version : int
        Sent in the heartbeat.
    script : iterable of TimedAction
        Scheduled button presses, for benches.

    Attributes
    ----------
    status : ControllerStatus or None
        Latest status of the controller.
    stopping : bool
        Whether stop is held.
    """

    name = "panel"
    period_ns = 10 * TICK_NS

    def __init__(
        self,
        catalogue: Catalogue,
        *,
        configuration_version: int,
        script: Iterable[TimedAction] = (),
    ) -> None:
        self._sender = catalogue.transmitter(OperatorCommand)
        self._cycle_ticks = self._sender.cycle_ns // self.period_ns
        self._listener = catalogue.receiver(ControllerStatus)
        self.hears = frozenset([self._listener.can_id])
        self._housekeeping = Housekeeping(Address.OPERATOR, catalogue, configuration_version)
        # the next one last; of several at a time, the first given comes first
        self._script = sorted(script, key=lambda timed: timed.time_s)[::-1]
        self._start_ns: int | None = None
        self._mode = Mode.STANDBY
        self._armed = False
        self._forbidden = False
        self._pressed_until_ns = dict.fromkeys(_EDGES, 0)
        self._stopped_ns = 0
        self.stopping = False
        self._pressed: list[Action] = []
        self._sent: OperatorCommand | None = None
        self._ticks = 0
        self.status: ControllerStatus | None = None

    def press(self, action: Action) -> None:
        """Press a button; it takes effect with the next tick."""
        self._pressed.append(action)

    def receive(self, frame: Frame, now_ns: int) -> None:
        """Take the controller's status."""
        if frame.can_id != self._listener.can_id:
            return
        status = self._listener.accept(frame)
        if status is None:
            return
        self.status = status
        # an earlier one may have been on its way when stop was pressed
        if now_ns - self._stopped_ns >= EDGE_NS and status.mode not in _UNDER_POWER:
            self.stopping = False

    def tick(self, now_ns: int) -> Iterable[Frame]:
        """Send the state of the buttons when it is due or has changed."""
        if self._start_ns is None and self._controller_is_ready():
            self._start_ns = now_ns
        if self._start_ns is not None:
            while self._script and self._script[-1].time_s * 1e9 <= now_ns - self._start_ns:
                self._pressed.append(self._script.pop().action)
        for action in self._pressed:
            self._take(action, now_ns)
        self._pressed.clear()
        command = OperatorCommand(
            mode_request=self._mode,
            arm=self._armed,
            stop=self.stopping,
            reset=now_ns < self._pressed_until_ns[Action.RESET],
            acknowledge=False,
            retune=now_ns < self._pressed_until_ns[Action.RETUNE],
            undo=now_ns < self._pressed_until_ns[Action.UNDO],
            forbid_retuning=self._forbidden,
        )
        frames = []
        if command != self._sent or self._ticks % self._cycle_ticks == 0:
            frames.append(self._sender.frame(command))
            self._sent = command
        frames.extend(self._housekeeping.frames(now_ns))
        self._ticks += 1
        return frames

    def _controller_is_ready(self) -> bool:
        return self.status is not None and self.status.mode not in (None, Mode.INIT)

    def _take(self, action: Action, now_ns: int) -> None:
        if action in _EDGES:
            self._pressed_until_ns[action] = now_ns + EDGE_NS
        if action is Action.STOP:
            self.stopping, self._stopped_ns = True, now_ns
        if action is Action.ARM:
            if not self.stopping:
                self._mode, self._armed = Mode.ACTIVE, True
        elif action in (Action.FORBID, Action.PERMIT):
            self._forbidden = action is Action.FORBID
        elif action in (Action.PASSIVE, Action.DISARM):
            self._mode, self._armed = Mode.PASSIVE, False
        elif action in (Action.STANDBY, Action.STOP):
            self._mode, self._armed = Mode.STANDBY, False
