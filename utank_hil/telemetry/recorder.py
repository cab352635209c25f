"""The recorder: a process that writes rows and events to a Rerun file.

Beside it, it writes the frame log: what the controller was handed and what it answered. Where Rerun
is not installed, that is all it writes.

`RecorderProcess` starts it from a bench or from the deployed controller; `python -m
utank_hil.telemetry.recorder --ring NAME --file OUT.rrd` attaches one by hand. It ends when the ring
is closed, when the ring's writer dies, or on SIGINT, SIGTERM or SIGHUP, with all rows written. The
controller never waits for it: rows that it reads too late are overwritten and counted as lost.
"""

import argparse
import contextlib
import json
import os
import select
import signal
import subprocess
import sys
from collections.abc import Mapping
from contextlib import ExitStack
from dataclasses import asdict, dataclass, replace
from importlib.util import find_spec
from pathlib import Path
from typing import Any, Final

import numpy as np

from utank_hil.closing import Closing
from utank_hil.telemetry.bus_records import RECORD, Kind, records_of
from utank_hil.telemetry.event_ring import EventReader
from utank_hil.telemetry.frame_log import SUFFIX, FrameLogWriter
from utank_hil.telemetry.ring import RingReader
from utank_hil.telemetry.rotation import Rotation
from utank_hil.telemetry.viewer import rerun_environment

BATCH_S: Final = 0.5  # a batch costs 1 kB of file; a kill loses up to two
NEEDS_RERUN: Final = "it needs rerun-sdk: pip install 'utank-hil[viewer]'"
_START_TIMEOUT_S: Final = 30.0
_STOP_TIMEOUT_S: Final = 30.0
_NICENESS: Final = 5


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


def record_ring(
    ring: str,
    file: Path,
    events: str | None = None,
    rotation: Rotation | None = None,
    frames: str | None = None,
    head: Mapping[str, Any] | None = None,
) -> RecorderReport:
    """Record a ring until it ends or a signal stops it; main function of the process.

    Parameters
    ----------
    file : Path
        The `.rrd` file; overwritten.
    events : str, optional
        Name of the ring of events (`EventWriter`) that belongs to it.
    rotation : Rotation, optional
        Where it goes on in another file; without it there is one.
    frames : str, optional
        Name of the ring of `bus_records`; they go into a frame log beside the file.
    head : mapping, optional
        Head of the frame log (`replay_head`).

    Raises
    ------
    RingError
        If there is no such ring.
    OSError
        If the file can't be created, or there is no room for the beginning of a recording.
    RuntimeError
        If the file can't be finished.
    """
    stop = _stop_pipe()
    with ExitStack() as stack:
        reader = stack.enter_context(RingReader(ring))
        event_reader = None if events is None else stack.enter_context(EventReader(events))
        parts = None
        if find_spec("rerun") is not None:
            from utank_hil.telemetry.parts import RecordingParts

            parts = RecordingParts(file, reader.columns, rotation, reader.about)
        log = None
        if frames is not None:
            if rotation is not None and parts is not None:
                rotation = replace(rotation, keep_bytes=None)  # the recording makes the room
            log = stack.enter_context(FrameRecording(frames, file, head or {}, rotation))
        _print_json({"ready": 1})
        recorded = reported_rows = reported_events = 0
        while True:
            last = reader.ended or bool(select.select([stop], [], [], BATCH_S)[0])
            rows = reader.read()
            recorded += len(rows)
            new_events = [] if event_reader is None else event_reader.read()
            if log is not None:
                log.write()
            if parts is not None:
                if reader.lost > reported_rows:
                    parts.note(
                        f"{reader.lost - reported_rows} rows lost: the recorder was too slow"
                    )
                    reported_rows = reader.lost
                if len(rows):
                    parts.write(rows)
                parts.write_events(new_events)
                if event_reader is not None and event_reader.lost > reported_events:
                    lost = event_reader.lost - reported_events
                    parts.note(f"{lost} events lost: the recorder was too slow")
                    reported_events = event_reader.lost
                if len(rows) or new_events:
                    parts.flush()
            if last:
                break
        count = 0 if log is None else log.count
        if parts is not None:
            parts.close()
            count = parts.count
        return RecorderReport(recorded, reader.lost, count, 0 if log is None else log.lost)


class FrameRecording(Closing):
    """Writes a ring of `bus_records` into a frame log.

    Parameters
    ----------
    file : Path
        The recording beside which the log is written.

    Attributes
    ----------
    lost : int
        Rows that were overwritten before they were read.
    """

    def __init__(
        self, ring: str, file: Path, head: Mapping[str, Any], rotation: Rotation | None
    ) -> None:
        self._reader = RingReader(ring)
        self._writer = FrameLogWriter(file.with_suffix(SUFFIX), head, rotation)
        self.lost = 0

    @property
    def count(self) -> int:
        """Files begun."""
        return self._writer.count

    def write(self) -> None:
        """Write what has come since the last call."""
        rows = self._reader.read()
        records = records_of(rows)
        lost = self._reader.lost - self.lost
        if lost and len(records):
            self.lost += lost
            gap = np.zeros(1, dtype=RECORD)
            gap["kind"], gap["number"], gap["time_ns"] = Kind.LOST, lost, records["time_ns"][0]
            records = np.concatenate([gap, records])
        self._writer.write(records)

    def close(self) -> None:
        """Close ring and file; idempotent."""
        self._reader.close()
        self._writer.close()


class RecorderProcess(Closing):
    """A recorder in a process of its own; ready when the constructor returns.

    Start it before the loop: it takes about a second, mostly for importing Rerun. It runs in a
    session of its own, so that Ctrl-C in the terminal does not end it before the loop's last rows.
    Arguments are those of `record_ring`.

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
            command += ["--head"]
        if rotation is not None:
            command += ["--part-s", str(rotation.part_s)]
            if rotation.keep_bytes is not None:
                command += ["--keep-bytes", str(rotation.keep_bytes)]
        self._report: RecorderReport | None = None
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
                json.dump(head, content)  # where it has ended already, its reason follows
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

    def stop(self) -> RecorderReport:
        """Write the last rows and wait for the end of the process; idempotent.

        Raises
        ------
        RecorderError
            If the process failed, with the reason, or does not end.
        """
        if self._report is None:
            self._process.terminate()
            try:
                code = self._process.wait(_STOP_TIMEOUT_S)
            except subprocess.TimeoutExpired:
                self._kill()
                raise RecorderError("the recorder did not end and was killed") from None
            with self._output:
                reply = json.loads(self._output.readline() or "{}")
                if code != 0:
                    reason = reply.get("error", f"exit code {code}")
                    raise RecorderError(f"the recorder failed: {reason}")
                self._report = RecorderReport(**reply)
        return self._report

    def close(self) -> None:
        """Same as `stop`."""
        self.stop()

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
    parser.add_argument("--head", action="store_true", help="JSON of it is on standard input")
    parser.add_argument("--part-s", type=float, help="begin another file after so long")
    parser.add_argument("--keep-bytes", type=int, help="remove the oldest files beyond so much")
    arguments = parser.parse_args()
    head = json.load(sys.stdin) if arguments.head else None
    os.environ.update(rerun_environment())
    os.nice(_NICENESS)
    try:
        report = record_ring(
            arguments.ring,
            arguments.file,
            arguments.events,
            None if arguments.part_s is None else Rotation(arguments.part_s, arguments.keep_bytes),
            arguments.frames,
            head,
        )
        _print_json(asdict(report))
    except (OSError, RuntimeError) as error:
        print(f"recording {arguments.file} failed: {error}", file=sys.stderr, flush=True)
        _print_json({"error": str(error)})
        os._exit(1)  # Rerun's exit hook would wait forever for a dead writer


def _stop_pipe() -> int:
    """Return a descriptor that becomes readable when SIGINT, SIGTERM or SIGHUP arrives."""
    readable, written = os.pipe()
    os.set_blocking(written, False)
    signal.set_wakeup_fd(written)
    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
        signal.signal(number, lambda _number, _frame: None)  # the wake-up descriptor does the work
    return readable


def _print_json(message: Mapping[str, int | str]) -> None:
    """Send a message to the parent: one JSON object a line on standard output."""
    print(json.dumps(message), flush=True)


if __name__ == "__main__":
    _main()
