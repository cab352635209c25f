"""Logs in binary formats: BLF of Vector's programs, and MDF 4 (``.mf4``)."""

import logging
import zlib
from collections.abc import Iterator
from datetime import UTC, datetime
from importlib import reload
from importlib.util import find_spec
from struct import Struct
from typing import BinaryIO, Final

from utank_hil.base.apart import apart
from utank_hil.base.text_files import open_content
from utank_hil.telemetry.bus_files.frame import (
    FD_LENGTHS,
    LIMIT_BYTES,
    BusFrame,
    BusLogError,
    FrameKind,
    FrameSource,
    of_message,
)

BLF_MARK: Final = b"LOGG"
MF4_MARK: Final = b"MDF "
_FILE: Final = Struct("<4sL32x8H")  # mark, size of the head; when the log was begun
_OBJECT: Final = Struct("<4sHHLL")  # mark, size of the head, its version, size, type
_TIME: Final = Struct("<L4xQ")  # flags; time
_CLASSIC: Final = Struct("<HBBL8s")
_FD: Final = Struct("<HBBL5xBB5x64s")
_FD_64: Final = Struct("<BBBxL4xL20xBB4x")
_ERROR: Final = Struct("<H8xB5xL4x8s")
_CONTAINER: Final = 10
_CONTAINER_HEAD: Final = 16
_LIMIT: Final = 1 << 26  #: Largest object: programs write containers of 128 kB.
_EXTENDED: Final = 0x80000000
_MASK: Final = 0x1FFFFFFF
_PART: Final = 1000  #: Number of frames that are handed from process to process at once.
_TICK_NS: Final = 10_000  #: Unit of time of objects with the flag 1; of others it is 1 ns.


class BlfLog(FrameSource):
    """Frames of a BLF file; BusLogError if there is none before the first damaged object."""

    _byte = 0

    def __iter__(self) -> Iterator[BusFrame]:
        cut = ""
        with open_content(self._path, LIMIT_BYTES, self.notes.append) as content:
            begin_ns = self._begin_ns(content)
            try:
                for kind, head_size, body in self._objects(content):
                    frame = _frame(kind, head_size, body, begin_ns)
                    if frame is not None:
                        self._count += 1
                        yield frame
            except _CutError as error:
                cut = f"{self._path.name} is cut after frame {self._count}: {error}"
            except _DamagedError as error:
                raise BusLogError(
                    f"{self._path}: is damaged after frame {self._count}, in the object that ends "
                    f"at byte {self._byte}: {error}; use the part before by --until"
                ) from error
        if not self._count:
            raise BusLogError(f"{self._path}: no frames in it{f': {cut}' if cut else ''}")
        if cut:
            self.notes.append(f"{cut}; what follows in it is left out")

    def _begin_ns(self, content: BinaryIO) -> int:
        head = content.read(_FILE.size)
        if len(head) < _FILE.size or head[:4] != BLF_MARK:
            raise BusLogError(f"{self._path}: is no BLF file, or its head is cut")
        _, size, year, month, _, *day_to_milliseconds = _FILE.unpack(head)
        self._byte = len(head) + len(content.read(max(0, min(size, _LIMIT) - len(head))))
        day, hour, minute, second, milliseconds = day_to_milliseconds
        try:
            begin = datetime(year, month, day, hour, minute, second, tzinfo=UTC)
        except ValueError:  # Zeros: the times count from the log's begin.
            return 0
        return int(begin.timestamp()) * 10**9 + int(milliseconds) * 10**6

    def _objects(self, content: BinaryIO) -> Iterator[tuple[int, int, bytes]]:
        """Yield type, size of the head and bytes of each object in the containers."""
        rest = b""
        while head := content.read(_OBJECT.size):
            size, kind = _checked(head, 0)
            body = content.read(size - len(head))
            if len(body) < size - len(head):
                raise _CutError("the file ends in an object")
            self._byte += size + len(content.read(size % 4))
            if kind != _CONTAINER:
                continue
            rest += _unpacked(body)
            place = 0
            while len(rest) - place >= _OBJECT.size:
                if not rest.startswith(b"LOBJ", place):  # Up to 3 bytes fill up an object.
                    place = rest.find(b"LOBJ", place, place + 8)
                    if place < 0:
                        raise _DamagedError("no object where one should begin")
                    if len(rest) - place < _OBJECT.size:
                        break
                size, kind = _checked(rest, place)
                if len(rest) - place < size:
                    break
                yield kind, _OBJECT.unpack_from(rest, place)[1], rest[place : place + size]
                place += size
            rest = rest[place:]
        if len(rest) > 3:
            raise _CutError("its last object is not whole")


class _DamagedError(ValueError):
    """The file is damaged; the message says how."""


class _CutError(_DamagedError):
    """The file ends before its last object does."""


def _checked(data: bytes, place: int) -> tuple[int, int]:
    if len(data) - place < _OBJECT.size:
        raise _CutError("the file ends in an object")
    mark, head_size, _, size, kind = _OBJECT.unpack_from(data, place)
    if mark != b"LOBJ" or not _OBJECT.size <= size <= _LIMIT or head_size > size:
        raise _DamagedError(f"an object of {size} bytes")
    return int(size), int(kind)


def _unpacked(body: bytes) -> bytes:
    method = int.from_bytes(body[:2], "little")
    if method == 0:
        return body[_CONTAINER_HEAD:]
    if method != 2:
        raise _DamagedError(f"a container of the unknown compression {method}")
    unpacking = zlib.decompressobj()
    try:
        content = unpacking.decompress(body[_CONTAINER_HEAD:], _LIMIT)
    except zlib.error as error:
        raise _DamagedError("a container that can't be decompressed") from error
    if not unpacking.eof:
        raise _DamagedError(f"a container that is cut or has more than {_LIMIT} bytes")
    return content


def _frame(kind: int, head_size: int, body: bytes, begin_ns: int) -> BusFrame | None:
    layout = {1: _CLASSIC, 86: _CLASSIC, 100: _FD, 101: _FD_64, 73: _ERROR, 2: None}.get(kind, 0)
    if layout == 0:
        return None
    if len(body) < max(32, head_size + (layout.size if isinstance(layout, Struct) else 2)):
        raise _DamagedError(f"an object of {len(body)} bytes")
    flags, time = _TIME.unpack_from(body, _OBJECT.size)
    now_ns = begin_ns + time * (_TICK_NS if flags == 1 else 1)
    if layout is None or layout is _ERROR:
        channel = int.from_bytes(body[head_size : head_size + 2], "little")
        code, number, data = _ERROR.unpack_from(body, head_size)[1:] if layout else (0, 0, b"")
        data = data[: min(code, 8)]
        extended = bool(number & _EXTENDED)
        return BusFrame(
            now_ns, str(channel), number & _MASK, extended, FrameKind.ERROR, data, len(data)
        )
    speed, is_fd = 0, False
    if layout is _CLASSIC:
        channel, flags, code, number, data = layout.unpack_from(body, head_size)
        size, sent, remote = min(code, 8), flags & 1, flags & 0x80
    elif layout is _FD:
        channel, flags, code, number, fd_flags, size, data = layout.unpack_from(body, head_size)
        sent, remote, is_fd, speed = flags & 1, flags & 0x80, bool(fd_flags & 1), fd_flags >> 1 & 3
    else:
        channel, code, size, number, fd_flags, sent, more = _FD_64.unpack_from(body, head_size)
        end = more if head_size + _FD_64.size <= more <= len(body) else len(body)
        data = body[head_size + _FD_64.size : end]
        remote, is_fd, speed = fd_flags & 0x10, bool(fd_flags & 0x1000), fd_flags >> 13 & 3
    if size > FD_LENGTHS[-1]:
        raise _DamagedError(f"a frame of {size} bytes")
    of_kind = FrameKind.REMOTE if remote else FrameKind.FD if is_fd else FrameKind.DATA
    # Bytes that count and are not in the object are zero, as Vector's library reads them.
    data = b"" if remote else data[:size].ljust(size, b"\0")
    bus, value, extended = str(channel), number & _MASK, bool(number & _EXTENDED)
    code = min(code, 15)
    return BusFrame(now_ns, bus, value, extended, of_kind, data, code, bool(sent), speed)


class Mf4Log(FrameSource):
    """Frames of an MF4 file; BusLogError if it can't be read to its end or holds no frames.

    What the library says of damaged blocks, which it leaves out, is in the notes.
    """

    def __iter__(self) -> Iterator[BusFrame]:
        if find_spec("asammdf") is None:  # The reader would not name the package.
            raise ModuleNotFoundError("asammdf is not installed", name="asammdf")
        self._path.open("rb").close()  # This error has the system's words.
        try:
            for found in apart(mf4_parts, str(self._path)):
                if isinstance(found, str):
                    self.notes.append(f"{self._path.name} is damaged, and this left out: {found}")
                    break
                for frame in found:
                    self._count += 1
                    yield frame
        except ValueError as error:
            raise BusLogError(
                f"{self._path}: can't be read as MF4 after frame {self._count}: {error}"
            ) from error
        if not self._count:
            raise BusLogError(f"{self._path}: no frames of a bus in it")


def mf4_parts(path: str) -> Iterator[list[BusFrame] | str]:
    """Yield the frames of an MF4 file by parts, then what the library says first of damage."""
    import can.io.mf4

    said = _Said()
    log = logging.getLogger("asammdf")
    log.handlers, log.propagate = [said], False
    # It was imported without asammdf (`utank_hil.canbus.python_can`).
    module = reload(can.io.mf4)

    class Reader(module.MF4Reader):  # type: ignore[misc, name-defined]
        """The library's own opens the file twice and leaves it open, or takes it whole."""

        def __init__(self, content: BinaryIO) -> None:
            self._mdf = module.MDF(content)
            self._start_timestamp = self._mdf.header.start_time.timestamp()

    part = []
    try:
        with open(path, "rb") as content:
            for message in Reader(content):
                part.append(of_message(message, str(message.channel)))
                if len(part) == _PART:
                    yield part
                    part = []
    finally:  # Frames before a damaged block count.
        yield part
    if said.first:
        yield f"{said.first:.200}"


class _Said(logging.Handler):
    """Keeps the first line of what a library says first."""

    first = ""

    def emit(self, record: logging.LogRecord) -> None:
        """Take a record."""
        self.first = self.first or record.getMessage().partition("\n")[0]
