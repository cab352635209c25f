"""The announcer: a process that logs, prints and shows outward what happens, so the loop need not.

The loop writes an event into shared memory. This process logs it, prints it if it is of retuning,
and writes the identified ship to files. It reads the remaining events even if the loop was killed.
"""

import json
import time
from collections.abc import Sequence
from contextlib import ExitStack
from datetime import UTC, datetime
from io import FileIO
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any, Final

from utank_hil.base.whole_file import append_whole
from utank_hil.canbus import RetuningState
from utank_hil.canbus.events import AlarmEvent, RetuningEvent
from utank_hil.commands.identified import IdentifiedShips
from utank_hil.commands.lines import Lines
from utank_hil.commands.outward.outlets import Outlet, Outward
from utank_hil.console.terminal import notes, shown
from utank_hil.runners.beside import Beside, ready
from utank_hil.safety.faults import FAULTS
from utank_hil.telemetry.events import Event, EventReader, EventWriter, event_text

LOG_NAME: Final = "log-{}.jsonl"
_WORDS: Final = {row.code: (row.happened, row.remedy) for row in FAULTS}
LOOK_S: Final = 0.5  #: Time between two reads of the ring, short enough for a reader.
_PRINTED_S: Final = 5.0  #: Time to print the last lines on a busy machine.


def log_event(file: FileIO, event: Event, start_ns: int) -> None:
    """Append an event to a log of one JSON object a line, synced at once.

    Times are from `start_ns` on this machine's monotonic clock, and in UTC. `file` is unbuffered.
    OSError is raised if there is no room; then no part of the event is left.
    """
    line = {
        "utc": _utc(event, start_ns).isoformat(timespec="milliseconds"),
        "monotonic_ns": start_ns + event.time_ns,
        "time_s": event.time_ns * 1e-9,
        **_content(event),
    }
    append_whole(file, (json.dumps(line, ensure_ascii=False) + "\n").encode(errors="replace"))


def _utc(event: Event, start_ns: int) -> datetime:
    utc_ns = time.time_ns() - time.monotonic_ns() + start_ns + event.time_ns
    return datetime.fromtimestamp(utc_ns * 1e-9, UTC)


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


class Announcer:
    """Event ring of a run, and the process that logs and prints its events, ready at once."""

    def __init__(
        self,
        ships: IdentifiedShips | None = None,
        log: Path | None = None,
        outlets: Sequence[Outlet] = (),
    ) -> None:
        #: Name of the ring, for a recorder; None if there was no room for it.
        self.ring: str | None = None
        #: Why events are not printed; the controller runs nevertheless.
        self.error: str | None = None
        self._writer: EventWriter | None = None
        self._process: Beside | None = None
        try:
            self._writer = EventWriter()
            self.ring = self._writer.name
            what = "the process that logs events"
            self._process = Beside(what, announce, self.ring, ships, log, outlets)
        except OSError as error:
            self.error = str(error)

    def write(self, event: Event, start_ns: int) -> None:
        """Take one event; never waits."""
        if self._writer is not None:
            self._writer.write_event(event, start_ns)

    def failure(self) -> str:
        """Return once the reason why the process ended before the run; never waits."""
        failure = "" if self._process is None else self._process.failure()
        self.error = failure or self.error
        return failure

    def stop(self) -> None:
        """Let the last events be printed and check the result; idempotent."""
        if self._writer is None:
            return
        self._writer.close()
        self._writer = None
        if self._process is not None:
            self._process.stop(notes.say)
            self.error = self._process.error or self.error


def announce(
    ring: str,
    ships: IdentifiedShips | None,
    log: Path | None,
    outlets: Sequence[Outlet],
    told: Connection,
) -> None:
    """Log, print and show events outward until their writer ends or dies; the process's main."""
    with EventReader(ring) as reader, ExitStack() as stack:
        # A terminal may block, and the log must not wait for it.
        lines, events = Lines(), None
        stack.callback(lines.close, _PRINTED_S)
        if log is not None:
            try:
                # unbuffered: a write that did not fit is not repeated
                events = stack.enter_context(log.open("ab", buffering=0))
            except OSError as error:
                lines.say(f"no log of events: {error}")
        outward = None
        if outlets:
            outward = stack.enter_context(Outward(outlets, reader.writer_pid, lines.say))
        ready(told)
        while True:
            last = reader.ended
            for event in reader.read_events():
                try:
                    if events is not None:
                        log_event(events, event, reader.start_ns)
                except OSError as error:  # A full disk does not end it.
                    lines.say(f"an event was not logged: {error}")
                if isinstance(event, RetuningEvent):  # The run prints alarms itself, at once.
                    _print(event, ships, lines)
                elif outward is not None:
                    outward.take(event, _utc(event, reader.start_ns))
            if outward is not None:
                outward.look(reader.lost)
            if last:
                break
            time.sleep(LOOK_S)
        if reader.lost:
            lines.say(f"{reader.lost} events were lost")


def _print(event: RetuningEvent, ships: IdentifiedShips | None, lines: Lines) -> None:
    kept = ""
    if ships is not None and event.found is not None and event.state is RetuningState.RETUNED:
        try:
            files = ships.write(event.found)
        except (OSError, ValueError) as error:  # no room, or a ship that no file may hold
            kept = f"the ship that was found could not be written: {error}"
        else:
            kept = f"the ship that was found: {', '.join(map(shown, files.values()))}"
    lines.say(f"{event.time_ns * 1e-9:8.1f} s {event_text(event)}")
    if kept:
        lines.say(kept)
