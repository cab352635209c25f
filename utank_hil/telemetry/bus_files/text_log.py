"""Logs of text: one line a frame."""

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Final

from utank_hil.base.text_files import lines_of, open_text
from utank_hil.telemetry.bus_files.frame import BusFrame, BusLogError, FrameKind

LIMIT_BYTES: Final = 1 << 37  #: Largest text: more than a month of a full bus at 500 kbit/s.


class NotUnderstoodError(ValueError):
    """A line looks like a frame and is none; the message says why."""


class NotReadableError(ValueError):
    """A line shows that the whole log can't be read; the message says why, and the remedy."""


class TextLog:
    """Frames of a log of text.

    `parse` returns the frame of a line, with its line feed, or None for a line of another meaning;
    it raises `NotUnderstoodError` and `NotReadableError`. Unless lines are `counted`, which say how
    many bytes their frame has, a last line without line feed may be cut: it needs the 8 bytes of a
    full frame. The iteration raises BusLogError if no line is a frame, or a line shows that the log
    can't be read.
    """

    def __init__(self, path: Path, parse: Callable[[str], BusFrame | None], counted: bool) -> None:
        self.notes: list[str] = []
        self._path, self._parse, self._counted = path, parse, counted
        self._line = 0

    @property
    def place(self) -> str:
        """Line of the last frame."""
        return f"line {self._line}"

    def __iter__(self) -> Iterator[BusFrame]:
        found, skipped, first = 0, 0, ""
        with open_text(self._path, LIMIT_BYTES, self._cut, errors="replace") as text:
            for number, line in lines_of(self._path, text):
                self._line = number
                if "\0" in line:
                    self._cut(f"{self._path.name} holds zeros from line {self._line} on")
                    break
                try:
                    frame = self._parse(line)
                except NotReadableError as error:
                    raise BusLogError(f"{self._path}: line {self._line}: {error}") from error
                except NotUnderstoodError as error:
                    if line.endswith("\n"):
                        skipped += 1
                        first = first or f"line {self._line}, {line.strip()[:60]!r}: {error}"
                        continue
                    frame = None
                    self._cut(f"{self._path.name} is cut in line {self._line}")
                if frame is None:
                    continue
                full = self._counted or (len(frame.data) == 8 and frame.kind is FrameKind.DATA)
                if not line.endswith("\n") and not full:
                    self._cut(f"{self._path.name} ends in line {self._line}, which may be cut")
                    continue
                found += 1
                yield frame
        if not found:
            raise BusLogError(f"{self._path}: no frames in it{f'; {first}' if first else ''}")
        if skipped:
            lines = "1 line is" if skipped == 1 else f"{skipped} lines are"
            self.notes.append(
                f"{self._path.name}: {lines} not understood and left out, the first {first}"
            )

    def _cut(self, place: str) -> None:
        self.notes.append(f"{place}; what follows in it is left out")
