"""The recording of a run: if it fails, the controller runs on, and the failure is printed."""

from collections.abc import Mapping
from dataclasses import asdict, dataclass, replace
from importlib.util import find_spec
from pathlib import Path
from typing import Any, Final

from utank_hil.base.arrays import FloatArray
from utank_hil.base.whole_file import claimed_files
from utank_hil.console.common import why_not_writable
from utank_hil.nodes.signals import SIGNALS
from utank_hil.telemetry.frame_log import SUFFIX, frame_ring
from utank_hil.telemetry.recorder_process import (
    NEEDS_RERUN,
    RecorderError,
    RecorderProcess,
    RecordingTask,
)
from utank_hil.telemetry.ring import RingWriter, RowWriter

NAME: Final = "run-{}.rrd"
FRAMES: Final = f"run-{{}}{SUFFIX}"
PART_S: Final = 3600.0  #: Length of one file of a recording.
RING_SLOTS: Final = 1640  #: Slots per ring: 82 s at 20 Hz, a delay of the recorder without loss.


@dataclass(slots=True)
class RecordingSummary:
    """Result of a recording."""

    file: str | None = None  #: The recording; None if there is none.
    frames: str | None = None  #: The frame log, which `utank-hil replay` reads.
    #: rows, lost, records_lost: rows recorded, and rows and records of the frame log that were lost
    #: because the recorder was too slow; None if it failed.
    rows: int | None = None
    lost: int | None = None
    records_lost: int | None = None
    parts: int | None = None  #: Number of files, of which `file` is the first; None if it failed.
    error: str | None = None  #: Why it did not start, or ended before the run.


class RunRecording:
    """Ring and recorder of a run; the constructor returns when the recorder is ready, or failed.

    The files are named by the time of `log`, the log of the run's events; without a folder there is
    a ring, for viewers, and no recorder. `events` is the name of the ring of events, recorded
    beside the rows; `about` the origin of the rows (`utank_hil.base.provenance`); `head` that of
    the frame log (`replay_head`), without which there is none. Beyond `keep_bytes` the folder's
    oldest recordings are removed.
    """

    def __init__(
        self,
        folder: Path | None,
        events: str | None = None,
        about: Mapping[str, Any] | None = None,
        head: Mapping[str, Any] | None = None,
        keep_bytes: int | None = None,
        log: Path | None = None,
    ) -> None:
        self.summary = RecordingSummary()  #: Result, complete after `stop`.
        self._ring: RingWriter | None = None
        self._records: RingWriter | None = None
        self._recorder: RecorderProcess | None = None
        try:
            self._ring = RowWriter(SIGNALS, RING_SLOTS, about=about)
            if folder is None:
                return
            if (reason := why_not_writable(folder)) is not None:
                raise OSError(reason)
            stamp = None if log is None else log.stem.partition("-")[2]
            files = claimed_files(folder, NAME, *([] if head is None else [FRAMES]), stamp=stamp)
        except OSError as error:
            self.summary.error = str(error)
            return
        try:
            if head is not None:
                self._records = frame_ring(RING_SLOTS)
            task = RecordingTask(
                self._ring.name,
                str(files[0]),
                events=events,
                frames=None if self._records is None else self._records.name,
                head=head or {},
                part_s=PART_S,
                keep_bytes=keep_bytes,
            )
            self._recorder = RecorderProcess(task)
        except (OSError, RecorderError) as error:
            self.summary.error = str(error)
            self._close_records()
        for file in files:
            if file.exists() and file.stat().st_size == 0:
                file.unlink()  # The file is empty.
        if head is not None and find_spec("rerun") is None:
            self.summary.error = f"{NEEDS_RERUN}; there is the frame log alone"
        names = [str(file) if file.exists() else None for file in files]
        self.summary.file, self.summary.frames = (*names, None)[:2]

    def write(self, row: FloatArray) -> None:
        """Take one row of telemetry; never waits."""
        if self._ring is not None:
            self._ring.write(row)

    @property
    def keeps_records(self) -> bool:
        """Whether a frame log is being written."""
        return self._records is not None

    def write_records(self, records: bytes, time_ns: int) -> None:  # noqa: ARG002
        """Take records of ticks (`frame_log`); never waits."""
        if self._records is not None:
            self._records.write(records)

    def failure(self) -> str:
        """Return once the reason why the recorder ended before the run; never waits."""
        if self._recorder is None or not self._recorder.has_ended:
            return ""
        self._end_recorder()
        self.summary.error = self.summary.error or "the recorder ended before the run"
        return self.summary.error

    def stop(self) -> None:
        """Complete the summary; idempotent."""
        self._close_records()  # This comes first, because the end of the other ends the recorder.
        ring, self._ring = self._ring, None
        if ring is not None:
            ring.close()
        self._end_recorder()

    def _end_recorder(self) -> None:
        recorder, self._recorder = self._recorder, None
        if recorder is not None:
            try:
                self.summary = replace(self.summary, **asdict(recorder.stop()))
            except RecorderError as error:
                self.summary.error = str(error)

    def _close_records(self) -> None:
        records, self._records = self._records, None
        if records is not None:
            records.close()
