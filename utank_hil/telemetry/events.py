"""The ring of events of retuning and alarms, as JSON; a write takes some twenty microseconds."""

import json
from dataclasses import asdict, replace
from typing import Any, Final, TypeAlias

import msgspec

from utank_hil.canbus.enumerations import AlarmState, RetuningState
from utank_hil.canbus.events import AlarmEvent, RetuningEvent
from utank_hil.safety.faults import fault_text
from utank_hil.telemetry.ring import RingKind, RingReader, RingWriter

_SLOTS: Final = 64  #: A retuning has four events in four minutes; readers poll every 0.5 s.
_LONGEST: Final = 1000  #: Characters of an event's reasons, the rest is cut.
_LONGEST_BYTES: Final = 8192  #: Of an event; an escaped character of JSON takes six.
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
        """Append an event, long reasons cut, without blocking; `start_ns` is of the first row."""
        if isinstance(event, RetuningEvent) and sum(map(len, event.reasons)) > _LONGEST:
            event = replace(event, reasons=("; ".join(event.reasons)[:_LONGEST] + " ...",))
        content = asdict(event) | {"time_ns": event.time_ns - start_ns, "start_ns": start_ns}
        self.write(json.dumps(content, ensure_ascii=False).encode(errors="replace"))


class EventReader(RingReader):
    """A reading end."""

    def __init__(self, name: str) -> None:
        super().__init__(name, RingKind.EVENTS)
        #: Time of the first telemetry row on the writer's monotonic clock, set by the first event.
        self.start_ns = 0

    def read_events(self) -> list[Event]:
        """Return new events, oldest first, with `time_ns` since the start; never blocks."""
        contents = [json.loads(record) for record in self.read()]
        if contents:
            self.start_ns = contents[-1]["start_ns"]
        return [event_of(content) for content in contents]


def event_of(content: dict[str, Any]) -> Event:
    """Return the event of a record of the ring; ValueError for other content."""
    if "code" in content:
        return msgspec.convert(content, AlarmEvent)
    return msgspec.convert(content, RetuningEvent)
