"""What a log of the bus holds: frames of every kind, with their times and channels."""

from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator
from enum import IntEnum
from pathlib import Path
from typing import TYPE_CHECKING, Final, NamedTuple

from utank_hil.base.text_files import lines_of, open_text

if TYPE_CHECKING:
    from can import Message

FD_LENGTHS: Final = (*range(9), 12, 16, 20, 24, 32, 48, 64)
"""Number of data bytes by length code (ISO 11898-1)."""
LIMIT_BYTES: Final = 1 << 37  #: Largest text: more than a month of a full bus at 500 kbit/s.


class BusLogError(ValueError):
    """The file is no log of the bus, or lacks what is needed; the message says where and why."""


class FrameKind(IntEnum):
    """Kind of a frame."""

    DATA = 0
    FD = 1
    REMOTE = 2
    ERROR = 3


class BusFrame(NamedTuple):
    """One frame of a log."""

    time_ns: int  #: Time as the log has it: since 1970, or since its own start.
    channel: str  #: Name or number of the bus.
    number: int  #: Identifier; of an error frame its class (Linux, can/error.h), 0 if unknown.
    extended: bool  #: Whether the identifier has 29 bits.
    kind: FrameKind
    data: bytes
    code: int  #: Length code: number of bytes up to 8, else index in `FD_LENGTHS`.
    sent: bool | None = None  #: Whether it is marked as transmitted; None without mark.
    speed: int = 0  #: Of an FD frame: 1 if the bit rate was switched, plus 2 for the error state.


class FrameSource(ABC):
    """Frames of a file, read once from its begin; then `notes` say what was not read as it is."""

    _unit = "frame"

    def __init__(self, path: Path) -> None:
        self.notes: list[str] = []
        self._path, self._count = path, 0

    @property
    def place(self) -> str:
        """Place of the last frame in the file, such as ``line 12``."""
        return f"{self._unit} {self._count}"

    @abstractmethod
    def __iter__(self) -> Iterator[BusFrame]: ...


def of_message(message: "Message", channel: str) -> BusFrame:
    """Return the frame of a message of python-can."""
    kind = FrameKind.FD if message.is_fd else FrameKind.DATA
    kind = FrameKind.REMOTE if message.is_remote_frame else kind
    kind = FrameKind.ERROR if message.is_error_frame else kind
    data = bytes(message.data)
    size = message.dlc if kind is FrameKind.REMOTE else len(data)
    code = size if size <= 8 else FD_LENGTHS.index(size)
    number, extended, sent = message.arbitration_id, message.is_extended_id, not message.is_rx
    now_ns = round(message.timestamp * 1e9)
    speed = message.bitrate_switch + 2 * message.error_state_indicator
    return BusFrame(now_ns, channel, number, extended, kind, data, code, sent, speed)


def time_ns(seconds: str, fraction: str) -> int:
    """Return the exact time of decimal digits; `seconds` may have a sign."""
    return int(seconds + fraction.ljust(9, "0")[:9])


class NotUnderstoodError(ValueError):
    """A line looks like a frame and is none; the message says why."""


class NotReadableError(ValueError):
    """A line shows that the whole log can't be read; the message says why, and the remedy."""


LineParser = Callable[[str], BusFrame | None]


class TextLog(FrameSource):
    """Frames of a log of text; BusLogError if no line is one, or the log can't be read.

    `parse` returns the frame of a line, with its line feed, or None for a line of another meaning;
    it raises `NotUnderstoodError` and `NotReadableError`. Unless lines are `counted`, which say how
    many bytes their frame has, a last line without line feed may be cut: it needs the 8 bytes of a
    full frame.
    """

    _unit = "line"

    def __init__(self, path: Path, parse: LineParser, counted: bool) -> None:
        super().__init__(path)
        self._parse, self._counted = parse, counted

    def __iter__(self) -> Iterator[BusFrame]:
        found, skipped, first = 0, 0, ""
        with open_text(self._path, LIMIT_BYTES, self._cut, errors="replace") as text:
            for number, line in lines_of(self._path, text):
                self._count = number
                if "\0" in line:
                    self._cut(f"{self._path.name} holds zeros from {self.place} on")
                    break
                try:
                    frame = self._parse(line)
                except NotReadableError as error:
                    raise BusLogError(f"{self._path}: {self.place}: {error}") from error
                except NotUnderstoodError as error:
                    if line.endswith("\n"):
                        skipped += 1
                        first = first or f"{self.place}, {line.strip()[:60]!r}: {error}"
                        continue
                    frame = None
                    self._cut(f"{self._path.name} is cut in {self.place}")
                if frame is None:
                    continue
                full = self._counted or (len(frame.data) == 8 and frame.kind is FrameKind.DATA)
                if not line.endswith("\n") and not full:
                    self._cut(f"{self._path.name} ends in {self.place}, which may be cut")
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
