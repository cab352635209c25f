"""The recorder's process, started before the loop and polled without waiting, and its state."""

import json
import os
import select
import subprocess
import sys
import time
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import asdict, dataclass, field, replace
from importlib.util import find_spec
from typing import Any, Final

import msgspec

from utank_hil.base.closing import Closing
from utank_hil.telemetry.ring import RingKind, held_ring


@dataclass(frozen=True, slots=True)
class RecordingTask:
    """Sources and destination of a recording."""

    rows: str  #: Name of the ring of rows.
    file: str  #: The first `.rrd` file; the frame log stands beside it.
    #: events, frames: names of the rings of events and of records (`frame_log`).
    events: str | None = None
    frames: str | None = None
    head: Mapping[str, Any] = field(default_factory=dict)  #: Head of the frame log (`replay_head`).
    part_s: float | None = None  #: Length of a file of several; None for a single one.
    keep_bytes: int | None = None  #: Size of the folder (`rotation.make_room`); None for no limit.

    def held(self) -> "RecordingTask":
        """Return the task with ring names that stay valid after `exec` in this process."""
        held = (None if ring is None else held_ring(ring) for ring in (self.events, self.frames))
        events, frames = held
        return replace(self, rows=held_ring(self.rows), events=events, frames=frames)


@dataclass(slots=True)
class RecorderReport:
    """Result of a recording."""

    #: rows, lost: rows recorded, and rows that the ring overwrote before they were read.
    rows: int = 0
    lost: int = 0
    parts: int = 0  #: Number of Rerun files, or of frame logs if there are none.
    #: Records of the frame log that its ring overwrote before they were read.
    records_lost: int = 0


@dataclass(slots=True)
class RecorderState:
    """State that the recorder passes from one file, and one program, to the next."""

    task: RecordingTask
    #: Numbers of what has reached the files.
    report: RecorderReport = field(default_factory=RecorderReport)
    #: End of that in each ring (`RingReader.place`); a missing ring is read from its oldest slot.
    places: dict[RingKind, int] = field(default_factory=dict)
    failure: str = ""  #: Reason why the last file failed; empty if it did not.
    complained: bool = True  #: Whether the failure was reported.

    def as_input(self) -> int:
        """Return the descriptor of a file in memory from which `of_input` reads the state."""
        descriptor = os.memfd_create(f"recorder-part{self.report.parts + 1}")
        with open(descriptor, "w", encoding="utf-8", closefd=False) as written:
            json.dump(asdict(self), written)
        os.lseek(descriptor, 0, os.SEEK_SET)
        return descriptor

    @classmethod
    def of_input(cls) -> "RecorderState":
        """Read the state from standard input."""
        return msgspec.convert(json.load(sys.stdin), cls)


NEEDS_RERUN: Final = "it needs rerun-sdk: pip install 'utank-hil[viewer]'"
_MODULE: Final = "utank_hil.telemetry.recorder"
_START_TIMEOUT_S: Final = 30.0
_STOP_TIMEOUT_S: Final = 30.0
"""Times for Rerun to load, and for the last rows to reach the disk, on a busy machine."""
_READ_BYTES: Final = 1 << 16  #: Capacity of a pipe.


class RecorderError(RuntimeError):
    """The recorder process did not start, or failed."""


class RecorderProcess(Closing):
    """A recorder in a separate process; ready when the constructor returns, after about a second.

    Its session is separate, so that Ctrl-C in the terminal does not end it before the loop's last
    rows. RecorderError is raised, with the reason, if it does not start.
    """

    def __init__(self, task: RecordingTask) -> None:
        if find_spec("rerun") is None and task.frames is None:
            raise RecorderError(NEEDS_RERUN)
        self._end: RecorderReport | RecorderError | None = None
        state = RecorderState(task).as_input()
        command = [sys.executable, "-m", _MODULE]
        try:
            self._process = subprocess.Popen(
                command, stdin=state, stdout=subprocess.PIPE, start_new_session=True
            )
        finally:
            os.close(state)
        self.pid = self._process.pid
        output = self._process.stdout
        assert output is not None
        self._output = output
        self._said = b""
        os.set_blocking(output.fileno(), False)
        deadline_s = time.monotonic() + _START_TIMEOUT_S
        open_, waits = True, True
        while open_ and waits and not self._message("ready", "error"):
            left_s = max(0.0, deadline_s - time.monotonic())
            waits = bool(select.select([output], [], [], left_s)[0])
            open_ = self._listen()
        if not self._message("ready"):
            self._kill()
            ended = f"silent for {_START_TIMEOUT_S:g} s" if not waits else "it ended"
            reason = self._message("error").get("error", ended)
            raise RecorderError(f"the recorder of {task.file} did not start: {reason}")

    @property
    def has_ended(self) -> bool:
        """Whether the process has ended."""
        return self._process.poll() is not None

    def stop(self) -> RecorderReport:
        """Write the last rows and wait for the end; RecorderError if it failed; idempotent."""
        if self._end is None:
            self._end = self._ended()
        if isinstance(self._end, RecorderError):
            raise self._end
        return self._end

    def close(self) -> None:
        """Stop the recorder (`stop`)."""
        self.stop()

    def _ended(self) -> RecorderReport | RecorderError:
        self._process.terminate()
        try:
            code = self._process.wait(_STOP_TIMEOUT_S)
        except subprocess.TimeoutExpired:
            self._kill()
            return RecorderError("the recorder did not end and was killed")
        with self._output:
            self._listen()
        if code != 0:
            reason = self._message("error").get("error", f"exit code {code}")
            return RecorderError(f"the recorder failed: {reason}")
        with suppress(msgspec.ValidationError):
            if report := self._message("rows"):
                return msgspec.convert(report, RecorderReport)
        return RecorderError("the recorder ended and did not say how it went")

    def _listen(self) -> bool:
        """Read new messages without waiting; return whether more may come."""
        try:
            heard = os.read(self._output.fileno(), _READ_BYTES)
        except BlockingIOError:  # The pipe is open, by the process or by a child of it.
            return True
        self._said += heard
        return bool(heard)

    def _message(self, *keys: str) -> dict[str, Any]:
        """Return the last message with one of these keys, or {}; other output is ignored."""
        for line in reversed(self._said.split(b"\n")):
            try:
                message = json.loads(line)
            except (ValueError, RecursionError):
                continue
            if isinstance(message, dict) and not message.keys().isdisjoint(keys):
                return message
        return {}

    def _kill(self) -> None:
        self._process.kill()
        self._process.wait()
        self._output.close()
