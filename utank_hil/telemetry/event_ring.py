"""Transport of events out of the loop: a telemetry ring whose rows hold JSON text.

Events are those of retuning and of the alarm list.

As with the ring itself, a write takes microseconds and never blocks, several processes can read,
and events survive a killed writer.
"""

import json
from dataclasses import asdict
from typing import Any, Final, TypeAlias

import numpy as np

from utank_hil.base.closing import Closing
from utank_hil.canbus.enumerations import AlarmState, Fault, Mode, RetuningState
from utank_hil.retuning.answer import ModelSummary
from utank_hil.retuning.law_exchange import RetuningEvent
from utank_hil.safety.alarms import AlarmEvent
from utank_hil.safety.faults import fault_text
from utank_hil.telemetry.ring import RingReader, RingWriter

_TEXT_WORDS: Final = 1024
_WORDS: Final = ("length", *(f"text_{number}" for number in range(_TEXT_WORDS)))
_CAPACITY: Final = 64  # a retuning has four events in four minutes; readers poll every 0.5 s
_LONGEST_BYTES: Final = 8 * _TEXT_WORDS
_MOST_BYTES_A_CHARACTER: Final = 6  # of an escaped character in JSON
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
    """Return whether an event is more than news."""
    if isinstance(event, AlarmEvent):
        return event.state in (AlarmState.ACTIVE_UNACKNOWLEDGED, None)
    return event.state in (RetuningState.REFUSED, RetuningState.UNDONE)


class EventWriter(Closing):
    """The writing end, for the loop; creates the ring and owns it.

    Attributes
    ----------
    name : str
        Name of the ring, for readers.

    Raises
    ------
    RingError
        If there is no room in shared memory.
    """

    def __init__(self) -> None:
        self._ring = RingWriter(_WORDS, capacity=_CAPACITY)
        self.name = self._ring.name
        self._row = np.zeros(len(_WORDS))
        self._text = self._row[1:].view(np.uint8)

    def write(self, event: Event, start_ns: int) -> None:
        """Append one event; never blocks. Reasons too long for a row are cut.

        Parameters
        ----------
        start_ns : int
            Time of the first telemetry row; readers get the time since then.
        """
        if isinstance(event, AlarmEvent):
            self._append(_encoded_alarm(event, start_ns))
            return
        reasons = event.reasons
        if sum(map(len, reasons)) > _LONGEST_BYTES:
            reasons = _cut(reasons)  # first: encoding takes long for what would be thrown away
        data = _encoded(event, reasons, start_ns)
        if len(data) > _LONGEST_BYTES:
            data = _encoded(event, _cut(reasons), start_ns)
        self._append(data)

    def _append(self, data: bytes) -> None:
        self._row[0] = len(data)
        self._text[: len(data)] = np.frombuffer(data, dtype=np.uint8)
        self._ring.write(self._row)

    def close(self) -> None:
        """Mark the ring as closed for readers, and free it; idempotent."""
        self._ring.close()


class EventReader(Closing):
    """A reading end with its own cursor.

    Parameters
    ----------
    name : str
        The writer's `name`.
    place : int, optional
        As that of a `RingReader`.

    Raises
    ------
    RingError
        If there is no such ring.

    Attributes
    ----------
    start_ns : int
        Time of the first telemetry row on the writer's monotonic clock, once there was an event.
    """

    def __init__(self, name: str, place: int | None = None) -> None:
        self._ring = RingReader(name, place)
        self.start_ns = 0

    def read(self) -> list[Event]:
        """Events since the last call, oldest first, `time_ns` since the start; never blocks."""
        contents = [json.loads(row[1:].tobytes()[: int(row[0])]) for row in self._ring.read()]
        if contents:
            self.start_ns = contents[-1]["start_ns"]
        return [_decoded(content) for content in contents]

    @property
    def place(self) -> int:
        """As that of a `RingReader`."""
        return self._ring.place

    @property
    def ended(self) -> bool:
        """Whether no more events will be written; check before reading."""
        return self._ring.ended

    @property
    def lost(self) -> int:
        """Events overwritten before they were read."""
        return self._ring.lost

    def close(self) -> None:
        """Release the memory; idempotent."""
        self._ring.close()


def is_event_ring(ring: RingReader) -> bool:
    """Whether a ring is one of events."""
    return ring.columns == _WORDS


def event_text(event: Event) -> str:
    """Text of an event, such as `retuning REFUSED: the record is too short`."""
    if isinstance(event, AlarmEvent):
        return f"{_ALARM_WORDS[event.state]} in {event.mode.name}: {fault_text(event.code)}"
    text = f"retuning {event.state.name}"
    return f"{text}: {'; '.join(event.reasons)}" if event.reasons else text


def _cut(reasons: tuple[str, ...]) -> tuple[str]:
    """Reasons short enough for a row, whatever their characters."""
    return ("; ".join(reasons)[:_CUT] + " ...",)


def _encoded(event: RetuningEvent, reasons: tuple[str, ...], start_ns: int) -> bytes:
    content = {
        "time_ns": event.time_ns - start_ns,
        "start_ns": start_ns,
        "state": int(event.state),
        "reasons": reasons,
        "found": None if event.found is None else asdict(event.found),
    }
    return json.dumps(content, ensure_ascii=False).encode(errors="replace")


def _encoded_alarm(event: AlarmEvent, start_ns: int) -> bytes:
    content = {
        "time_ns": event.time_ns - start_ns,
        "start_ns": start_ns,
        "code": int(event.code),
        "alarm": None if event.state is None else int(event.state),
        "mode": int(event.mode),
    }
    return json.dumps(content).encode()


def _decoded(content: dict[str, Any]) -> Event:
    if "code" in content:
        state = content["alarm"]
        return AlarmEvent(
            content["time_ns"],
            Fault(content["code"]),
            None if state is None else AlarmState(state),
            Mode(content["mode"]),
        )
    found = content["found"]
    return RetuningEvent(
        content["time_ns"],
        RetuningState(content["state"]),
        tuple(content["reasons"]),
        None if found is None else ModelSummary(**found),
    )
