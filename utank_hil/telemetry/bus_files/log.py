"""A log of the bus in any format: which one is seen from its content, whatever its name."""

import re
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from utank_hil.base.text_files import open_content, open_text
from utank_hil.telemetry.bus_files import asc, binary, candump, savvycan, trc
from utank_hil.telemetry.bus_files.clock import OneClock
from utank_hil.telemetry.bus_files.frame import (
    LIMIT_BYTES,
    BusFrame,
    BusLogError,
    FrameSource,
    TextLog,
)

READ: Final = "candump, ASC, BLF, MF4, PEAK's .trc and SavvyCAN's .csv"  #: Formats that are read.
_LOOKS: Final[dict[str, re.Pattern[str]]] = {
    "savvycan": savvycan.LOOKS,
    "trc": trc.LOOKS,
    "candump": candump.LOOKS,
    "asc": asc.LOOKS,
}
_MARKS: Final = {binary.BLF_MARK: "blf", binary.MF4_MARK: "mf4"}
_LOOKED_AT: Final = 1 << 16  #: Characters at the begin of a file that show its format.


def format_of(path: Path) -> str:
    """Return the format of a log; empty if it looks like none."""
    with open_content(path, LIMIT_BYTES, _ignored) as content:
        mark = content.read(4)
    if mark in _MARKS:
        return _MARKS[mark]
    for line in _begin(path):
        for name, looks in _LOOKS.items():
            if looks.match(line):
                return name
    return ""


@dataclass(frozen=True, slots=True)
class BusLog:
    """Frames of a log, compressed with gzip or not; read anew by every call of `frames`.

    Without a `channel` all are read; `from_s` and `to_s` are seconds from the first frame.
    """

    path: Path
    channel: str | None = None
    from_s: float | None = None
    to_s: float | None = None

    def frames(self, notes: list[str] | None = None) -> Iterator[BusFrame]:
        """Yield the frames in the order of the file, on one clock; `notes` gets what was found.

        BusLogError is raised if it is no log, has no such frames, or its times can't be trusted.
        """
        source = self._source()
        others: set[str] = set()
        clock = OneClock(self.path.name, self._of_channel(source, others), lambda: source.place)
        begin_ns, found = None, False
        for frame in clock:
            begin_ns = frame.time_ns if begin_ns is None else begin_ns
            after_s = (frame.time_ns - begin_ns) * 1e-9
            if self.from_s is not None and after_s < self.from_s:
                continue
            if self.to_s is not None and after_s > self.to_s:
                if after_s > self.to_s + 1.0:  # A burst may be written late.
                    break
                continue
            found = True
            yield frame
        if begin_ns is None:
            raise BusLogError(
                f"{self.path}: no frames of channel {self.channel} in it; it has "
                f"{', '.join(sorted(others))}"
            )
        if not found:
            raise BusLogError(
                f"{self.path}: no frames between --from and --until; the last is at {after_s:g} s"
            )
        if notes is not None:
            notes += [*source.notes, *clock.notes]

    def _of_channel(self, source: FrameSource, others: set[str]) -> Iterator[BusFrame]:
        for frame in source:
            if self.channel is None or frame.channel == self.channel:
                yield frame
            else:
                others.add(frame.channel)

    def _source(self) -> FrameSource:
        name = format_of(self.path)
        if name == "blf":
            return binary.BlfLog(self.path)
        if name == "mf4":
            return binary.Mf4Log(self.path)
        if name == "candump":
            return TextLog(self.path, candump.parse, counted=False)
        if name == "savvycan":
            return TextLog(self.path, savvycan.parse, counted=True)
        if name:
            parser = asc.AscParser() if name == "asc" else trc.TrcParser()
            return TextLog(self.path, parser.parse, counted=True)
        begin = next(iter(_begin(self.path)), "")
        what = f"it begins with {begin[:60]!r}" if begin else "it is empty"
        raise BusLogError(f"{self.path}: is no log of the bus, such as {READ}: {what}")


def _begin(path: Path) -> list[str]:
    with open_text(path, LIMIT_BYTES, _ignored, errors="replace") as text:
        return [line for line in text.read(_LOOKED_AT).splitlines() if line.strip()]


def _ignored(_: str) -> None:
    """Take the place of a cut, which the reading itself reports."""
