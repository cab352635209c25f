"""The recorder's task, its report, and the state that it keeps from file to file."""

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
    """What is recorded, and where.

    Attributes
    ----------
    rows : str
        Name of the ring of rows.
    file : str
        The first `.rrd` file; the frame log stands beside it.
    events, frames : str or None
        Names of the rings of events and of `bus_records` that belong to it.
    head : mapping
        Head of the frame log (`replay_head`).
    rotation : Rotation or None
        Where it goes on in another file; without it there is one.
    """

    rows: str
    file: str
    events: str | None = None
    frames: str | None = None
    head: Mapping[str, Any] = field(default_factory=dict)
    rotation: Rotation | None = None

    def held(self) -> "RecordingTask":
        """The same by names of the rings that hold for the programs that this process becomes."""
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
        Files; of the frame log, where there is no other.
    records_lost : int
        Records of the frame log that its ring overwrote before they were read.
    """

    rows: int = 0
    lost: int = 0
    parts: int = 0
    records_lost: int = 0


@dataclass(slots=True)
class RecorderState:
    """All that the recorder takes from one file, and one program, to the next.

    Attributes
    ----------
    report : RecorderReport
        What has reached the files.
    places : dict of RingKind to int
        Where that ends in each ring, as `RingReader.place`; a ring that is not in it is read from
        its oldest slot on.
    failure : str
        Why the last file failed; empty if it did not.
    complained : bool
        Whether that was said.
    """

    task: RecordingTask
    report: RecorderReport = field(default_factory=RecorderReport)
    places: dict[RingKind, int] = field(default_factory=dict)
    failure: str = ""
    complained: bool = True

    def as_input(self) -> int:
        """Descriptor of a file in memory from which `of_input` reads it."""
        descriptor = os.memfd_create(f"recorder-part{self.report.parts + 1}")
        with open(descriptor, "w", encoding="utf-8", closefd=False) as written:
            json.dump(asdict(self), written)
        os.lseek(descriptor, 0, os.SEEK_SET)
        return descriptor

    @classmethod
    def of_input(cls) -> "RecorderState":
        """The state on standard input."""
        content = json.load(sys.stdin)
        task = content.pop("task")
        rotation = task.pop("rotation")
        task = RecordingTask(**task, rotation=None if rotation is None else Rotation(**rotation))
        report = RecorderReport(**content.pop("report"))
        places = {RingKind(kind): place for kind, place in content.pop("places").items()}
        return cls(task, report, places, **content)
