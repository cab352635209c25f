"""Stream of a running recording into one of its files, or to viewers."""

import os
from collections import Counter
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Final, TypeAlias

import rerun as rr

from utank_hil.base.arrays import FloatArray
from utank_hil.base.closing import Closing
from utank_hil.telemetry import rerun_log
from utank_hil.telemetry.blueprint import columns_of, make_blueprint
from utank_hil.telemetry.events import Event
from utank_hil.telemetry.scene import scene_size

Sink: TypeAlias = rr.FileSink | rr.GrpcServerSink
_FLUSH_TIMEOUT_S: Final = 5.0  #: Time to reach the disk; without it Rerun waits on a full one.
_RESERVED_BYTES: Final = 1 << 18  #: Space for the beginning of a recording, mostly its blueprint.
_FOOTER: Final = (b"FOOT", 64)  #: Mark within the last bytes of a finished file.


def open_stream(
    name: str, sink: Sink, columns: Sequence[str], about: Mapping[str, Any] | None
) -> rr.RecordingStream:
    """Open a stream of one run, with its layout, to a file or to viewers."""
    stream = rr.RecordingStream(rerun_log.APPLICATION, recording_id=name)
    size = scene_size(columns, about)
    layout = make_blueprint(columns_of(columns, about), [rerun_log.LIVE_RUN], size=size)
    stream.set_sinks(sink, default_blueprint=layout)
    return stream


def live_log(
    stream: rr.RecordingStream,
    columns: Sequence[str],
    about: Mapping[str, Any] | None,
    batch_s: float = 0.0,
) -> rerun_log.RunLog:
    """Write the run's origin to its stream and return its log."""
    if about:
        rerun_log.write_about(stream, about)
    return rerun_log.RunLog(
        stream, rerun_log.run_paths([rerun_log.LIVE_RUN])[0], columns, about, batch_s
    )


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
        self._recording = open_stream(file.stem, rr.FileSink(file), columns, about)
        self._log = live_log(self._recording, columns, about, rerun_log.PICTURES_S)

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
        if not _is_finished(self._file):
            raise RuntimeError(
                f"its {self._rows} rows are written, but not the end of {self._file.name}: is the "
                "disk full?"
            )


def _is_finished(file: Path) -> bool:
    mark, length = _FOOTER
    with file.open("rb") as content:
        content.seek(0, os.SEEK_END)
        content.seek(max(0, content.tell() - length))
        return mark in content.read()
