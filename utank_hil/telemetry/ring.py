"""A ring of float64 rows in shared memory: one writer that never waits, any number of readers.

The controller writes a row every tick; the recorder reads in a process of its own. It is a
broadcast ring: the writer overwrites the oldest row, never blocks, never looks at a reader, and
cannot tell whether there is one. Each reader has its own cursor, notices when it was lapped and
counts the rows it lost. Readers map the segment read-only, so nothing they do reaches the
controller.

Layout, in 8-byte words: header (`_Word`), column names as JSON, then `capacity` slots of
`width` values and one seal. The seal of row number k is the CRC-32 of the row's bytes, started
from k, so that a row of an earlier lap, or half of one, does not carry it.

Ordering. The writer stores values, then the seal, then the count of rows; a reader loads the count
and then the rows. Each count and seal is one aligned 8-byte word, which x86-64 and AArch64 store
and load whole. x86-64 also keeps the order of stores and of loads, so a row below the count is
complete. AArch64 may reorder both and Python has no fence to stop it: there the seal decides. A row
whose seal does not fit is never handed out: it has either been overwritten meanwhile (the count
says so: lost) or not become visible yet (left for the next read).

Life time. The writer owns the segment: `close` marks it closed and unlinks it, and readers that
hold it drain what is left. If the writer is killed, its `multiprocessing` resource tracker unlinks
it. Readers open the segment as a file instead of through `SharedMemory`, whose tracker (Python
below 3.13) would unlink it under the writer's feet when a reader exits.
"""

import contextlib
import json
import mmap
import os
import secrets
from collections.abc import Sequence
from enum import IntEnum
from multiprocessing.shared_memory import SharedMemory
from pathlib import Path
from typing import Final
from zlib import crc32

import numpy as np
import numpy.typing as npt

from utank_hil.arrays import FloatArray
from utank_hil.closing import Closing

_SHM: Final = Path("/dev/shm")
_MAGIC: Final = int.from_bytes(b"UTNKRING", "little")
_VERSION: Final = 1
_HEADER_WORDS: Final = 16


class _Word(IntEnum):
    """Place of each header entry; the row count has a cache line of its own."""

    MAGIC = 0
    VERSION = 1
    WIDTH = 2
    CAPACITY = 3
    NAMES_BYTES = 4
    WRITER_PID = 5
    WRITER_START = 6
    CLOSED = 7
    COUNT = 8


class RingError(OSError):
    """There is no such ring, or the segment is not one."""


class RingWriter(Closing):
    """The writing end; creates the segment and owns it.

    Parameters
    ----------
    columns : sequence of str
        Names of the values of a row; any number above zero, all different.
    capacity : int
        Rows kept before the oldest is overwritten. The default is 80 s at 100 Hz, about 1 MB.
    name : str, optional
        Name under which readers find the ring; made up if not given.

    Attributes
    ----------
    name : str
    columns : tuple of str
    count : int
        Rows written so far.

    Raises
    ------
    ValueError
        If there are no columns, a name comes twice, or the capacity is below two.
    RingError
        If a ring of that name exists and its writer lives, or there is no room for it.
    """

    def __init__(
        self, columns: Sequence[str], capacity: int = 8192, name: str | None = None
    ) -> None:
        self.columns = tuple(columns)
        if not self.columns or len(set(self.columns)) != len(self.columns):
            raise ValueError(f"a ring needs columns with different names, got {self.columns}")
        if capacity < 2:
            raise ValueError(f"a ring needs a capacity of two rows or more, got {capacity}")
        names = json.dumps(self.columns).encode()
        width = len(self.columns)
        first = _first_slot_word(len(names))
        size = 8 * (first + capacity * (width + 1))
        self.name = name or f"utank-{os.getpid()}-{secrets.token_hex(4)}"
        _remove_if_orphaned(self.name)
        try:
            self._shm: SharedMemory | None = SharedMemory(self.name, create=True, size=size)
        except FileExistsError as error:
            raise RingError(f"{_SHM / self.name} exists: its writer runs, or remove it") from error
        try:
            _reserve(self.name, size)
        except OSError as error:
            self._shm.close()
            self._shm.unlink()
            raise RingError(f"no room for {size} bytes in {_SHM}: {error.strerror}") from error
        memory = self._shm.buf
        assert memory is not None  # it is, until closed
        memory[8 * _HEADER_WORDS : 8 * _HEADER_WORDS + len(names)] = names
        words = np.frombuffer(memory, dtype=np.int64, count=size // 8)
        words[_Word.VERSION] = _VERSION
        words[_Word.WIDTH] = width
        words[_Word.CAPACITY] = capacity
        words[_Word.NAMES_BYTES] = len(names)
        words[_Word.WRITER_PID] = os.getpid()
        words[_Word.WRITER_START] = _start_of(os.getpid()) or 0
        words[_Word.MAGIC] = _MAGIC  # last: a reader takes the segment for a ring from here on
        slots = words[first:].reshape(capacity, width + 1)
        self._words = words
        # Views made once: a write then allocates nothing that outlives it.
        self._rows = list(slots[:, :width].view(np.float64))
        self._seals = slots[:, width]
        self._width = width
        self._capacity = capacity
        self.count = 0

    def write(self, row: FloatArray) -> None:
        """Append one row, over the oldest if the ring is full; never waits.

        Parameters
        ----------
        row : array (width,)

        Raises
        ------
        ValueError
            If the row's length is not the ring's width, or the ring is closed.
        """
        if len(row) != self._width:
            raise ValueError(f"row has {len(row)} values, the ring {self._width} columns")
        if self._shm is None:
            raise ValueError(f"ring {self.name!r} is closed")
        count = self.count
        index = count % self._capacity
        slot = self._rows[index]
        slot[:] = row
        self._seals[index] = crc32(slot, count & 0xFFFFFFFF)
        self.count = count + 1
        self._words[_Word.COUNT] = self.count

    def close(self) -> None:
        """Tell readers that no more rows will come, and unlink the segment; idempotent."""
        if self._shm is None:
            return
        self._words[_Word.CLOSED] = 1
        shm, self._shm = self._shm, None
        del self._words, self._seals  # mapped memory can be released only without views
        self._rows.clear()
        shm.close()
        shm.unlink()


class RingReader(Closing):
    """A reading end with its own cursor, which starts at the oldest row still there.

    Parameters
    ----------
    name : str
        The writer's `name`.

    Attributes
    ----------
    columns : tuple of str
    lost : int
        Rows overwritten before this reader got to them.

    Raises
    ------
    RingError
        If there is no such ring, or the segment is not a ring of this version.
    """

    def __init__(self, name: str) -> None:
        self.name = name
        try:
            descriptor = os.open(_SHM / name, os.O_RDONLY | os.O_CLOEXEC)
        except FileNotFoundError as error:
            raise RingError(f"no ring {name!r}: is its writer running?") from error
        try:
            size = os.fstat(descriptor).st_size
            if size < 8 * _HEADER_WORDS:
                raise RingError(f"{name!r} is too short for a telemetry ring")
            self._map = mmap.mmap(descriptor, size, access=mmap.ACCESS_READ)
        finally:
            os.close(descriptor)
        words = np.frombuffer(self._map, dtype=np.int64, count=size // 8)
        magic, version, width, capacity, names_bytes, pid, start = map(int, words[:7])
        first = _first_slot_word(names_bytes)
        if (magic, version) != (_MAGIC, _VERSION) or size < 8 * (first + capacity * (width + 1)):
            raise RingError(f"{name!r} is not a telemetry ring of version {_VERSION}")
        names = self._map[8 * _HEADER_WORDS : 8 * _HEADER_WORDS + names_bytes]
        self.columns: tuple[str, ...] = tuple(json.loads(names))
        self.lost = 0
        self._words = words
        self._slots = words[first : first + capacity * (width + 1)].reshape(capacity, width + 1)
        self._writer = (pid, start)
        self._next = max(0, int(words[_Word.COUNT]) - capacity)

    def read(self, max_rows: int | None = None) -> FloatArray:
        """Return the rows written since the last call, oldest first; never waits.

        Parameters
        ----------
        max_rows : int, optional
            At most so many.

        Returns
        -------
        array (n, width)
            A copy; n may be zero.
        """
        capacity, stride = self._slots.shape
        count = int(self._words[_Word.COUNT])
        oldest = max(self._next, count - capacity)
        self.lost += oldest - self._next
        self._next = oldest
        stop = count if max_rows is None else min(count, self._next + max_rows)
        numbers = np.arange(self._next, stop)
        copies: npt.NDArray[np.int64] = self._slots[numbers % capacity]
        intact = np.zeros(len(numbers), dtype=np.bool_)
        for place, number in enumerate(range(self._next, stop)):
            copy = copies[place]
            intact[place] = crc32(copy[:-1], number & 0xFFFFFFFF) == copy[-1]
            if not intact[place] and number > int(self._words[_Word.COUNT]) - capacity:
                stop = number  # written, but not all of it visible to this processor yet
                break
        self.lost += stop - self._next - int(intact.sum())
        self._next = stop
        return copies[intact, : stride - 1].view(np.float64)

    @property
    def ended(self) -> bool:
        """Whether no more rows will be written: the writer closed the ring, or is dead.

        Ask before reading, and stop when it was true and the read came back empty.
        """
        pid, start = self._writer
        return bool(self._words[_Word.CLOSED]) or _start_of(pid) != start

    def close(self) -> None:
        """Release the memory; idempotent. Rows that were read stay valid."""
        if not self._map.closed:
            del self._words, self._slots  # mapped memory can be released only without views
            self._map.close()


def _first_slot_word(names_bytes: int) -> int:
    """Word at which the slots begin, on a cache line."""
    return _HEADER_WORDS + 8 * -(-names_bytes // 64)


def _reserve(name: str, size: int) -> None:
    """Have memory put behind a segment now: a write that finds none later is a bus error."""
    descriptor = os.open(_SHM / name, os.O_RDWR | os.O_CLOEXEC)
    try:
        os.posix_fallocate(descriptor, 0, size)
    finally:
        os.close(descriptor)


def _start_of(pid: int) -> int | None:
    """Start time of a living process, in clock ticks since boot; None if dead or a zombie.

    Together with the pid it names a process for good: pids are used again, start times are not.
    """
    try:
        stat = Path(f"/proc/{pid}/stat").read_text()
    except (FileNotFoundError, ProcessLookupError):
        return None
    fields = stat.rpartition(")")[2].split()  # the command's name may hold spaces and brackets
    return None if fields[0] in "ZX" else int(fields[19])


def _remove_if_orphaned(name: str) -> None:
    """Unlink a segment of that name if its writer died without unlinking it."""
    try:
        with RingReader(name) as left_over:
            orphaned = left_over.ended
    except RingError:
        return
    if orphaned:
        with contextlib.suppress(FileNotFoundError):
            os.unlink(_SHM / name)
