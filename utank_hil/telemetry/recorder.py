"""The recorder: a process that writes rows and events to a Rerun file, and the frame log beside it.

Without Rerun only the frame log is written. It ends when the ring is closed, when the ring's writer
dies, or on SIGINT, SIGTERM or SIGHUP, with all rows written. The controller never waits: rows read
too late are overwritten and counted as lost.

The process replaces itself (`execv`) for each file of a long recording, because Rerun keeps memory
and threads of finished files. After a failure, such as a full disk, it continues in another file as
soon as there is room; the ring holds the rows of 80 s.
"""

import json
import os
import shutil
import signal
import sys
from collections.abc import Mapping
from contextlib import ExitStack, suppress
from dataclasses import asdict
from importlib.util import find_spec
from pathlib import Path
from typing import Final, NoReturn

from utank_hil.base.background import give_way
from utank_hil.telemetry.events import EventReader
from utank_hil.telemetry.frame_log import FrameRecording
from utank_hil.telemetry.recorder_process import RecorderState
from utank_hil.telemetry.ring import RingKind, RingReader, RowReader
from utank_hil.telemetry.rotation import SUFFIXES, make_room, part_of
from utank_hil.telemetry.viewer import rerun_environment

BATCH_S: Final = 0.5  #: Time between two writes: one costs 1 kB, a kill loses two at most.
RETRY_S: Final = 10.0  #: Time between two attempts to begin a file.
_NICENESS: Final = 5  #: Below what controls, above idle.
_FULL_BYTES: Final = 1 << 20  #: Free space below which a disk counts as full.
_ENDING: Final = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)


def record_part(state: RecorderState) -> bool:
    """Record into one file until the ring ends, a signal comes or the next file is due.

    The signals must be blocked. `state` is updated with what has reached the file. Returns whether
    there is a next part. Raises `RingError` if there is no such ring, `OSError` if the file can't
    be created or has no room for its beginning, and `RuntimeError` if it can't be finished.
    """
    task, report, places = state.task, state.report, state.places
    lost_before, records_lost_before = report.lost, report.records_lost
    number = report.parts + 1
    file = part_of(Path(task.file), number)
    if task.keep_bytes is not None:
        make_room(Path(task.file), number, task.keep_bytes)
    with ExitStack() as stack:
        reader = stack.enter_context(RowReader(task.rows, places.get(RingKind.ROWS)))
        events = log = part = None
        if task.events is not None:
            events = EventReader(task.events, places.get(RingKind.EVENTS))
            stack.enter_context(events)
        if find_spec("rerun") is not None:
            from utank_hil.telemetry.live import RecordingPart

            part = RecordingPart(file, reader.columns, reader.about)
        if task.frames is not None:
            log = FrameRecording(task.frames, file, task.head, places.get(RingKind.FRAMES))
            stack.enter_context(log)
        if number == 1:
            _say({"ready": 1})
        time = reader.columns.index("time_s")
        begin_s: float | None = None
        last = full = False
        while not (last or full):
            last = reader.ended or signal.sigtimedwait(_ENDING, BATCH_S) is not None
            rows = reader.read_rows()
            if len(rows):
                begin_s = float(rows[0, time]) if begin_s is None else begin_s
                full = task.part_s is not None and rows[-1, time] - begin_s >= task.part_s
            new_events = [] if events is None else events.read_events()
            if part is not None:
                part.note_lost("rows", reader.lost)
                part.note_lost("events", 0 if events is None else events.lost)
                part.write(rows, new_events)
                report.parts = number
            report.rows += len(rows)
            report.lost = lost_before + reader.lost
            places[RingKind.ROWS] = reader.place
            if events is not None:
                places[RingKind.EVENTS] = events.place
            if log is not None:  # Each has its place: a failure of one does not repeat the other.
                log.write()
                report.records_lost = records_lost_before + log.lost
                places[RingKind.FRAMES] = log.place
            report.parts = number
        if part is not None:
            part.close()
        return not last


def _main() -> None:
    os.environ.update(rerun_environment())
    signal.pthread_sigmask(signal.SIG_BLOCK, _ENDING)  # Rerun's threads inherit it
    state = RecorderState.of_input()
    if state.failure:
        _complain(state, f"; tried again every {RETRY_S:g} s")
        if signal.sigtimedwait(_ENDING, RETRY_S) is not None:
            _say({"error": state.failure})
            sys.exit(1)
    try:
        if not state.report.parts:
            give_way(_NICENESS)
            state.task = state.task.held()
        if record_part(state):
            state.failure = ""
            _go_on(state)
        _say(asdict(state.report))
    except (OSError, RuntimeError) as error:
        file = Path(state.task.file)
        reason = _reason(error, file)
        state.complained = reason == state.failure
        state.failure = reason
        several = state.task.part_s is not None
        if state.report.parts and several and not _writer_ended(state.task.rows):
            begun = part_of(file, state.report.parts + 1)
            for suffix in SUFFIXES:  # Remove files of a part that is still empty.
                begun.with_suffix(suffix).unlink(missing_ok=True)
            # Otherwise Rerun's threads would write on, after a hole, as soon as there is room.
            _go_on(state)
        _complain(state)
        _say({"error": reason})
        os._exit(1)  # Rerun's exit hook would wait forever for a dead writer.


def _complain(state: RecorderState, more: str = "") -> None:
    """Report once on standard error why a file failed."""
    if not state.complained:
        state.complained = True
        with suppress(OSError):  # The terminal may be gone.
            print(f"recording {state.task.file} failed: {state.failure}{more}", file=sys.stderr)
            sys.stderr.flush()


def _writer_ended(ring: str) -> bool:
    try:
        with RingReader(ring) as reader:
            return reader.ended
    except OSError:
        return True


def _reason(error: Exception, file: Path) -> str:
    """Return the reason why a recording failed; Rerun gives none for a full disk."""
    with suppress(OSError):
        if shutil.disk_usage(file.parent).free < _FULL_BYTES:
            return f"the disk of {file.parent} is full ({error})"
    return str(error)


def _go_on(state: RecorderState) -> NoReturn:
    """Replace the program in this process for the next part; signals stay blocked."""
    os.dup2(state.as_input(), sys.stdin.fileno())
    os.execv(sys.executable, sys.orig_argv)


def _say(message: Mapping[str, int | str]) -> None:
    """Send a message to the parent, if alive: one JSON object per line on standard output."""
    with suppress(BrokenPipeError):  # Nothing is buffered, which would fail at the end.
        os.write(sys.stdout.fileno(), f"{json.dumps(message)}\n".encode())


if __name__ == "__main__":
    _main()
