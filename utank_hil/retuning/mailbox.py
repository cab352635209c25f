"""One message in shared memory: read whole or not at all, and never waited for.

Layout, in 8-byte words: number of the message, its length in bytes, its CRC-32, the writer's
heartbeat; then the bytes. The writer stores the number last. A reader looks at nothing else until
it is the number it waits for, and believes the bytes when their CRC, started from the number, fits:
a message half written or scribbled over is no message. The heartbeat is a time that the writer
stores again and again while it lives.
"""

import multiprocessing
from ctypes import c_char
from typing import Final
from zlib import crc32

_HEADER_WORDS: Final = 4


class Mailbox:
    """Either end of it; goes to a spawned process as an argument.

    Parameters
    ----------
    capacity : int
        Bytes of the longest message, at least.

    Raises
    ------
    ValueError
        If the capacity is below one byte.
    """

    def __init__(self, capacity: int) -> None:
        if capacity < 1:
            raise ValueError(f"a mailbox needs a capacity of a byte or more, got {capacity}")
        size = 8 * _HEADER_WORDS + capacity + -capacity % 8
        # an anonymous mapping: gone with the last process that holds it, however that ends
        self._memory = multiprocessing.get_context("spawn").RawArray(c_char, size)
        self.__setstate__(self._memory)

    def __getstate__(self) -> object:
        return self._memory

    def __setstate__(self, memory: object) -> None:
        self._memory = memory  # type: ignore[assignment]  # a ctypes array has no usable type
        whole = memoryview(memory).cast("B")  # type: ignore[arg-type]  # it has a buffer
        self._words = whole[: 8 * _HEADER_WORDS].cast("q")
        self._bytes = whole[8 * _HEADER_WORDS :]

    @property
    def number(self) -> int:
        """Number of the message that is in it, 0 if none ever was."""
        return self._words[0]

    @property
    def beat_ns(self) -> int:
        """The writer's latest heartbeat, 0 if there never was one."""
        return self._words[3]

    def beat(self, now_ns: int) -> None:
        """Store a heartbeat: a time on a clock that both ends read."""
        self._words[3] = now_ns

    def post(self, number: int, data: bytes) -> None:
        """Put a message in, over the one that was there.

        Parameters
        ----------
        number : int
            Other than that of the message before; not 0.
        data : bytes

        Raises
        ------
        ValueError
            If it is too long.
        """
        if len(data) > len(self._bytes):
            raise ValueError(f"{len(data)} bytes are too long for a mailbox of {len(self._bytes)}")
        self._bytes[: len(data)] = data
        self._words[1] = len(data)
        self._words[2] = crc32(data, number & 0xFFFFFFFF)
        self._words[0] = number

    def read(self, number: int) -> bytes | None:
        """Message of that number; None while it is not there, not complete, or damaged."""
        words = self._words
        if words[0] != number or not 0 <= words[1] <= len(self._bytes):
            return None
        data = bytes(self._bytes[: words[1]])
        return data if crc32(data, number & 0xFFFFFFFF) == words[2] else None
