"""Transfer of records from the ring of frames to the frame log."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from utank_hil.base.closing import Closing
from utank_hil.telemetry.bus_records import IN_A_SLOT, RECORD, Kind
from utank_hil.telemetry.frame_log import SUFFIX, FrameLogWriter
from utank_hil.telemetry.ring import RingKind, RingReader


class FrameRecording(Closing):
    """Writes a ring of `bus_records` into a frame log.

    The log is written beside the recording `file`; `place` is the place in the ring to start from
    (`RingReader`).
    """

    def __init__(
        self, ring: str, file: Path, head: Mapping[str, Any], place: int | None = None
    ) -> None:
        self._reader = RingReader(ring, place, RingKind.FRAMES)
        self._writer = FrameLogWriter(file.with_suffix(SUFFIX), head)
        #: Number of records overwritten before they were read; each lost slot counts as full.
        self.lost = 0

    @property
    def place(self) -> int:
        """Place in the ring up to which records are written (`RingReader`)."""
        return self._reader.place

    def write(self) -> None:
        """Write what has come since the last call."""
        records = np.frombuffer(b"".join(self._reader.read()), dtype=RECORD)
        lost = IN_A_SLOT * self._reader.lost - self.lost
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
