"""A mailbox for one message in shared memory; neither end ever waits.

Layout, in 8-byte words: number of the message, its length in bytes, its CRC-32, the writer's
heartbeat; then the payload. The writer stores the number last. A reader polls for the expected
number and accepts the payload if its CRC-32, started from the number, is right. A message that is
half written or damaged is therefore not read.
"""

import multiprocessing
from ctypes import c_char
from typing import Final
from zlib import crc32

_HEADER_WORDS: Final = 4  # The words are number, length, checksum and heartbeat.


class Mailbox:
    """Both ends of the mailbox; may be an argument of a spawned process.

    The capacity is in bytes; a ValueError is raised if it is below one.
    """

    def __init__(self, capacity: int) -> None:
        if capacity < 1:
            raise ValueError(f"a mailbox needs a capacity of a byte or more, got {capacity}")
        size = 8 * _HEADER_WORDS + capacity + -capacity % 8
        # An anonymous mapping is freed with the last process that holds it, even a killed one.
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
        """Number of the present message, 0 before the first."""
        return self._words[0]

    @property
    def beat_ns(self) -> int:
        """Time of the writer's latest heartbeat in ns; 0 before the first."""
        return self._words[3]

    def beat(self, now_ns: int) -> None:
        """Store a heartbeat; both ends must read the same clock."""
        self._words[3] = now_ns

    def post(self, number: int, data: bytes) -> None:
        """Replace the message.

        `number` differs from the last message's and from 0. A message longer than the capacity
        raises a ValueError.
        """
        if len(data) > len(self._bytes):
            raise ValueError(f"{len(data)} bytes are too long for a mailbox of {len(self._bytes)}")
        self._bytes[: len(data)] = data
        self._words[1] = len(data)
        self._words[2] = crc32(data, number & 0xFFFFFFFF)
        self._words[0] = number

    def read(self, number: int) -> bytes | None:
        """Return the message of this number; None if it is absent, incomplete or damaged."""
        words = self._words
        if words[0] != number or not 0 <= words[1] <= len(self._bytes):
            return None
        data = bytes(self._bytes[: words[1]])
        return data if crc32(data, number & 0xFFFFFFFF) == words[2] else None
