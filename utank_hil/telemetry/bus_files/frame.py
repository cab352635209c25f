"""What a log of the bus holds: frames of every kind, with their times and channels."""

from collections.abc import Iterator
from enum import IntEnum
from typing import Final, NamedTuple, Protocol

FD_LENGTHS: Final = (*range(9), 12, 16, 20, 24, 32, 48, 64)
"""Number of data bytes by length code (ISO 11898-1)."""


class BusLogError(ValueError):
    """The file is no log of the bus, or lacks what is needed; the message says where and why."""


class FrameKind(IntEnum):
    """Kind of a frame."""

    DATA = 0
    FD = 1
    REMOTE = 2
    ERROR = 3


class BusFrame(NamedTuple):
    """One frame of a log.

    Attributes
    ----------
    time_ns : int
        Time as the log has it: since 1970, or since its own start.
    channel : str
        Name or number of the bus.
    number : int
        Identifier; of an error frame its class (Linux, can/error.h), 0 if unknown.
    extended : bool
        Whether the identifier has 29 bits.
    code : int
        Length code: number of bytes up to 8, else index in `FD_LENGTHS`.
    sent : bool or None
        Whether the logging program marks it as transmitted; None without mark.
    speed : int
        Of an FD frame: 1 if the bit rate was switched, plus 2 for the error state indicator.
    """

    time_ns: int
    channel: str
    number: int
    extended: bool
    kind: FrameKind
    data: bytes
    code: int
    sent: bool | None = None
    speed: int = 0


class FrameSource(Protocol):
    """Frames of a file, read once from its begin."""

    notes: list[str]
    """What was not read as it stands, complete after the last frame."""

    @property
    def place(self) -> str:
        """Place of the last frame in the file, such as ``line 12``."""

    def __iter__(self) -> Iterator[BusFrame]: ...


def time_ns(seconds: str, fraction: str) -> int:
    """Return the exact time of decimal digits; `seconds` may have a sign."""
    return int(seconds + fraction.ljust(9, "0")[:9])
