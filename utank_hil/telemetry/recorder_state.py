"""The recorder's task, its report, and its state between files."""

import json
import os
import sys
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field, replace
from typing import Any

import msgspec

from utank_hil.telemetry.ring import RingKind, held_ring


@dataclass(frozen=True, slots=True)
class RecordingTask:
    """Sources and destination of a recording."""

    rows: str  #: Name of the ring of rows.
    file: str  #: The first `.rrd` file; the frame log stands beside it.
    #: events, frames: names of the rings of events and of `bus_records`.
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
