"""A ring of records in shared memory: one writer that never waits, any number of readers.

The writer overwrites the oldest slot, never blocks and has no information about readers. A slot
holds the records of one write: several at once cost hardly more than one. Each reader has its own
cursor, detects when the writer has overtaken it, and counts the slots it lost. Readers map the
segment read-only.

Layout, in 8-byte words: header, kind and content as JSON, then the slots: room for some
bytes and one word that closes the slot, in its upper half how many bytes there are, in its lower
half their CRC-32. That of write number k is started from k, so that a slot of an earlier lap, or a
part of one, fails it.

Ordering. The writer stores the bytes, then the closing word, then the count of writes; a reader
loads the count and then the slots. Count and closing word are aligned 8-byte words, which x86-64
and AArch64 store and load atomically. x86-64 also keeps the order, so a slot below the count is
complete. AArch64 may reorder, and Python has no memory fence: there the checksum decides. A slot
with a wrong checksum is never returned: it was either overwritten meanwhile (lost, as the count
shows) or is not visible yet (left for the next read).

Lifetime. The writer owns the segment: `close` marks it closed and unlinks it, and attached readers
drain the rest. If the writer is killed, its `multiprocessing` resource tracker unlinks it, else the
next writer of the same user does. Readers open the segment as a file, not as `SharedMemory`, whose
tracker (Python below 3.13) would unlink it when a reader exits.
"""

import json
import mmap
import os
import secrets
import stat
from array import array
from collections.abc import Mapping, Sequence
from contextlib import suppress
from enum import StrEnum
from multiprocessing import resource_tracker
from multiprocessing.shared_memory import SharedMemory
from pathlib import Path
from typing import Any, Final
from zlib import crc32

import numpy as np

from utank_hil.base.arrays import FloatArray
from utank_hil.base.closing import Closing

_SHM: Final = Path("/dev/shm")
_PREFIX: Final = "utank-"
_MAGIC: Final = int.from_bytes(b"UTNKRING", "little")
_VERSION: Final = 4
_HEADER_WORDS: Final = 16


class RingKind(StrEnum):
    """Kind of all records of a ring."""

    ROWS = "rows"
    EVENTS = "events"
    FRAMES = "frames"


# Words of the header: mark, version, bytes of a slot, slots, bytes of the text, pid and start of
# the writer; the count has a cache line of its own.
_FIXED_WORDS: Final = 7
_COUNT: Final = 8
_CLOSED: Final = 9


class RingError(OSError):
    """There is no such ring, or the segment is not a ring."""


class RingWriter(Closing):
    """Writing end; creates and owns the segment.

    A record has `record_bytes`, 1 for records of individual lengths; there are `records` in a slot,
    together a multiple of 8 bytes, and two or more `slots`. `content` describes the records for
    readers, ready for `json.dumps`. Raises `RingError` if there is no room for it.
    """

    def __init__(
        self,
        kind: RingKind,
        record_bytes: int,
        records: int,
        slots: int,
        content: Mapping[str, Any] | None = None,
    ) -> None:
        slot_bytes = record_bytes * records
        text = json.dumps({"kind": kind, **(content or {})}).encode()
        first = _first_slot_byte(len(text))
        stride = slot_bytes + 8
        size = first + slots * stride
        #: Name of the ring for readers.
        self.name = f"{_PREFIX}{os.getpid()}-{secrets.token_hex(4)}"
        # A process group that was killed as a whole leaves its segment.
        for left_over in ring_names():
            _remove_if_orphaned(left_over)
        self._shm: SharedMemory | None = SharedMemory(self.name, create=True, size=size)
        try:
            _reserve(self.name, size)
        except OSError as error:
            self._shm.close()
            self._shm.unlink()
            raise RingError(f"no room for {size} bytes in {_SHM}: {error.strerror}") from error
        memory = self._shm.buf
        assert memory is not None  # The memory exists until it is closed.
        memory[:size] = bytes(size)  # Otherwise the first write to each page would take longer.
        memory[8 * _HEADER_WORDS : 8 * _HEADER_WORDS + len(text)] = text
        words = memory[:size].cast("q")
        pid, start = os.getpid(), _process_start(os.getpid()) or 0
        head = array("q", (_VERSION, slot_bytes, slots, len(text), pid, start))
        words[1:_FIXED_WORDS] = memoryview(head)
        words[0] = _MAGIC  # This is last: from here on readers accept the segment.
        self._words = words
        # Views are created once, so that a write allocates nothing permanent.
        self._slots = [memory[at : at + slot_bytes] for at in range(first, size, stride)]
        self._closing = words[(first + slot_bytes) // 8 :: stride // 8]
        self._record_bytes, self._slot_bytes, self._slot_count = record_bytes, slot_bytes, slots
        self.count = 0  #: Number of slots written so far.

    def write(self, records: FloatArray | bytes | bytearray) -> None:
        """Append one or more records, overwriting the oldest if the ring is full; never blocks.

        What does not fit into a slot goes into the next. ValueError is raised if there are no
        records, incomplete ones, or the ring is closed.
        """
        data = records.tobytes() if isinstance(records, np.ndarray) else records
        if len(data) % self._record_bytes or not data:
            raise ValueError(f"{len(data)} bytes are no records of {self._record_bytes} bytes each")
        if self._shm is None:
            raise ValueError(f"ring {self.name!r} is closed")
        for start in range(0, len(data), self._slot_bytes):
            part = data[start : start + self._slot_bytes]
            count = self.count
            index = count % self._slot_count
            self._slots[index][: len(part)] = part
            self._closing[index] = len(part) << 32 | crc32(part, count & 0xFFFFFFFF)
            self.count = count = count + 1
            self._words[_COUNT] = count

    def close(self) -> None:
        """Mark the ring as closed for readers, and unlink the segment; idempotent."""
        if self._shm is None:
            return
        self._words[_CLOSED] = 1
        shm, self._shm = self._shm, None
        del self._words, self._closing  # Mapped memory can be released only without views.
        self._slots.clear()
        shm.close()
        try:
            shm.unlink()
        except FileNotFoundError:  # removed, as by systemd-logind when its user leaves
            resource_tracker.unregister(f"/{self.name}", "shared_memory")


class RingReader(Closing):
    """Reading end with its own cursor, from the oldest slot on.

    Raises `RingError` if there is no such ring, or it is not of this version and `kind`.
    """

    def __init__(self, name: str, kind: RingKind | None = None) -> None:
        self.name = name
        descriptor = _opened(name)
        try:
            size = os.fstat(descriptor).st_size
            if size < 8 * _HEADER_WORDS:
                raise RingError(f"{name!r} is too short for a telemetry ring")
            self._map = mmap.mmap(descriptor, size, access=mmap.ACCESS_READ)
        finally:
            os.close(descriptor)
        self._words = memoryview(self._map)[: 8 * _HEADER_WORDS].cast("q")
        fixed = self._words[:_FIXED_WORDS].tolist()
        magic, version, slot_bytes, slots, text_bytes, pid, start = fixed
        self._first, self._stride = _first_slot_byte(text_bytes), slot_bytes + 8
        fits = min(slot_bytes, slots, text_bytes) > 0 and slot_bytes % 8 == 0
        if (magic, version) != (_MAGIC, _VERSION) or not (
            fits and size >= self._first + slots * self._stride
        ):
            raise RingError(f"{name!r} is not a telemetry ring of version {_VERSION}")
        text = self._map[8 * _HEADER_WORDS : 8 * _HEADER_WORDS + text_bytes]
        try:
            #: The writer's description of the records.
            self.content: Mapping[str, Any] = dict(json.loads(text))
            self.kind = RingKind(self.content["kind"])
        except (ValueError, TypeError, KeyError, RecursionError) as error:
            raise RingError(f"{name!r} is a damaged telemetry ring") from error
        if kind not in (None, self.kind):
            raise RingError(f"{name!r} is a telemetry ring of {self.kind}, not of {kind}")
        self.writer_pid: int = pid
        self.lost = 0  #: Number of slots overwritten before they were read.
        self._slots: int = slots
        self._writer_start: int = start
        #: Number of slots read or lost, counted from the first that was ever written.
        self.place: int = max(0, self._words[_COUNT] - slots)

    def read(self) -> list[bytes]:
        """Return what was written since the last call, by slot, oldest first; never blocks."""
        stop = self._words[_COUNT]
        found: list[bytes] = []
        for number in range(max(self.place, stop - self._slots), stop):
            start = self._first + number % self._slots * self._stride
            slot = self._map[start : start + self._stride]
            closing = int.from_bytes(slot[-8:], "little")
            data = slot[: closing >> 32]
            if crc32(data, number & 0xFFFFFFFF) == closing & 0xFFFFFFFF:
                found.append(data)
            elif number > self._words[_COUNT] - self._slots:
                stop = number  # This slot is written, but not yet visible to this processor.
                break
        self.lost += stop - self.place - len(found)
        self.place = stop
        return found

    @property
    def ended(self) -> bool:
        """Whether no more records will be written: the writer closed the ring, or is dead.

        Check before reading, and stop when this was true and the read returns nothing.
        """
        return bool(self._words[_CLOSED]) or not self.writer_lives

    @property
    def writer_lives(self) -> bool:
        """Whether the process that owns the segment runs, closed or not."""
        return _process_start(self.writer_pid) == self._writer_start

    def close(self) -> None:
        """Release the memory; idempotent. Data already read stays valid."""
        self._words.release()  # Mapped memory can be released only without views.
        self._map.close()


def _opened(name: str) -> int:
    # Another user's file may be a pipe, which waits for a writer, or a link to a device.
    flags = os.O_RDONLY | os.O_CLOEXEC | os.O_NONBLOCK | os.O_NOFOLLOW
    try:
        descriptor = os.open(_SHM / name, flags)
    except FileNotFoundError as error:
        raise RingError(f"no ring {name!r}: is its writer running?") from error
    status = os.fstat(descriptor)
    # Whoever owns a segment may cut it, which kills its reader; root reads those of a service.
    foreign = os.geteuid() not in (0, status.st_uid)
    if foreign or not stat.S_ISREG(status.st_mode):
        os.close(descriptor)
        raise RingError(f"{name!r} {'is of another user' if foreign else 'is no telemetry ring'}")
    return descriptor


def ring_names() -> list[str]:
    """Return the names of the files on this machine that may be rings, in order."""
    return sorted(path.name for path in _SHM.glob(f"{_PREFIX}*"))


def _first_slot_byte(text_bytes: int) -> int:
    return 8 * _HEADER_WORDS + 64 * -(-text_bytes // 64)


def _reserve(name: str, size: int) -> None:
    """Allocate the segment's memory now: without it a later write is a bus error (SIGBUS)."""
    descriptor = os.open(_SHM / name, os.O_RDWR | os.O_CLOEXEC)
    try:
        os.posix_fallocate(descriptor, 0, size)
    finally:
        os.close(descriptor)


def _process_start(pid: int) -> int | None:
    """Return a living process's start in clock ticks since boot, as pids are reused; else None."""
    try:
        status = Path(f"/proc/{pid}/stat").read_bytes()
    except (FileNotFoundError, ProcessLookupError):
        return None
    fields = status.rpartition(b")")[2].split()  # The command's name may hold anything.
    return None if fields[0] in b"ZX" else int(fields[19])


def _remove_if_orphaned(name: str) -> None:
    """Unlink a segment of this name if it is this user's and its writer died without unlinking it.

    A file that belongs to another user, or that others may write to, is not read.
    """
    with suppress(OSError):  # There is none, it is no ring, or it has gone since.
        status = os.stat(_SHM / name, follow_symlinks=False)
        if status.st_uid != os.geteuid() or status.st_mode & (stat.S_IWGRP | stat.S_IWOTH):
            return
        with RingReader(name) as left_over:
            lives = left_over.writer_lives  # A writer that has closed it is about to unlink it.
        if not lives:
            os.unlink(_SHM / name)


class RowWriter(RingWriter):
    """Writing end of a ring of rows; by default seven minutes at 20 Hz, some 2 MB.

    The columns are one or more different names. `about` is the origin of the rows
    (`utank_hil.base.provenance`).
    """

    def __init__(
        self, columns: Sequence[str], slots: int = 8192, about: Mapping[str, Any] | None = None
    ) -> None:
        content = {"columns": tuple(columns), "about": about}
        super().__init__(RingKind.ROWS, 8 * len(columns), 1, slots, content)


class RowReader(RingReader):
    """Reading end of a ring of rows; `about` is their origin, None if unknown."""

    def __init__(self, name: str) -> None:
        super().__init__(name, RingKind.ROWS)
        columns, about = self.content.get("columns"), self.content.get("about")
        if not isinstance(columns, list) or self._stride != 8 * len(columns) + 8:
            raise RingError(f"{name!r} is a damaged telemetry ring: {columns} are its columns")
        self.columns: tuple[str, ...] = tuple(map(str, columns))
        self.about: Mapping[str, Any] | None = about if isinstance(about, dict) else None

    def read_rows(self) -> FloatArray:
        """Return the rows written since the last call, shape (n, width), n may be zero."""
        values: FloatArray = np.frombuffer(b"".join(self.read()))
        return values.reshape(-1, len(self.columns))
