"""The ring of events of retuning and alarms: a record is the JSON text of one event.

A write takes some twenty microseconds.
"""

import json
from dataclasses import asdict, replace
from typing import Any, Final, TypeAlias

import msgspec

from utank_hil.canbus.enumerations import AlarmState, RetuningState
from utank_hil.canbus.events import AlarmEvent, RetuningEvent
from utank_hil.safety.faults import fault_text
from utank_hil.telemetry.ring import RingKind, RingReader, RingWriter

_SLOTS: Final = 64  #: A retuning has four events in four minutes; readers poll every 0.5 s.
_LONGEST_BYTES: Final = 8192  #: Of an event; a longer text is cut.
_MOST_BYTES_A_CHARACTER: Final = 6  #: Length of an escaped character in JSON.
_CUT: Final = _LONGEST_BYTES // (2 * _MOST_BYTES_A_CHARACTER)
Event: TypeAlias = RetuningEvent | AlarmEvent
_ALARM_WORDS: Final = {
    AlarmState.ACTIVE_UNACKNOWLEDGED: "ALARM",
    AlarmState.ACTIVE_ACKNOWLEDGED: "alarm accepted",
    AlarmState.RECTIFIED_UNACKNOWLEDGED: "cause of an alarm gone",
    AlarmState.NORMAL: "alarm over",
    None: "reset REFUSED while this lasts,",
}


def warns(event: Event) -> bool:
    """Whether an event is a warning."""
    if isinstance(event, AlarmEvent):
        return event.state in (AlarmState.ACTIVE_UNACKNOWLEDGED, None)
    return event.state in (RetuningState.REFUSED, RetuningState.UNDONE)


def event_text(event: Event) -> str:
    """Return the text of an event, such as `retuning REFUSED: the record is too short`."""
    if isinstance(event, AlarmEvent):
        text = f"{_ALARM_WORDS[event.state]} in {event.mode.name}: {fault_text(event.code)}"
        return f"{text} Received: {event.received}" if event.received else text
    text = f"retuning {event.state.name}"
    return f"{text}: {'; '.join(event.reasons)}" if event.reasons else text


class EventWriter(RingWriter):
    """Writing end for the loop; raises RingError without room in shared memory."""

    def __init__(self) -> None:
        super().__init__(RingKind.EVENTS, 1, _LONGEST_BYTES, _SLOTS)

    def write_event(self, event: Event, start_ns: int) -> None:
        """Append one event without blocking; reasons too long for a record are cut.

        `start_ns` is the time of the first telemetry row, from which readers count.
        """
        if isinstance(event, RetuningEvent) and sum(map(len, event.reasons)) > _LONGEST_BYTES:
            event = _cut(event)  # The event is cut first, because encoding takes long.
        data = _encoded(event, start_ns)
        if len(data) > _LONGEST_BYTES and isinstance(event, RetuningEvent):
            data = _encoded(_cut(event), start_ns)
        self.write(data)


class EventReader(RingReader):
    """A reading end."""

    def __init__(self, name: str, place: int | None = None) -> None:
        super().__init__(name, place, RingKind.EVENTS)
        #: Time of the first telemetry row on the writer's monotonic clock, set by the first event.
        self.start_ns = 0

    def read_events(self) -> list[Event]:
        """Return new events, oldest first, with `time_ns` since the start; never blocks."""
        contents = [json.loads(record) for record in self.read()]
        if contents:
            self.start_ns = contents[-1]["start_ns"]
        return [_decoded(content) for content in contents]


def _cut(event: RetuningEvent) -> RetuningEvent:
    """Return the event with reasons short enough for a record, whatever their characters."""
    return replace(event, reasons=("; ".join(event.reasons)[:_CUT] + " ...",))


def _encoded(event: Event, start_ns: int) -> bytes:
    content = asdict(event) | {"time_ns": event.time_ns - start_ns, "start_ns": start_ns}
    return json.dumps(content, ensure_ascii=False).encode(errors="replace")


def _decoded(content: dict[str, Any]) -> Event:
    if "code" in content:
        return msgspec.convert(content, AlarmEvent)
    return msgspec.convert(content, RetuningEvent)
