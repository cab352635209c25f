"""The log of a run: one JSON object per line for each event, with monotonic time and UTC."""

import contextlib
import json
import os
import time
from datetime import UTC, datetime
from pathlib import Path
from typing import Any, Final

from utank_hil.canbus.events import AlarmEvent
from utank_hil.safety.faults import FAULTS
from utank_hil.telemetry.events import Event

NAME: Final = "log-{}.jsonl"

_WORDS: Final = {row.code: (row.happened, row.remedy) for row in FAULTS}


class EventLog:
    """Appends and syncs each event to a file at once; raises OSError if it can't be opened."""

    def __init__(self, file: Path) -> None:
        self._file = file.open("ab", buffering=0)  # A write that did not fit is not repeated.

    def write(self, event: Event, start_ns: int) -> None:
        """Append an event whose `time_ns` counts from `start_ns` on this machine's monotonic clock.

        OSError is raised if there is no room; then no part of the event is left.
        """
        monotonic_ns = start_ns + event.time_ns
        utc_ns = time.time_ns() - time.monotonic_ns() + monotonic_ns
        line = {
            "utc": datetime.fromtimestamp(utc_ns * 1e-9, UTC).isoformat(timespec="milliseconds"),
            "monotonic_ns": monotonic_ns,
            "time_s": event.time_ns * 1e-9,
            **_content(event),
        }
        left = (json.dumps(line, ensure_ascii=False) + "\n").encode(errors="replace")
        begin = self._file.seek(0, os.SEEK_END)
        try:
            while left:  # A partial write is followed by one that gives the reason.
                left = left[self._file.write(left) :]
            os.fsync(self._file.fileno())
        except OSError:
            with contextlib.suppress(OSError):
                self._file.truncate(begin)
            raise

    def close(self) -> None:
        """Close the file; idempotent."""
        self._file.close()


def _content(event: Event) -> dict[str, Any]:
    if not isinstance(event, AlarmEvent):
        return {"event": "retuning", **{k: v for k, v in event.as_json().items() if k != "time_s"}}
    happened, remedy = _WORDS.get(event.code, ("", ""))
    return {
        "event": "reset refused" if event.state is None else "alarm",
        "state": None if event.state is None else event.state.name,
        "code": int(event.code),
        "fault": event.code.name,
        "mode": event.mode.name,
        "happened": happened,
        "remedy": remedy,
    }
