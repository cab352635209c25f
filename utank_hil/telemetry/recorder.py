"""The recorder: a process that writes rows and events to a Rerun file.

Beside it, it writes the frame log: what the controller was handed and what it answered. Where Rerun
is not installed, that is all it writes.

`RecorderProcess` starts it from a bench or from the deployed controller; `python -m
utank_hil.telemetry.recorder --ring NAME --file OUT.rrd` attaches one by hand. It ends when the ring
is closed, when the ring's writer dies, or on SIGINT, SIGTERM or SIGHUP, with all rows written. The
controller never waits for it: rows that it reads too late are overwritten and counted as lost.

Each file of a long recording is written by the process anew (`execv`): Rerun keeps memory and
threads of the files that are finished. So it goes on in another file where one fails, on a full
disk for example, as soon as there is room; the rows of 80 s wait in their ring.
"""

import argparse
import contextlib
import json
import os
import select
import shutil
import signal
import subprocess
import sys
from collections.abc import Mapping
from contextlib import ExitStack
from dataclasses import asdict, dataclass
from importlib.util import find_spec
from pathlib import Path
from typing import Any, Final, NoReturn

import numpy as np

from utank_hil.base.background import give_way
from utank_hil.base.closing import Closing
from utank_hil.telemetry.bus_records import RECORD, Kind, records_of
from utank_hil.telemetry.event_ring import EventReader
from utank_hil.telemetry.frame_log import SUFFIX, FrameLogWriter
from utank_hil.telemetry.ring import RingReader, held_ring
from utank_hil.telemetry.rotation import SUFFIXES, Rotation, make_room, part_of
from utank_hil.telemetry.viewer import rerun_environment

BATCH_S: Final = 0.5  # a batch costs 1 kB of file; a kill loses up to two
NEEDS_RERUN: Final = "it needs rerun-sdk: pip install 'utank-hil[viewer]'"
_START_TIMEOUT_S: Final = 30.0
_STOP_TIMEOUT_S: Final = 30.0
_NICENESS: Final = 5
_RETRY_S: Final = 10.0
_FULL_BYTES: Final = 1 << 20
"""A disk with less room counts as full."""
_CONTENT: Final = "--content"
_ENDING: Final = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)


class RecorderError(RuntimeError):
    """The recorder process did not start, or ended badly."""


@dataclass(frozen=True, slots=True)
class RecorderReport:
    """Result of a recording.

    Attributes
    ----------
    rows : int
        Rows recorded.
    lost : int
        Rows the ring overwrote before they were read.
    parts : int
        Files; of the frame log, where there is no other.
    records_lost : int
        Rows of the frame log that its ring overwrote before they were read.
    """

    rows: int
    lost: int
    parts: int = 1
    records_lost: int = 0


@dataclass(frozen=True, slots=True)
class Places:
    """Rows of the rings at which a part of a recording begins; None is the oldest.

    Attributes
    ----------
    rows, events, frames : int or None
        Of each ring, as `RingReader.place`.
    """

    rows: int | None = None
    events: int | None = None
    frames: int | None = None


@dataclass(slots=True)
class Progress:
    """How far a recording has come.

    Attributes
    ----------
    report : RecorderReport
        What the parts so far hold.
    places : Places
        Where they end.
    """

    report: RecorderReport
    places: Places


@dataclass(frozen=True, slots=True)
class Source:
    """What is recorded, and where.

    Attributes
    ----------
    ring : str
        Name of the ring of rows.
    file : Path
        The first `.rrd` file.
    events : str or None
        Name of the ring of events (`EventWriter`) that belongs to it.
    rotation : Rotation or None
        Where it goes on in another file; without it there is one.
    frames : str or None
        Name of the ring of `bus_records`; they go into a frame log beside the file.
    head : mapping
        Head of the frame log (`replay_head`).
    """

    ring: str
    file: Path
    events: str | None
    rotation: Rotation | None
    frames: str | None
    head: Mapping[str, Any]


def record_part(source: Source, progress: Progress) -> bool:
    """Record into one file until the ring ends, a signal comes or it is time for the next file.

    The signals have to be blocked.

    Parameters
    ----------
    progress : Progress
        That of the parts before; kept up to date with what has reached the file.

    Returns
    -------
    bool
        Whether there is a next part.

    Raises
    ------
    RingError
        If there is no such ring.
    OSError
        If the file can't be created, or there is no room for the beginning of a recording.
    RuntimeError
        If the file can't be finished.
    """
    before, places = progress.report, progress.places
    number = before.parts + 1
    file, rotation = part_of(source.file, number), source.rotation
    make_room(source.file, number, rotation)
    with ExitStack() as stack:
        reader = stack.enter_context(RingReader(source.ring, places.rows))
        event_reader = None
        if source.events is not None:
            event_reader = stack.enter_context(EventReader(source.events, places.events))
        part = None
        if find_spec("rerun") is not None:
            from utank_hil.telemetry.part import RecordingPart

            part = RecordingPart(file, reader.columns, reader.about)
        log = None
        if source.frames is not None:
            log = FrameRecording(source.frames, file, source.head, places.frames)
            stack.enter_context(log)
            # where the other file fails, both go on from the same place in the next part
            stack.callback(lambda: log.take_back(progress.places.frames))
        if number == 1:
            _print_json({"ready": 1})
        time = reader.columns.index("time_s")
        recorded = 0
        begin_s: float | None = None
        last = full = False
        while not (last or full):
            last = reader.ended or signal.sigtimedwait(_ENDING, BATCH_S) is not None
            rows = reader.read()
            if len(rows):
                recorded += len(rows)
                begin_s = float(rows[0, time]) if begin_s is None else begin_s
                full = rotation is not None and rows[-1, time] - begin_s >= rotation.part_s
            new_events = [] if event_reader is None else event_reader.read()
            if log is not None:
                log.write()
            if part is not None:
                part.note_lost("rows", reader.lost)
                if len(rows):
                    part.write(rows)
                part.write_events(new_events)
                if event_reader is not None:
                    part.note_lost("events", event_reader.lost)
                if len(rows) or new_events:
                    part.flush()
            progress.report = RecorderReport(
                before.rows + recorded,
                before.lost + reader.lost,
                number,
                before.records_lost + (0 if log is None else log.lost),
            )
            progress.places = Places(
                reader.place,
                None if event_reader is None else event_reader.place,
                None if log is None else log.place,
            )
        if part is not None:
            part.close()
        return not last


class FrameRecording(Closing):
    """Writes a ring of `bus_records` into a frame log.

    Parameters
    ----------
    file : Path
        The recording beside which the log is written.
    place : int, optional
        As that of a `RingReader`.

    Attributes
    ----------
    lost : int
        Rows that were overwritten before they were read.
    """

    def __init__(
        self, ring: str, file: Path, head: Mapping[str, Any], place: int | None = None
    ) -> None:
        self._reader = RingReader(ring, place)
        self._writer = FrameLogWriter(file.with_suffix(SUFFIX), head)
        self._wrote = False
        self.lost = 0

    @property
    def place(self) -> int:
        """Of the ring, as `RingReader.place`."""
        return self._reader.place

    def write(self) -> None:
        """Write what has come since the last call."""
        rows = self._reader.read()
        records = records_of(rows)
        self._wrote = len(records) > 0
        lost = self._reader.lost - self.lost
        if lost and len(records):
            self.lost += lost
            gap = np.zeros(1, dtype=RECORD)
            gap["kind"], gap["number"], gap["time_ns"] = Kind.LOST, lost, records["time_ns"][0]
            records = np.concatenate([gap, records])
        self._writer.write(records)

    def take_back(self, place: int | None) -> None:
        """Remove what was written since the reader was at a place, if anything."""
        if self._wrote and self.place != place:
            self._writer.take_back()

    def close(self) -> None:
        """Close ring and file; idempotent."""
        self._reader.close()
        self._writer.close()


class RecorderProcess(Closing):
    """A recorder in a process of its own; ready when the constructor returns.

    Start it before the loop: it takes about a second, mostly for importing Rerun. It runs in a
    session of its own, so that Ctrl-C in the terminal does not end it before the loop's last rows.
    Arguments are those of `Source`.

    Raises
    ------
    RecorderError
        If the recorder does not start, with the reason.
    """

    def __init__(
        self,
        ring: str,
        file: Path,
        events: str | None = None,
        rotation: Rotation | None = None,
        frames: str | None = None,
        head: Mapping[str, Any] | None = None,
    ) -> None:
        if find_spec("rerun") is None and frames is None:
            raise RecorderError(NEEDS_RERUN)
        command = [sys.executable, "-m", __name__, "--ring", ring, "--file", str(file)]
        if events is not None:
            command += ["--events", events]
        if frames is not None:
            command += ["--frames", frames]
        if head is not None:
            command += [_CONTENT]
        if rotation is not None:
            command += ["--part-s", str(rotation.part_s)]
            if rotation.keep_bytes is not None:
                command += ["--keep-bytes", str(rotation.keep_bytes)]
        self._end: RecorderReport | RecorderError | None = None
        self._process = subprocess.Popen(
            command,
            stdin=subprocess.DEVNULL if head is None else subprocess.PIPE,
            stdout=subprocess.PIPE,
            env=rerun_environment(),
            start_new_session=True,
            text=True,
        )
        if self._process.stdin is not None:
            with contextlib.suppress(BrokenPipeError), self._process.stdin as content:
                json.dump({"head": head}, content)  # where it has ended already, its reason follows
        output = self._process.stdout
        assert output is not None
        ready, _, _ = select.select([output], [], [], _START_TIMEOUT_S)
        self._output = output
        reply = json.loads(output.readline() or "{}") if ready else {}
        if "ready" not in reply:
            self._kill()
            reason = reply.get(
                "error", "it ended" if ready else f"silent for {_START_TIMEOUT_S:g} s"
            )
            raise RecorderError(f"the recorder of {file} did not start: {reason}")

    @property
    def pid(self) -> int:
        """Number of the process."""
        return self._process.pid

    @property
    def has_ended(self) -> bool:
        """Whether the process has ended."""
        return self._process.poll() is not None

    def stop(self) -> RecorderReport:
        """Write the last rows and wait for the end of the process; idempotent.

        Raises
        ------
        RecorderError
            If the process failed, with the reason, or does not end.
        """
        if self._end is None:
            self._end = self._ended()
        if isinstance(self._end, RecorderError):
            raise self._end
        return self._end

    def close(self) -> None:
        """Same as `stop`."""
        self.stop()

    def _ended(self) -> RecorderReport | RecorderError:
        self._process.terminate()
        try:
            code = self._process.wait(_STOP_TIMEOUT_S)
        except subprocess.TimeoutExpired:
            self._kill()
            return RecorderError("the recorder did not end and was killed")
        with self._output:
            reply = json.loads(self._output.readline() or "{}")
        if code != 0:
            reason = reply.get("error", f"exit code {code}")
            return RecorderError(f"the recorder failed: {reason}")
        return RecorderReport(**reply)

    def _kill(self) -> None:
        self._process.kill()
        self._process.wait()
        self._output.close()


def _main() -> None:
    parser = argparse.ArgumentParser(description="Record a telemetry ring into a Rerun file.")
    parser.add_argument("--ring", required=True, metavar="NAME")
    parser.add_argument("--file", required=True, type=Path, metavar="OUT.rrd")
    parser.add_argument("--events", metavar="NAME", help="ring of events that belongs to it")
    parser.add_argument("--frames", metavar="NAME", help="ring of the frame log's records")
    parser.add_argument("--part-s", type=float, help="begin another file after so long")
    parser.add_argument("--keep-bytes", type=int, help="remove the oldest files beyond so much")
    parser.add_argument(
        _CONTENT, action="store_true", help="JSON on standard input: head of the frame log"
    )
    arguments = parser.parse_args()
    content = json.load(sys.stdin) if arguments.content else {}
    rotation = None
    if arguments.part_s is not None:
        rotation = Rotation(arguments.part_s, arguments.keep_bytes)
    os.environ.update(rerun_environment())
    signal.pthread_sigmask(signal.SIG_BLOCK, _ENDING)  # first: Rerun's threads inherit it
    progress = Progress(
        RecorderReport(**content.pop("report", {"rows": 0, "lost": 0, "parts": 0})),
        Places(**content.pop("places", {})),
    )
    failing, is_new = content.pop("failing", ""), content.pop("is_new", False)
    if failing:
        if is_new:
            _complain(arguments.file, f"{failing}; tried again every {_RETRY_S:g} s")
        if signal.sigtimedwait(_ENDING, _RETRY_S) is not None:
            _print_json({"error": failing})
            sys.exit(1)
    try:
        if "rings" not in content:
            give_way(_NICENESS)
            names = (arguments.ring, arguments.events, arguments.frames)
            content["rings"] = [None if name is None else held_ring(name) for name in names]
        ring, events, frames = content["rings"]
        source = Source(ring, arguments.file, events, rotation, frames, content.get("head", {}))
        if record_part(source, progress):
            _go_on(content | asdict(progress))
        _print_json(asdict(progress.report))
    except (OSError, RuntimeError) as error:
        reason = _reason(error, arguments.file)
        again = rotation is not None and progress.report.parts > 0
        again = again and not _nobody_writes(content["rings"][0])
        if again:
            begun = part_of(arguments.file, progress.report.parts + 1)
            for suffix in SUFFIXES:  # of a part that has nothing yet
                begun.with_suffix(suffix).unlink(missing_ok=True)
            # at once: Rerun's threads would write on as soon as there is room, after a hole
            _go_on(content | asdict(progress) | {"failing": reason, "is_new": reason != failing})
        if reason != failing:
            _complain(arguments.file, reason)
        _print_json({"error": reason})
        os._exit(1)  # Rerun's exit hook would wait forever for a dead writer


def _complain(file: Path, reason: str) -> None:
    with contextlib.suppress(OSError):  # a terminal that is gone
        print(f"recording {file} failed: {reason}", file=sys.stderr)
        sys.stderr.flush()


def _nobody_writes(ring: str) -> bool:
    """Whether the writer of a ring has closed it or is dead: there is nothing to try again for."""
    try:
        with RingReader(ring) as reader:
            return reader.ended
    except (OSError, RuntimeError):
        return True


def _reason(error: Exception, file: Path) -> str:
    """Why a recording failed: Rerun says nothing of a full disk."""
    with contextlib.suppress(OSError):
        if shutil.disk_usage(file.parent).free < _FULL_BYTES:
            return f"the disk of {file.parent} is full ({error})"
    return str(error)


def _go_on(content: Mapping[str, Any]) -> NoReturn:
    """Begin the program anew in this process, for the next part; signals stay blocked."""
    file = os.memfd_create("recorder")
    with open(file, "w", encoding="utf-8", closefd=False) as written:
        json.dump(content, written)
    os.lseek(file, 0, os.SEEK_SET)
    os.dup2(file, sys.stdin.fileno())
    command = sys.orig_argv if _CONTENT in sys.orig_argv else [*sys.orig_argv, _CONTENT]
    os.execv(sys.executable, command)


def _print_json(message: Mapping[str, int | str]) -> None:
    """Send a message to the parent, if it lives: one JSON object a line on standard output."""
    with contextlib.suppress(BrokenPipeError):  # nothing is buffered, or it would fail at the end
        os.write(sys.stdout.fileno(), f"{json.dumps(message)}\n".encode())


if __name__ == "__main__":
    _main()
