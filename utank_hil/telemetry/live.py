"""Runs on this machine, found by their rings in shared memory and streamed to viewers."""

import os
from collections import Counter
from collections.abc import Mapping, Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final, TypeAlias

import rerun as rr

from utank_hil.base.arrays import FloatArray
from utank_hil.base.closing import Closing
from utank_hil.nodes.signals import SIGNALS
from utank_hil.telemetry import rerun_log
from utank_hil.telemetry.blueprint import columns_of, make_blueprint
from utank_hil.telemetry.events import Event, EventReader
from utank_hil.telemetry.ring import RingKind, RingReader, RowReader, ring_names
from utank_hil.telemetry.scene import scene_size
from utank_hil.telemetry.viewer import LOOPBACK, hold_port, live_url, port_of

Sink: TypeAlias = rr.FileSink | rr.GrpcServerSink
_FLUSH_TIMEOUT_S: Final = 5.0  #: Time to reach the disk; without it Rerun waits on a full one.
_RESERVED_BYTES: Final = 1 << 18  #: Space for the beginning of a recording, mostly its blueprint.
_FOOTER: Final = b"FOOT"  #: Mark within the last `_FOOTER_BYTES` of a finished file.
_FOOTER_BYTES: Final = 64


def open_stream(
    name: str,
    sink: Sink,
    columns: Sequence[str],
    about: Mapping[str, Any] | None,
    batch_s: float = 0.0,
) -> tuple[rr.RecordingStream, rerun_log.RunLog]:
    """Open a stream of one run, with its layout and origin, to a file or to viewers; its log."""
    stream = rr.RecordingStream(rerun_log.APPLICATION, recording_id=name)
    size = scene_size(columns, about)
    layout = make_blueprint(columns_of(columns, about), [rerun_log.LIVE_RUN], size=size)
    stream.set_sinks(sink, default_blueprint=layout)
    if about:
        rerun_log.write_about(stream, about)
    (path,) = rerun_log.run_paths([rerun_log.LIVE_RUN])
    return stream, rerun_log.RunLog(stream, path, columns, about, batch_s)


class RecordingPart(Closing):
    """Writes one file of a recording, complete in itself, over `file`, a `.rrd`.

    `about` is the origin of the rows (`utank_hil.base.provenance`). Raises `OSError` if the file
    can't be created, or has no room for its beginning, and `RuntimeError` if it can't be finished.
    """

    def __init__(
        self, file: Path, columns: Sequence[str], about: Mapping[str, Any] | None = None
    ) -> None:
        with file.open("wb") as begun:  # Rerun would wait forever on a full disk.
            os.posix_fallocate(begun.fileno(), 0, _RESERVED_BYTES)
        self._file = file
        self._rows = 0
        self._lost = Counter[str]()
        self._open = True
        self._recording, self._log = open_stream(
            file.stem, rr.FileSink(file), columns, about, rerun_log.PICTURES_S
        )

    def write(self, rows: FloatArray, events: Sequence[Event] = ()) -> None:
        """Append rows, shape (n, width), and events of retuning and alarms, and flush them."""
        if len(rows):
            self._rows += len(rows)
            self._log.write(rows)
        self._log.write_events(events)
        if len(rows) or events:
            self.flush()

    def note_lost(self, what: str, lost: int) -> None:
        """Log a warning if the total number lost of a kind has grown since the last call."""
        if more := lost - self._lost[what]:
            self._log.note(f"{more} {what} lost: the recorder was too slow")
            self._lost[what] = lost

    def flush(self) -> None:
        """Bring the rows to the disk, so that neither a kill nor a power cut loses them."""
        # Without a timeout it would wait forever on a full disk.
        self._recording.flush(timeout_sec=_FLUSH_TIMEOUT_S)
        with self._file.open("rb") as written:
            os.fsync(written.fileno())

    def close(self) -> None:
        """Finish the file; idempotent."""
        if not self._open:
            return
        self._open = False
        self._log.close()
        self.flush()
        self._recording.disconnect()  # This writes the footer and reports no error.
        with self._file.open("rb") as content:
            content.seek(-_FOOTER_BYTES, os.SEEK_END)
            finished = _FOOTER in content.read()
        if not finished:
            raise RuntimeError(
                f"its {self._rows} rows are written, but not the end of {self._file.name}: is the "
                "disk full?"
            )


MEMORY: Final = "64MiB"  #: History for late viewers, which bounds the memory of the stream.
_START_S: Final = 5.0  #: Time in which the server of a stream starts, even on a busy machine.


@dataclass(frozen=True, slots=True)
class LiveRun:
    """A run whose writer lives."""

    ring: str  #: Name of its telemetry ring.
    events: str | None  #: Name of its ring of events.
    pid: int  #: Id of its process.
    about: Mapping[str, Any]  #: Origin of its rows (`utank_hil.base.provenance`); empty if unknown.

    def __str__(self) -> str:
        name = self.about.get("configuration", {}).get("name", self.ring)
        return f"{self.pid}: {self.about.get('command', 'process')}, {name}"


def live_runs() -> list[LiveRun]:
    """Return the runs of this machine that this user may read, without those of killed writers."""
    found: list[tuple[str, int, Mapping[str, Any]]] = []
    events: dict[int, str] = {}
    for name in ring_names():
        try:
            with RingReader(name) as ring:
                if ring.ended:
                    continue
                if ring.kind is RingKind.EVENTS:
                    events[ring.writer_pid] = name
            with RowReader(name) as rows:
                if rows.columns == SIGNALS:
                    found.append((name, rows.writer_pid, rows.about or {}))
        except OSError:  # It has ended, is of another version or kind, or belongs to another user.
            continue
    return [LiveRun(ring, events.get(pid), pid, about) for ring, pid, about in found]


class LiveStream(Closing):
    """Streams a run to viewers at `url`, on loopback, also to those that connect late.

    OSError is raised if the run has ended meanwhile, or another program took the port.
    """

    def __init__(self, run: LiveRun) -> None:
        with ExitStack() as stack:
            self._ring = stack.enter_context(RowReader(run.ring))
            self._events = None if run.events is None else EventReader(run.events)
            if self._events is not None:
                stack.enter_context(self._events)
            port = port_of(stack.enter_context(hold_port()))
            self.url = live_url(port)
            sink = rr.GrpcServerSink(LOOPBACK, port, server_memory_limit=MEMORY)
            stream, self._log = open_stream(run.ring, sink, self._ring.columns, run.about)
            stack.callback(stream.disconnect)
            try:
                stream.flush(timeout_sec=_START_S)
            except RuntimeError as error:  # Otherwise viewers would show the other program.
                again = "start it again: it takes another"
                raise OSError(f"port {port} of this machine was taken; {again}") from error
            self._stack = stack.pop_all()

    def send(self) -> bool:
        """Send new rows and events; return whether more may come."""
        ended = self._ring.ended
        rows = self._ring.read_rows()
        if len(rows):
            self._log.write(rows)
        if self._events is not None:
            self._log.write_events(self._events.read_events())
        return not ended

    def close(self) -> None:
        """End the stream; idempotent."""
        self._stack.close()
