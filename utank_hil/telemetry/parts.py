"""A recording as files of limited length, within a bound of the disk."""

import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Final

import rerun as rr

from utank_hil.arrays import FloatArray
from utank_hil.closing import Closing
from utank_hil.telemetry.blueprint import columns_of, make_blueprint
from utank_hil.telemetry.event_ring import Event
from utank_hil.telemetry.rerun_log import (
    APPLICATION,
    LIVE_RUN,
    PICTURES_S,
    RunLog,
    run_paths,
    time_index,
    write_about,
)
from utank_hil.telemetry.rotation import Rotation, bytes_of, part_of, remove_oldest
from utank_hil.telemetry.scene import scene_size

_FLUSH_TIMEOUT_S: Final = 5.0
_GROWTH: Final = 1.05
_RESERVED_BYTES: Final = 1 << 18  # for the beginning of a recording, mostly its blueprint
_FOOTER: Final = (b"FOOT", 64)  # mark within the last bytes of a finished file


class RecordingParts(Closing):
    """Writes a recording into one file after another; each is complete.

    Parameters
    ----------
    file : Path
        The first `.rrd` file; overwritten. The next are ``<its stem>-part002.rrd`` and so on.
    columns : sequence of str
        Names of a row's values.
    rotation : Rotation, optional
        Without it there is one file.
    about : mapping, optional
        Where it comes from (`utank_hil.provenance`).

    Attributes
    ----------
    count : int
        Files begun.

    Raises
    ------
    OSError
        If a file can't be created, or there is no room for the beginning of one.
    RuntimeError
        If a file can't be finished.
    """

    def __init__(
        self,
        file: Path,
        columns: Sequence[str],
        rotation: Rotation | None = None,
        about: Mapping[str, Any] | None = None,
    ) -> None:
        self._first = file
        self._columns = columns
        self._rotation = rotation
        self._about = about
        self._time = time_index(columns)
        self.count = 0
        self._begin_s: float | None = None
        self._file = file
        self._recording: rr.RecordingStream | None = None
        self._begin(0)

    def write(self, rows: FloatArray) -> None:
        """Append rows, shape (n, width), n above zero; begins the next file where it is time."""
        begin_s = float(rows[0, self._time])
        if self._begin_s is None:
            self._begin_s = begin_s
        if self._rotation is not None and begin_s - self._begin_s >= self._rotation.part_s:
            self._end()
            self._begin(bytes_of(self._file))
            self._begin_s = begin_s
        self._rows += len(rows)
        self._log.write(rows)

    def write_events(self, events: Sequence[Event]) -> None:
        """Log events of retuning and alarms."""
        self._log.write_events(events)

    def note(self, text: str) -> None:
        """Log a warning about the recording itself."""
        self._log.note(text)

    def flush(self) -> None:
        """Bring it to the disk, so that a kill does not lose it."""
        if self._recording is not None:
            # without a timeout it would wait forever on a full disk
            self._recording.flush(timeout_sec=_FLUSH_TIMEOUT_S)

    def close(self) -> None:
        """Finish the last file; idempotent."""
        if self._recording is not None:
            self._end()

    def _begin(self, expected_bytes: int) -> None:
        """Begin the next file, which may grow as large as expected."""
        self.count += 1
        self._file = part_of(self._first, self.count)
        if self._rotation is not None and self._rotation.keep_bytes is not None:
            room_bytes = round(_GROWTH * expected_bytes)  # compression differs from file to file
            remove_oldest(self._file, self._rotation.keep_bytes - room_bytes)
        _reserve_file(self._file)
        self._rows = 0
        self._recording = recording = rr.RecordingStream(APPLICATION, recording_id=self._file.stem)
        size = scene_size(self._columns, self._about)
        recording.set_sinks(
            rr.FileSink(self._file),
            default_blueprint=make_blueprint(
                columns_of(self._columns, self._about), [LIVE_RUN], size=size
            ),
        )
        if self._about is not None:
            write_about(recording, self._about)
        path = run_paths([LIVE_RUN])[0]
        self._log = RunLog(recording, path, self._columns, self._about, PICTURES_S)

    def _end(self) -> None:
        """Finish a file."""
        recording, self._recording = self._recording, None
        assert recording is not None
        self._log.close()
        recording.flush(timeout_sec=_FLUSH_TIMEOUT_S)
        recording.disconnect()  # writes the footer; reports no error
        if not _is_finished(self._file):
            raise RuntimeError(
                f"its {self._rows} rows are written, but not the end of {self._file.name}: is the "
                "disk full?"
            )


def _reserve_file(file: Path) -> None:
    """Reserve the first bytes, or raise: Rerun would wait forever on a full disk."""
    with file.open("wb") as begun:
        os.posix_fallocate(begun.fileno(), 0, _RESERVED_BYTES)


def _is_finished(file: Path) -> bool:
    """Return whether a recording has its footer; a truncated one has none."""
    mark, length = _FOOTER
    with file.open("rb") as content:
        content.seek(0, os.SEEK_END)
        content.seek(max(0, content.tell() - length))
        return mark in content.read()
