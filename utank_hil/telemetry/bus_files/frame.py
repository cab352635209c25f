"""What a log of the bus holds: frames of every kind, with their times and channels."""

from collections.abc import Iterator
from enum import IntEnum
from typing import TYPE_CHECKING, Final, NamedTuple, Protocol

if TYPE_CHECKING:
    from can import Message

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


class FrameSource(Protocol):
    """Frames of a file, read once from its begin."""

    notes: list[str]  #: What was not read as it stands, complete after the last frame.

    @property
    def place(self) -> str:
        """Place of the last frame in the file, such as ``line 12``."""

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
