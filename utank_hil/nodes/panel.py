"""The operator panel: requests modes, arms and disarms."""

from collections.abc import Iterable
from dataclasses import dataclass
from enum import Enum

from utank_hil import canbus
from utank_hil.base.parameters import Checked, NotNegative
from utank_hil.base.tick import TICK_NS
from utank_hil.nodes.housekeeping import Housekeeping
from utank_hil.nodes.stations import ADDRESSES

EDGE_NS = 500_000_000
"""How long an edge-triggered button stays pressed: longer than two lost messages. So long the arm
bit is taken back, too, before it is set again."""
RAMP_NS = 1_100_000_000
"""How long stop is held in FAULT: the ramp of a fault, which a stop cuts, may last a second."""
SILENT_NS = 300_000_000
"""After so long without a status no controller is heard."""
_UNDER_POWER = (canbus.Mode.ACTIVE, canbus.Mode.PASSIVE, None)
"""Modes that a stop has not ended yet."""
_SPARE_ALARMS = 5
"""Frames of ALARM that may be missing before one that is not repeated counts as over."""


class Action(Enum):
    """A button of the panel."""

    STANDBY = "standby"
    PASSIVE = "passive"
    ARM = "arm"
    DISARM = "disarm"
    STOP = "stop"
    RESET = "reset"
    ACCEPT = "accept"
    TAKE = "take"
    RETUNE = "retune"
    UNDO = "undo"
    FORBID = "forbid"
    PERMIT = "permit"


_ANYWHERE = (Action.STOP, Action.ACCEPT, Action.TAKE, Action.FORBID, Action.PERMIT)
"""Actions that are allowed to a station without the command."""
_EDGES = (Action.RESET, Action.ACCEPT, Action.TAKE, Action.RETUNE, Action.UNDO)


@dataclass(frozen=True, slots=True)
class TimedAction(Checked, owner="action"):
    """A button press at a time after the panel first receives the status of a ready controller.

    The panel's own start is no reference: a controller that starts later would miss the rising edge
    of an earlier press. Raises `ValueError` if the time is negative or not finite.
    """

    time_s: NotNegative
    action: Action


class OperatorPanel:
    """Sends OPERATOR_CMD in its cycle of the catalogue, and on change.

    Stop is held until the controller answers with a mode without power, and for `EDGE_NS` at least,
    `RAMP_NS` in FAULT. Until then arming is refused. While nobody attends it the panel is silent,
    but for a stop. `attended` says whether a person can see it: a controller in charge ramps down
    after a silence of five seconds; a shorter one changes nothing.

    `script` are scheduled button presses, for benches. `period_ns` is the time between two looks at
    the buttons, of which the cycle of OPERATOR_CMD is a multiple.
    """

    name = "panel"

    def __init__(
        self,
        catalogue: canbus.Catalogue,
        *,
        configuration_version: int,
        script: Iterable[TimedAction] = (),
        station: canbus.Station = canbus.Station.OPERATOR,
        period_ns: int = 10 * TICK_NS,
    ) -> None:
        address = ADDRESSES[station]
        self.period_ns = period_ns
        self.station = station
        self._sender = catalogue.transmitter(canbus.OperatorCommand, address)
        self._cycle_ticks = self._sender.cycle_ns // period_ns
        self._listener = catalogue.receiver(canbus.ControllerStatus)
        self._alarm_listener = catalogue.receiver(canbus.Alarm)
        self.hears = frozenset([self._listener.can_id, self._alarm_listener.can_id])
        self._housekeeping = Housekeeping(address, catalogue, configuration_version)
        self._alarms: dict[canbus.Fault, tuple[canbus.Alarm, int]] = {}
        # the next one last; of several at a time, the first given comes first
        self._script = sorted(script, key=lambda timed: timed.time_s)[::-1]
        self._start_ns: int | None = None
        self._mode = canbus.Mode.STANDBY
        self._armed = False
        self._forbidden = False
        self._pressed_until_ns = dict.fromkeys(_EDGES, 0)
        self._stopped_ns = self._arms_ns = self._asks_ns = 0
        self.stopping = False  #: Whether stop is held.
        self._pressed: list[Action] = []
        self._sent: canbus.OperatorCommand | None = None
        self._ticks = 0
        self.status: canbus.ControllerStatus | None = None  #: Latest status of the controller.
        self.heard_ns: int | None = None  #: When that status came.
        self.attended = self._spoke = True

    @property
    def _found(self) -> canbus.Mode | None:
        """Mode of the controller by its last status."""
        return None if self.status is None else self.status.mode

    @property
    def in_command(self) -> bool:
        """Whether the controller says that this station has the command."""
        return self.status is not None and self.status.station is self.station

    @property
    def busy(self) -> bool:
        """Whether a press has not been sent yet, or a stop not been answered."""
        return bool(self._pressed) or self.stopping

    @property
    def alarms(self) -> tuple[canbus.Alarm, ...]:
        """The controller's alarms, the most urgent first."""
        return tuple(
            sorted((alarm for alarm, _ in self._alarms.values()), key=lambda each: each.place or 0)
        )

    def silent(self, now_ns: int) -> bool:
        """Whether no controller is heard."""
        return self.heard_ns is None or now_ns - self.heard_ns > SILENT_NS

    def why_not(self, action: Action, now_ns: int) -> str:
        """Why a button must not be pressed now; empty if it may."""
        if not self.attended and action is not Action.STOP:
            return "nobody attends this panel: open its page"
        if action is Action.ARM and self.silent(now_ns):
            return "not armed: no controller is heard"
        if action is Action.ARM and self.stopping:
            return "not armed: the controller has not answered the stop yet"
        station = None if self.status is None else self.status.station
        if action not in _ANYWHERE and station not in (None, self.station):
            return "the other station has the command: take"
        return ""

    def press(self, action: Action) -> None:
        """Press a button; it takes effect with the next tick."""
        self._pressed.append(action)

    def receive(self, frame: canbus.Frame, now_ns: int) -> None:
        """Take the controller's status and alarms."""
        if frame.can_id == self._alarm_listener.can_id:
            alarm = self._alarm_listener.accept(frame)
            if alarm is not None and alarm.code is not None:
                self._note_alarm(alarm, alarm.code, now_ns)
            return
        if frame.can_id != self._listener.can_id:
            return
        status = self._listener.accept(frame)
        if status is None:
            return
        self.status, self.heard_ns = status, now_ns
        # an earlier one may have been on its way when stop was pressed
        held_ns = RAMP_NS if status.mode is canbus.Mode.FAULT else EDGE_NS
        if now_ns - self._stopped_ns >= held_ns and status.mode not in _UNDER_POWER:
            self.stopping = False

    def tick(self, now_ns: int) -> Iterable[canbus.Frame]:
        """Send the state of the buttons when it is due or has changed."""
        if self._start_ns is None and self._found not in (None, canbus.Mode.INIT):
            self._start_ns = now_ns
        if self._start_ns is not None:
            while self._script and self._script[-1].time_s * 1e9 <= now_ns - self._start_ns:
                self._pressed.append(self._script.pop().action)
        for action in self._pressed:
            self._take(action, now_ns)
        self._pressed.clear()
        speaks = self.attended or self.stopping
        in_charge = self._found is canbus.Mode.ACTIVE and not self.silent(now_ns)
        if speaks and not self._spoke and self._armed and not in_charge:
            self._mode, self._armed = canbus.Mode.STANDBY, False
        self._spoke = speaks
        if not speaks:
            return ()
        # PASSIVE that is asked for again comes after STANDBY
        waits = self._mode is canbus.Mode.PASSIVE and now_ns < self._asks_ns
        command = canbus.OperatorCommand(
            mode_request=canbus.Mode.STANDBY if waits else self._mode,
            arm=self._armed and now_ns >= self._arms_ns,
            stop=self.stopping,
            reset=now_ns < self._pressed_until_ns[Action.RESET],
            acknowledge=now_ns < self._pressed_until_ns[Action.ACCEPT],
            retune=now_ns < self._pressed_until_ns[Action.RETUNE],
            undo=now_ns < self._pressed_until_ns[Action.UNDO],
            forbid_retuning=self._forbidden,
            take_command=now_ns < self._pressed_until_ns[Action.TAKE],
        )
        frames = []
        if command != self._sent or self._ticks % self._cycle_ticks == 0:
            frames.append(self._sender.frame(command))
            self._sent = command
        frames.extend(self._housekeeping.frames(now_ns))
        self._ticks += 1
        return frames

    def _note_alarm(self, alarm: canbus.Alarm, code: canbus.Fault, now_ns: int) -> None:
        """Keep an alarm, and forget those that the controller no longer repeats."""
        alarms = alarm.alarms or 0
        if alarms:
            self._alarms[code] = (alarm, now_ns)
        oldest_ns = now_ns - (alarms + _SPARE_ALARMS) * self._alarm_listener.cycle_ns
        self._alarms = {
            code: kept for code, kept in self._alarms.items() if alarms and kept[1] >= oldest_ns
        }

    def _take(self, action: Action, now_ns: int) -> None:
        if action in _EDGES:
            self._pressed_until_ns[action] = now_ns + EDGE_NS
        if action is Action.STOP:
            self.stopping, self._stopped_ns = True, now_ns
        if action is Action.TAKE:
            self._adopt(now_ns)
        if action is Action.ARM:
            if not self.stopping:
                # without another rising edge a second press would do nothing after a fault
                if self._armed and self._found is not canbus.Mode.ACTIVE:
                    self._arms_ns = now_ns + EDGE_NS
                self._mode, self._armed = canbus.Mode.ACTIVE, True
        elif action in (Action.FORBID, Action.PERMIT):
            self._forbidden = action is Action.FORBID
        elif action in (Action.PASSIVE, Action.DISARM):
            # nor does a wish that is not new bring it back to where it was
            again = action is Action.PASSIVE and self._mode is canbus.Mode.PASSIVE
            if again and self._found not in _UNDER_POWER:
                self._asks_ns = now_ns + EDGE_NS
            self._mode, self._armed = canbus.Mode.PASSIVE, False
        elif action in (Action.STANDBY, Action.STOP):
            self._mode, self._armed = canbus.Mode.STANDBY, False

    def _adopt(self, now_ns: int) -> None:
        """Take over what the controller does: who takes the command is not to change it."""
        mode = None if self.silent(now_ns) else self._found
        self._armed = mode is canbus.Mode.ACTIVE and not self.stopping
        if self._armed:
            self._mode = canbus.Mode.ACTIVE
        else:
            self._mode = canbus.Mode.PASSIVE if mode is canbus.Mode.PASSIVE else canbus.Mode.STANDBY
