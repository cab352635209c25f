"""The recorder's task, its report, and its state between files."""

import json
import os
import sys
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field, replace
from typing import Any

from utank_hil.telemetry.ring import RingKind, held_ring
from utank_hil.telemetry.rotation import Rotation


@dataclass(frozen=True, slots=True)
class RecordingTask:
    """Sources and destination of a recording.

    Attributes
    ----------
    rows : str
        Name of the ring of rows.
    file : str
        The first `.rrd` file; the frame log stands beside it.
    events, frames : str or None
        Names of the rings of events and of `bus_records`.
    head : mapping
        Head of the frame log (`replay_head`).
    rotation : Rotation or None
        Division into several files; None for a single one.
    """

    rows: str
    file: str
    events: str | None = None
    frames: str | None = None
    head: Mapping[str, Any] = field(default_factory=dict)
    rotation: Rotation | None = None

    def held(self) -> "RecordingTask":
        """Return the task with ring names that stay valid after `exec` in this process."""
        held = (None if ring is None else held_ring(ring) for ring in (self.events, self.frames))
        events, frames = held
        return replace(self, rows=held_ring(self.rows), events=events, frames=frames)


@dataclass(slots=True)
class RecorderReport:
    """Result of a recording.

    Attributes
    ----------
    rows, lost : int
        Rows recorded, and rows that the ring overwrote before they were read.
    parts : int
        Number of Rerun files, or of frame logs if there are none.
    records_lost : int
        Records of the frame log that its ring overwrote before they were read.
    """

    rows: int = 0
    lost: int = 0
    parts: int = 0
    records_lost: int = 0


@dataclass(slots=True)
class RecorderState:
    """State that the recorder passes from one file, and one program, to the next.

    Attributes
    ----------
    report : RecorderReport
        Numbers of what has reached the files.
    places : dict of RingKind to int
        End of that in each ring (`RingReader.place`); a missing ring is read from its oldest slot.
    failure : str
        Reason why the last file failed; empty if it did not.
    complained : bool
        Whether the failure was reported.
    """

    task: RecordingTask
    report: RecorderReport = field(default_factory=RecorderReport)
    places: dict[RingKind, int] = field(default_factory=dict)
    failure: str = ""
    complained: bool = True

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
        content = json.load(sys.stdin)
        task = content.pop("task")
        rotation = task.pop("rotation")
        task = RecordingTask(**task, rotation=None if rotation is None else Rotation(**rotation))
        report = RecorderReport(**content.pop("report"))
        places = {RingKind(kind): place for kind, place in content.pop("places").items()}
        return cls(task, report, places, **content)
