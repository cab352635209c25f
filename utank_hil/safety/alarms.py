"""The alarm list: an alarm stays until it was accepted and its cause has gone.

    state                      to                         when
    (not in the list)          ACTIVE_UNACKNOWLEDGED      its cause is there
    ACTIVE_UNACKNOWLEDGED      ACTIVE_ACKNOWLEDGED        accepted after it was sent
                               RECTIFIED_UNACKNOWLEDGED   the cause has been gone for `GONE_NS`
    ACTIVE_ACKNOWLEDGED        (NORMAL, out of the list)  the cause has been gone for `GONE_NS`
                               ACTIVE_UNACKNOWLEDGED      it is latched, or refuses arming, anew;
                                                          or it is graver than when accepted
    RECTIFIED_UNACKNOWLEDGED   ACTIVE_UNACKNOWLEDGED      its cause is there again
                               (NORMAL, out of the list)  accepted

The terms are those of IEC 62923-1. What raises an alarm is decided elsewhere: `active_faults`.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from enum import IntEnum, auto
from typing import Final, TypeAlias

from utank_hil.canbus import Alarm, AlarmState, Fault, Mode
from utank_hil.canbus.events import AlarmEvent
from utank_hil.safety import judging
from utank_hil.safety.faults import FAULTS, Reaction

GONE_NS: Final = 10_000_000_000
"""A cause that comes back sooner, as with each roll, was never gone."""

_URGENCY: Final = {row.code: place for place, row in enumerate(FAULTS)}
_UNACCEPTED: Final = (AlarmState.ACTIVE_UNACKNOWLEDGED, AlarmState.RECTIFIED_UNACKNOWLEDGED)
_NOTHING: Final = Alarm(AlarmState.NORMAL, Fault.NONE, 0, 0, 0, 0.0)


class Gravity(IntEnum):
    """What the cause of an alarm does to the pressure, or would."""

    NOTHING = auto()
    HALVES = auto()
    ENDS = auto()


def gravest(code: Fault) -> Gravity:
    """The most that a fault may do to the pressure, the same in every mode."""
    reactions = {each.reaction for row in FAULTS if row.code is code for each in row.conditions}
    if reactions & {Reaction.STOP, Reaction.RAMP}:
        return Gravity.ENDS
    return Gravity.HALVES if Reaction.HALVE in reactions else Gravity.NOTHING


Active: TypeAlias = Mapping[Fault, Gravity]


@dataclass(slots=True)
class _Entry:
    code: Fault
    state: AlarmState
    raised_ns: int
    seen_ns: int
    gravity: Gravity = Gravity.NOTHING
    grave_ns: int = 0
    times_raised: int = 0
    sent: bool = False


class AlarmList:
    """The alarms of a controller, the most urgent first."""

    def __init__(self) -> None:
        self._entries: dict[Fault, _Entry] = {}
        self._order: list[_Entry] = []
        self._place = 0
        self._new: list[AlarmEvent] = []
        self.unaccepted = False  #: Whether one waits to be accepted.

    @property
    def codes(self) -> frozenset[Fault]:
        """What is in the list."""
        return frozenset(self._entries)

    def is_active(self, code: Fault) -> bool:
        """Whether the cause of an alarm in the list is there, or was within `GONE_NS`."""
        entry = self._entries.get(code)
        return entry is not None and entry.state is not AlarmState.RECTIFIED_UNACKNOWLEDGED

    def update(self, active: Active, mode: Mode, now_ns: int) -> None:
        """Take the faults whose cause is there."""
        entries = self._entries
        for code, gravity in active.items():
            entry = entries.get(code)
            if (
                entry is None
                or entry.state is AlarmState.RECTIFIED_UNACKNOWLEDGED
                or (entry.state is AlarmState.ACTIVE_ACKNOWLEDGED and gravity > entry.gravity)
            ):
                entry = self.raise_anew(code, mode, now_ns)
            entry.seen_ns = now_ns
            if gravity >= entry.gravity or now_ns - entry.grave_ns >= GONE_NS:
                entry.gravity, entry.grave_ns = gravity, now_ns
        for entry in tuple(entries.values()):
            if now_ns - entry.seen_ns >= GONE_NS:
                if entry.state is AlarmState.ACTIVE_UNACKNOWLEDGED:
                    self._enter(entry, AlarmState.RECTIFIED_UNACKNOWLEDGED, mode, now_ns)
                elif entry.state is AlarmState.ACTIVE_ACKNOWLEDGED:
                    self._enter(entry, AlarmState.NORMAL, mode, now_ns)

    def raise_anew(self, code: Fault, mode: Mode, now_ns: int) -> _Entry:
        """Raise the alarm of a fault, even if it is accepted and its cause has lasted since."""
        entry = self._entries.get(code)
        if entry is None:
            entry = self._entries[code] = _Entry(code, AlarmState.NORMAL, now_ns, now_ns)
        entry.raised_ns = entry.seen_ns = now_ns
        entry.gravity = Gravity.NOTHING
        entry.times_raised += 1
        entry.sent = False
        self._enter(entry, AlarmState.ACTIVE_UNACKNOWLEDGED, mode, now_ns)
        return entry

    def accept(self, code: int | None, mode: Mode, now_ns: int) -> None:
        """Accept the alarm of this code, or all for None; of those that a panel can have shown."""
        for entry in tuple(self._entries.values()):
            if entry.sent and (code is None or code == entry.code):
                if entry.state is AlarmState.ACTIVE_UNACKNOWLEDGED:
                    self._enter(entry, AlarmState.ACTIVE_ACKNOWLEDGED, mode, now_ns)
                elif entry.state is AlarmState.RECTIFIED_UNACKNOWLEDGED:
                    self._enter(entry, AlarmState.NORMAL, mode, now_ns)

    def reset_refused(self, code: Fault, mode: Mode, now_ns: int) -> None:
        """Note that a reset was refused, and why."""
        self._new.append(AlarmEvent(now_ns, code, None, mode))

    def next_message(self, now_ns: int) -> Alarm:
        """The alarm that is due to be sent: one after the other."""
        if not self._order:
            return _NOTHING
        place = self._place % len(self._order)
        self._place = place + 1
        entry = self._order[place]
        entry.sent = True
        age_s = (now_ns - entry.raised_ns) * 1e-9
        return Alarm(
            entry.state, entry.code, place, len(self._order), min(entry.times_raised, 254), age_s
        )

    def take_events(self) -> list[AlarmEvent]:
        """What happened since the last call."""
        events, self._new = self._new, []
        return events

    def _enter(self, entry: _Entry, state: AlarmState, mode: Mode, now_ns: int) -> None:
        entry.state = state
        if state is AlarmState.ACTIVE_ACKNOWLEDGED:
            entry.times_raised = 0  # since it was last accepted
        if state is AlarmState.NORMAL:
            del self._entries[entry.code]
        self._new.append(AlarmEvent(now_ns, entry.code, state, mode))
        self._order = sorted(
            self._entries.values(),
            key=lambda each: (each.state not in _UNACCEPTED, _URGENCY[each.code]),
        )
        self.unaccepted = any(each.state in _UNACCEPTED for each in self._order)


def active_faults(mode: Mode, fault: Fault, standing: int) -> dict[Fault, Gravity]:
    """Faults whose cause is there, or which are latched.

    What ends or halves the pressure counts in ACTIVE, and in FAULT, where it is a second fault;
    what cuts it at once counts everywhere, but in INIT of what is awaited the reason alone. Why
    arming was refused counts as long as it would be.

    Mode and fault are those of the supervisor, `standing` the conditions that hold
    (`judging.standing`).
    """
    found = dict.fromkeys(judging.faults(standing & judging.WARNING), Gravity.NOTHING)
    # in STANDBY it says why arming was refused, which may be some time ago
    refusing = standing & (judging.ENDING | judging.REFUSING)
    if mode is Mode.INIT or fault in judging.faults(refusing):
        found[fault] = Gravity.NOTHING
    if mode in (Mode.ACTIVE, Mode.FAULT):
        found |= dict.fromkeys(judging.faults(standing & judging.HALVING), Gravity.HALVES)
        found |= dict.fromkeys(judging.faults(standing & judging.ENDING), Gravity.ENDS)
    else:
        found |= dict.fromkeys(stopping_faults(mode, standing), Gravity.ENDS)
    if mode is Mode.FAULT:
        found[fault] = Gravity.ENDS
    found.pop(Fault.NONE, None)
    return found


def stopping_faults(mode: Mode, standing: int) -> set[Fault]:
    """What would stop the pump now, in INIT but for what is awaited."""
    stopping = standing & judging.STOPPING
    if mode is Mode.INIT:
        stopping &= ~judging.AWAITED
    return judging.faults(stopping)
