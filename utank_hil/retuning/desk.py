"""A desk: the requests of one kind to the retuner's process, and their answers.

The mailboxes hold the only state: a request is open while its number differs from the answer's.
"""

import multiprocessing
import sys
import time
import traceback
from ctypes import c_char
from typing import Final
from zlib import crc32

from utank_hil.retuning.answer import LONGEST_BYTES, Answer, Refusal, answer_bytes, read_answer
from utank_hil.retuning.retuner import Request, Work
from utank_hil.retuning.wire import OVERHEAD_BYTES, decoder, encode

_HEADER_WORDS: Final = 4  # The words are number, length, checksum and heartbeat.


_ALIVE_NS: Final = 5_000_000_000  # The worker has low priority and may wait long on a busy machine.


class Mailbox:
    """Both ends of the mailbox; may be an argument of a spawned process.

    Layout, in 8-byte words: number of the message, its length in bytes, its CRC-32, the writer's
    heartbeat; then the payload. The writer stores the number last. A reader polls for the expected
    number and accepts the payload if its CRC-32, started from the number, is right. A message that
    is half written or damaged is therefore not read.

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


class Desk:
    """Both ends of the requests for one kind of work; may be an argument of a spawned process."""

    def __init__(self, work: Work) -> None:
        self._compute, self._request, most_numbers = work
        self._requests = Mailbox(OVERHEAD_BYTES + 8 * most_numbers)
        self._answers = Mailbox(LONGEST_BYTES)

    @property
    def alive(self) -> bool:
        """Whether the worker's heartbeat is recent."""
        return abs(time.monotonic_ns() - self._answers.beat_ns) < _ALIVE_NS

    @property
    def beat_ns(self) -> int:
        """Time of the worker's latest heartbeat."""
        return self._answers.beat_ns

    def submit(self, number: int, request: Request, now_ns: int) -> None:  # noqa: ARG002
        """Post a request."""
        self._requests.post(number, encode(request))

    def answer(self, number: int, now_ns: int) -> Answer | None:  # noqa: ARG002
        """Return the answer, if any; a message that cannot be decoded counts as a refusal."""
        data = self._answers.read(number)
        if data is None:
            return None
        try:
            return read_answer(data)
        except ValueError as error:
            return Refusal((f"the retuner answered nonsense: {error}",))

    def beat(self, now_ns: int) -> None:
        """Store the worker's heartbeat."""
        self._answers.beat(now_ns)

    def serve(self) -> bool:
        """Answer the open request in the worker and return whether there was one.

        An exception becomes a refusal, with its traceback on standard error.
        """
        number = self._requests.number
        data = self._requests.read(number) if number != self._answers.number else None
        if data is None:
            return False
        try:
            request = decoder(self._request, finite=False).decode(data)
            self._answers.post(number, answer_bytes(self._compute(request)))
        except Exception as error:
            traceback.print_exc(file=sys.stderr)
            refusal = Refusal((f"the retuner failed: {type(error).__name__}: {error}",))
            self._answers.post(number, answer_bytes(refusal))
        return True

    def refuse_open(self, reason: str) -> None:
        """Refuse the open request, if any, on behalf of the worker."""
        number = self._requests.number
        if number != self._answers.number:
            self._answers.post(number, answer_bytes(Refusal((reason,))))
