"""The log of a run: its frame log, with rows of telemetry and events in the same file.

It is written beside the loop from three rings in shared memory, and goes on in another file, a
part, every hour. Rows and events are read part by part.
"""

import json
import struct
from collections.abc import Callable, Mapping
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np

from utank_hil.base.arrays import FloatArray
from utank_hil.base.closing import Closing
from utank_hil.base.whole_file import left_whole
from utank_hil.telemetry import frame_log
from utank_hil.telemetry.events import Event, event_of
from utank_hil.telemetry.ring import RingKind, RingReader, RowReader
from utank_hil.telemetry.rotation import make_room, part_of

_COUNT: Final = struct.Struct("<I")


@dataclass(frozen=True, slots=True)
class RunLogTask:
    """Sources and destination of a run's log."""

    #: rows, frames, events: names of its rings (`RowWriter`, `frame_ring`, `EventWriter`).
    rows: str
    frames: str
    events: str | None
    file: Path  #: The first part.
    head: Mapping[str, Any]  #: Head of the frame log (`replay_head`).
    part_s: float  #: Length of a part.
    keep_bytes: int | None = None  #: Size of the folder (`rotation.make_room`); None for no limit.


@dataclass(slots=True)
class RunLogReport:
    """What was written, and what the rings overwrote before it was read."""

    #: rows, lost, records_lost: rows, lost rows, and lost records of the frame log.
    rows: int = 0
    lost: int = 0
    records_lost: int = 0
    parts: int = 0


class RunLogWriter(Closing):
    """Writes the log of a run; OSError if a ring is not there, or a part can't be begun.

    A part that can't be begun leaves no file.
    """

    def __init__(self, task: RunLogTask) -> None:
        self.report = RunLogReport()
        self._task = task
        with ExitStack() as stack:
            self._rows = stack.enter_context(RowReader(task.rows))
            self._frames = stack.enter_context(RingReader(task.frames, kind=RingKind.FRAMES))
            self._events: RingReader | None = None
            if task.events is not None:
                self._events = RingReader(task.events, kind=RingKind.EVENTS)
                stack.enter_context(self._events)
            self._head = {**task.head, "columns": self._rows.columns}
            self._file = self._begun()
            self._stack = stack.pop_all()

    @property
    def ended(self) -> bool:
        """Whether no more rows will come: what `write` writes then is the last."""
        return self._rows.ended

    def write(self) -> None:
        """Write what has come; OSError without room: the rings hold it for the next time."""
        if self._full:
            self._file.close()
            self._file = self._begun()
        self._take(self._frames, self._write_frames)
        self._take(self._rows, self._write_rows)
        if self._events is not None:
            self._take(self._events, self._write_events)

    def close(self) -> None:
        """Close rings and file; idempotent."""
        self._stack.close()
        self._file.close()

    def _begun(self) -> frame_log.FrameLogWriter:
        number = self.report.parts + 1
        file = part_of(self._task.file, number)
        if self._task.keep_bytes is not None:
            make_room(self._task.file, number, self._task.keep_bytes)
        with left_whole(file):
            begun = frame_log.FrameLogWriter(file, self._head)
        self.report.parts = number
        self._begin_ns: int | None = None
        self._full = False
        return begun

    @staticmethod
    def _take(ring: RingReader, write: Callable[[], None]) -> None:
        place, lost = ring.place, ring.lost
        try:
            write()
        except OSError:
            ring.place, ring.lost = place, lost
            raise

    def _write_frames(self) -> None:
        records = np.frombuffer(b"".join(self._frames.read()), dtype=frame_log.RECORD)
        if not len(records):
            return
        first_ns, last_ns = (int(records["time_ns"][at]) for at in (0, -1))
        lost = (
            frame_log.IN_A_SLOT * self._frames.lost - self.report.records_lost
        )  # Each counts as full.
        if lost:
            gap = np.zeros(1, dtype=frame_log.RECORD)
            gap["kind"], gap["number"], gap["time_ns"] = frame_log.Kind.LOST, lost, first_ns
            records = np.concatenate([gap, records])
        self._file.write(records)
        self.report.records_lost += lost
        self._begin_ns = first_ns if self._begin_ns is None else self._begin_ns
        self._full = last_ns - self._begin_ns >= 1e9 * self._task.part_s

    def _write_rows(self) -> None:
        rows = self._rows.read_rows()
        if len(rows):
            self._file.append(frame_log.ROWS, _packed(rows))
            self.report.rows += len(rows)
        self.report.lost = self._rows.lost

    def _write_events(self) -> None:
        assert self._events is not None
        if found := self._events.read():
            self._file.append(frame_log.EVENTS, b"[" + b",".join(found) + b"]")


def _packed(rows: FloatArray) -> bytes:
    """Return rows by column, and these by the bytes of their numbers, which compress better."""
    by_byte = np.ascontiguousarray(rows.T).view(np.uint8).reshape(-1, 8).T
    return _COUNT.pack(len(rows)) + np.ascontiguousarray(by_byte).tobytes()


def _unpacked(content: bytes, width: int) -> FloatArray:
    (count,) = _COUNT.unpack_from(content)
    planes = np.frombuffer(content, dtype=np.uint8, offset=_COUNT.size)
    if len(planes) != 8 * count * width:
        raise ValueError(f"{len(planes)} bytes are not {count} rows of {width} numbers")
    values: FloatArray = np.ascontiguousarray(planes.reshape(8, -1).T).view("<f8")
    return values.reshape(width, count).T


@dataclass(frozen=True, slots=True, eq=False)
class RunLog:
    """Telemetry of one part of a run."""

    about: dict[str, Any]  #: Origin (`utank_hil.base.provenance`).
    columns: tuple[str, ...]
    rows: FloatArray  #: shape (n, width): in SI units.
    events: list[Event]  #: Of retuning and alarms; their `time_ns` is on the clock of `time_s`.

    @property
    def signals(self) -> dict[str, FloatArray]:
        """Columns by name, shape (n,)."""
        return dict(zip(self.columns, self.rows.T, strict=True))


def read_run_log(path: Path, note: Callable[[str], None] | None = None) -> RunLog:
    """Read the telemetry of a part of a run's log; `note` is called with where it is cut.

    Raises `FrameLogError` if the file is no frame log, or holds no telemetry.
    """
    log = frame_log.FrameLog(path)
    try:
        about, columns = dict(log.head["about"]), tuple(map(str, log.head.get("columns", ())))
        blocks, events = [], []
        for kind, content in log.others():
            if kind == frame_log.ROWS:
                blocks.append(_unpacked(content, len(columns)))
            else:
                events += [event_of(each) for each in json.loads(content)]
    except (LookupError, TypeError, ValueError, RecursionError, struct.error) as error:
        raise frame_log.FrameLogError(f"{path}: its telemetry is damaged: {error}") from error
    if not blocks:
        raise frame_log.FrameLogError(
            f"{path}: holds no telemetry: name a log that utank-hil run wrote"
        )
    if log.cut and note is not None:
        note(f"{log.cut}; what follows in it is left out")
    return RunLog(about, columns, np.concatenate(blocks), events)
