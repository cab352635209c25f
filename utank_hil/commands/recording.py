"""The recording of a run: if it fails, the controller runs on, and the failure is printed."""

import json
import time
from collections.abc import Mapping
from contextlib import ExitStack, suppress
from dataclasses import asdict, dataclass, replace
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any, Final

from utank_hil.base.arrays import FloatArray
from utank_hil.base.whole_file import claimed_files
from utank_hil.commands.lines import Lines
from utank_hil.console.common import why_not_writable
from utank_hil.console.terminal import notes
from utank_hil.nodes.signals import SIGNALS
from utank_hil.runners.beside import Beside, ready
from utank_hil.telemetry.frame_log import SUFFIX, frame_ring
from utank_hil.telemetry.ring import RingWriter, RowWriter
from utank_hil.telemetry.run_log import RunLogTask, RunLogWriter

NAME: Final = f"run-{{}}{SUFFIX}"
PART_S: Final = 3600.0  #: Length of one file of a recording.
RING_SLOTS: Final = 1640  #: Slots per ring: 82 s at 20 Hz, a delay of the recorder without loss.
BATCH_S: Final = 0.5  #: Time between two writes, which a kill loses twice at most.
_PRINTED_S: Final = 5.0  #: Time to print the last line on a busy machine.


def record(task: RunLogTask, told: Connection) -> None:
    """Write the log of a run until its writer ends or dies; the recorder's process.

    After a failure, such as a full disk, it is tried again: the rings hold what comes in 82 s.
    """
    with ExitStack() as stack:
        lines = Lines()
        stack.callback(lines.close, _PRINTED_S)
        try:
            log = stack.enter_context(RunLogWriter(task))
        except OSError as error:
            told.send_bytes(str(error).encode())
            return
        ready(told)
        failure, last = "", False
        while not last:
            last = log.ended
            try:
                log.write()
                failure = ""
            except OSError as error:
                if not failure:
                    lines.say(f"recording failed: {error}; it is tried again")
                failure = str(error)
            if not last:
                time.sleep(BATCH_S)
        with suppress(BrokenPipeError):  # A run that was killed hears nothing.
            told.send_bytes(json.dumps(asdict(log.report) | {"error": failure or None}).encode())


@dataclass(slots=True)
class RecordingSummary:
    """Result of a recording."""

    file: str | None = None  #: The log of the run, its first part; None if there is none.
    #: rows, lost, records_lost: rows recorded, and rows and records of frames that were lost
    #: because the recorder was too slow; None if it failed.
    rows: int | None = None
    lost: int | None = None
    records_lost: int | None = None
    parts: int | None = None  #: Number of files, of which `file` is the first; None if it failed.
    error: str | None = None  #: Why it did not start, or ended before the run.


class RunRecording:
    """Rings and recorder of a run; the constructor returns when the recorder is ready, or failed.

    The log is named by the time of `log`, the log of the run's events; without a folder there is a
    ring of rows, for viewers, and no recorder. `events` is the name of the ring of events, recorded
    beside the rows; `about` the origin of the rows (`utank_hil.base.provenance`); `head` that of
    the log (`replay_head`). Beyond `keep_bytes` the folder's oldest recordings are removed.
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
        self._recorder: Beside | None = None
        file = None
        try:
            self._ring = RowWriter(SIGNALS, RING_SLOTS, about=about)
            if folder is None:
                return
            if (reason := why_not_writable(folder)) is not None:
                raise OSError(reason)
            stamp = None if log is None else log.stem.partition("-")[2]
            (file,) = claimed_files(folder, NAME, stamp=stamp)
            self._records = frame_ring(RING_SLOTS)
            rings = self._ring.name, self._records.name, events
            task = RunLogTask(*rings, file, head or {"about": about or {}}, PART_S, keep_bytes)
            self._recorder = Beside("the recorder", record, task)
            self.summary.file = str(file)
        except OSError as error:
            self.summary.error = str(error)
            self._close_records()
            if file is not None and file.exists() and file.stat().st_size == 0:
                file.unlink()

    def write(self, row: FloatArray) -> None:
        """Take one row of telemetry; never waits."""
        if self._ring is not None:
            self._ring.write(row)

    @property
    def keeps_records(self) -> bool:
        """Whether a log is being written."""
        return self._records is not None

    def write_records(self, records: bytes, time_ns: int) -> None:  # noqa: ARG002
        """Take records of ticks (`frame_log`); never waits."""
        if self._records is not None:
            self._records.write(records)

    def failure(self) -> str:
        """Return once the reason why the recorder ended before the run; never waits."""
        failure = "" if self._recorder is None else self._recorder.failure()
        self.summary.error = failure or self.summary.error
        return failure

    def stop(self) -> None:
        """Complete the summary; idempotent."""
        self._close_records()  # This comes first, because the end of the rows ends the recorder.
        ring, self._ring = self._ring, None
        if ring is not None:
            ring.close()
        recorder, self._recorder = self._recorder, None
        if recorder is not None:
            self.summary = replace(self.summary, **recorder.stop(notes.say))
            self.summary.error = recorder.error or self.summary.error

    def _close_records(self) -> None:
        records, self._records = self._records, None
        if records is not None:
            records.close()
