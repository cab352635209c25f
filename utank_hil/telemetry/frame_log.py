"""The frame log: a file that grows by blocks and is readable up to its last whole block.

After the file's mark come blocks: kind, length, CRC-32, then that many compressed bytes. The first
is the head, JSON that describes the log's origin; the others hold records of half a second,
inputs and answers of a controller node: with its configuration they determine its behaviour. Rows
of telemetry and events of a run are in blocks of their own (`run_log`).
"""

import json
import lzma
import struct
import zlib
from collections.abc import Callable, Iterator, Mapping
from enum import IntEnum
from pathlib import Path
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from utank_hil.base.closing import Closing
from utank_hil.base.text_files import refuse_device
from utank_hil.base.whole_file import append_whole, errors_name
from utank_hil.telemetry.ring import RingKind, RingWriter
from utank_hil.telemetry.rotation import part_of, whole_of

PAYLOAD_BYTES: Final = 8
RECORD: Final = np.dtype(
    [
        ("number", "<u4"), ("length", "u1"), ("data", "u1", (PAYLOAD_BYTES,)), ("kind", "u1"),
        ("spare", "<u2"), ("time_ns", "<i8"),
    ]
)  # fmt: skip
"""Type of a record: `number` is a frame's identifier or a count, `time_ns` the node's time."""
LAYOUT: Final = struct.Struct("<I9pB2xq")  #: Packed record: number, length, data, kind and time.
Records = npt.NDArray[np.void]  #: Records, shape (n,), of type `RECORD`.
IN_A_SLOT: Final = 32  #: Number of records in one slot of a ring; five ticks have some 25.


class Kind(IntEnum):
    """Kind of a record; inputs come before their TICK and answers after it."""

    RECEIVED = 1  #: A frame was received.
    SENT = 2  #: A frame was returned by the tick, or the stop, before.
    TICK = 3
    OTHERS = 4  #: `number` frames of other kinds were on the bus.
    LINK_ERROR = 5
    STOP = 6
    STARTED = 7  #: First record: the first byte says whether the loop has a real-time policy.
    ALIVE = 8  #: The controller asked whether the retuner lives; the first byte is the answer.
    ANSWER = 9  #: The controller took this piece of the retuner's answer of `number` bytes.
    LOST = 10  #: `number` rows were lost before they could be written.
    ESTIMATOR_ALIVE = 11
    ESTIMATE = 12  #: The estimator of sea and ship answered; ALIVE and ANSWER are the retuner's.


def frame_ring(slots: int) -> RingWriter:
    """Create a ring for packed records; raises RingError without room in shared memory."""
    return RingWriter(RingKind.FRAMES, LAYOUT.size, IN_A_SLOT, slots)


def pack(records: Records) -> bytes:
    """Arrange records so that they compress well: column by column, payloads by identifier."""
    head = np.zeros((len(records), 7), dtype=np.uint8)
    head[:, 0], head[:, 1] = records["kind"], records["length"]
    head[:, 3:] = records["number"].astype("<u4").view(np.uint8).reshape(-1, 4)
    steps_ns = np.diff(records["time_ns"], prepend=np.int64(0)).astype("<i8")
    times = steps_ns.view(np.uint8).reshape(-1, 8)
    payloads = records["data"][_by_sender(head)]
    planes = [np.ascontiguousarray(part.T).tobytes() for part in (head, times, payloads)]
    return struct.pack("<I", len(records)) + b"".join(planes)


def unpack(packed: bytes) -> Records:
    """Invert `pack`; raises ValueError for other data."""
    count = int.from_bytes(packed[:4], "little")
    planes = np.frombuffer(packed, dtype=np.uint8, offset=4)
    if planes.size != count * (7 + 8 + PAYLOAD_BYTES):
        raise ValueError(f"{planes.size} bytes are not {count} records")
    head, times, payloads = (
        np.ascontiguousarray(part.T)
        for part in np.split(planes.reshape(-1, count) if count else planes.reshape(23, 0), [7, 15])
    )
    records = np.zeros(count, dtype=RECORD)
    records["kind"], records["length"] = head[:, 0], head[:, 1]
    records["number"] = np.ascontiguousarray(head[:, 3:]).view("<u4").ravel()
    records["time_ns"] = np.cumsum(times.view("<i8").ravel())
    records["data"][_by_sender(head)] = payloads
    return records


def _by_sender(head: npt.NDArray[np.uint8]) -> npt.NDArray[np.intp]:
    """Return the order that groups records by kind and identifier; groups keep their order."""
    keys = head.astype(np.int64) @ (1 << np.arange(0, 56, 8))
    return np.argsort(keys, kind="stable")


SUFFIX: Final = ".frames"
BLOCK_NS: Final = 500_000_000  #: What a crash may lose.
_MARK: Final = b"UTANKHIL frames 1\n"
_BLOCK: Final = struct.Struct("<4sII")
_HEAD: Final = b"HEAD"
_QUICK: Final = b"BUSZ"  # Blocks of this kind are compressed with zlib.
_SMALL: Final = b"BUSX"  # Blocks of this kind are compressed with xz.
ROWS, EVENTS = b"ROWS", b"EVNT"
"""Kinds of blocks beside the records, compressed with zlib: rows of telemetry, and events."""
_MOST_BYTES: Final = 1 << 28  # Of a block, decompressed: 40 minutes of a full bus.


class FrameLogError(ValueError):
    """The file is no frame log, or lacks its beginning."""


class FrameLogWriter(Closing):
    """Writes a frame log over `file`; every `write` adds one block and syncs it to the disk.

    `head` is that of `replay_head`. Logs to be kept are compressed as well as possible (`small`).
    `OSError`, also raised by `write` and `close`, names the file.
    """

    def __init__(self, file: Path, head: Mapping[str, Any], *, small: bool = False) -> None:
        self._small = small
        self._content = file.open("wb", buffering=0)  # `close` repeats no failed write
        try:
            self._write(_MARK)
            self.append(_HEAD, json.dumps(head).encode())
        except OSError:
            self.close()
            raise

    def write(self, records: Records) -> None:
        """Append records, if there are any."""
        if not len(records):
            return
        packed = pack(records)
        if self._small:
            self._append(_SMALL, lzma.compress(packed, preset=9 | lzma.PRESET_EXTREME))
        else:
            self.append(_QUICK, packed)

    def append(self, kind: bytes, content: bytes) -> None:
        """Append a block of another kind (`ROWS`, `EVENTS`)."""
        self._append(kind, zlib.compress(content))

    def close(self) -> None:
        """Close the file; idempotent."""
        with errors_name(Path(self._content.name)):
            self._content.close()

    def _append(self, kind: bytes, payload: bytes) -> None:
        header = _BLOCK.pack(kind, len(payload), zlib.crc32(payload, zlib.crc32(kind)))
        self._write(header + payload)

    def _write(self, content: bytes) -> None:
        with errors_name(Path(self._content.name)):  # Half a block would end the reading.
            append_whole(self._content, content)


class BlockSink:
    """Collects records of a run in simulated time into blocks; longer blocks make smaller files."""

    def __init__(self, writer: FrameLogWriter, block_ns: int = BLOCK_NS) -> None:
        self._writer = writer
        self._block_ns = block_ns
        self._waiting = bytearray()
        self._begin_ns: int | None = None

    def write(self, records: bytes, time_ns: int) -> None:
        """Take the packed records of one tick."""
        if self._begin_ns is None:
            self._begin_ns = time_ns
        self._waiting += records
        if time_ns - self._begin_ns >= self._block_ns:
            self.flush()

    def flush(self) -> None:
        """Write the collected records."""
        self._writer.write(np.frombuffer(self._waiting, dtype=RECORD))
        self._waiting = bytearray()
        self._begin_ns = None


class FrameLog:
    """A frame log from part `path` on, block by block; `FrameLogError` if it is none."""

    def __init__(self, path: Path) -> None:
        first, number = whole_of(path)
        self.first_part = number == 1  #: Whether the log begins where the run did.
        self._paths = [path]
        while (following := part_of(first, number + len(self._paths))).exists():
            self._paths.append(following)
        #: Where and why reading ended before the end of a file, after all `blocks` were taken;
        #: empty if it did not.
        self.cut = ""
        kind, payload = next(self._read(path), (b"", b""))
        if kind != _HEAD:
            raise FrameLogError(f"{path}: {self.cut or 'its head is missing'}")
        try:
            self.head: dict[str, Any] = json.loads(payload)
        except (ValueError, RecursionError) as error:
            raise FrameLogError(f"{path}: its head is no JSON: {error}") from error
        if not isinstance(self.head, dict):
            raise FrameLogError(f"{path}: its head is no JSON object")

    def blocks(self, note: Callable[[str], None] | None = None) -> Iterator[Records]:
        """Yield the records block by block; `note` is called with `cut`, if it is not empty."""
        self.cut = ""
        for path in self._paths:
            for kind, payload in self._read(path):
                if kind not in (_QUICK, _SMALL):
                    continue
                try:
                    records = unpack(payload)
                except ValueError as error:
                    self.cut = f"{path.name} has a block that holds no records: {error}"
                    break
                yield records
            if self.cut:  # Records after a gap do not continue the same run.
                break
        if self.cut and note is not None:
            note(f"{self.cut}; what follows in it is left out")

    def others(self) -> Iterator[tuple[bytes, bytes]]:
        """Yield kind and content of the blocks of this part that are no records, as for `append`.

        After the last one `cut` says whether reading ended before the end of the file.
        """
        self.cut = ""
        for kind, payload in self._read(self._paths[0]):
            if kind in (ROWS, EVENTS):
                yield kind, payload

    def _read(self, path: Path) -> Iterator[tuple[bytes, bytes]]:
        refuse_device(path)
        with path.open("rb") as content:
            if content.read(len(_MARK)) != _MARK:
                if path == self._paths[0]:
                    raise FrameLogError(f"{path}: is no frame log of this version")
                self.cut = f"{path.name} is no frame log of this version"  # after a power cut
                return
            while header := content.read(_BLOCK.size):
                place = content.tell() - len(header)
                whole = len(header) == _BLOCK.size
                kind, length, checksum = _BLOCK.unpack(header) if whole else (b"", 1, 0)
                payload = content.read(length)
                if len(payload) < length:
                    self.cut = f"{path.name} is cut at byte {place + len(header) + len(payload)}"
                    return
                if zlib.crc32(payload, zlib.crc32(kind)) != checksum:
                    self.cut = f"{path.name} is damaged at byte {place}"
                    return
                try:
                    whole_block = _whole(kind, payload)
                except (ValueError, EOFError, zlib.error, lzma.LZMAError) as error:
                    self.cut = f"{path.name} is damaged at byte {place}: {error}"
                    return
                yield kind, whole_block


def _whole(kind: bytes, payload: bytes) -> bytes:
    """Return what a block holds; ValueError for one of another kind, or one that is too long."""
    decompressor: Any
    if kind == _SMALL:
        decompressor = lzma.LZMADecompressor(memlimit=_MOST_BYTES)
    elif kind in (_HEAD, _QUICK, ROWS, EVENTS):
        decompressor = zlib.decompressobj()
    else:
        raise ValueError(f"a block of the kind {kind!r} is not known")
    content: bytes = decompressor.decompress(payload, _MOST_BYTES)
    if not decompressor.eof:
        raise ValueError(f"a block is cut, or holds more than {_MOST_BYTES >> 20} MB")
    return content
