"""Files of other programs: one convention for gzip, encodings, line ends, sizes and damaged ends.

Text is UTF-8 with or without a byte order mark, or UTF-16 with one; lines end with LF, CR LF or CR.
"""

import gzip
import io
import zlib
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import BinaryIO, Final, TextIO

_GZIP: Final = b"\x1f\x8b"
_UTF_16: Final = (b"\xff\xfe", b"\xfe\xff")
LIMIT_BYTES: Final = 1 << 30
"""Largest content that is read whole: a table of a day at 10 Hz with a hundred columns."""
LINE_LIMIT: Final = 1 << 16
"""Longest line of a log in characters; that of a CAN FD frame has some 300."""


class TextFileError(ValueError):
    """The file can't be read; the message names it, the cause and the remedy."""


def kind_of(path: Path) -> str:
    """Return the suffix in small letters, the one before it where that is ``.gz``."""
    return Path(path.stem if path.suffix.lower() == ".gz" else path.name).suffix.lower()


@contextmanager
def open_content(
    path: Path, limit_bytes: int = LIMIT_BYTES, on_cut: Callable[[str], None] | None = None
) -> Iterator[BinaryIO]:
    """Open a file, decompressed if it is compressed with gzip, whatever its name.

    `on_cut` is called with the place where compressed content is cut or damaged, at which reading
    ends; without it that is a TextFileError, as is larger content.
    """
    with path.open("rb") as file:
        compressed = file.peek(2)[:2] == _GZIP
        yield io.BufferedReader(_Content(file, path, limit_bytes, on_cut, compressed))


@contextmanager
def open_text(
    path: Path,
    limit_bytes: int = LIMIT_BYTES,
    on_cut: Callable[[str], None] | None = None,
    errors: str = "strict",
) -> Iterator[TextIO]:
    """Open a text as `open_content` does; a line that is read ends with a line feed.

    Bytes that are no text are a TextFileError, or replaced (`errors`, as of `open`).
    """
    with open_content(path, limit_bytes, on_cut) as content:
        begin = content.peek(2)[:2]  # type: ignore[attr-defined]  # of a BufferedReader
        encoding = "utf-16" if begin in _UTF_16 else "utf-8-sig"
        try:
            yield io.TextIOWrapper(content, encoding, errors)
        except UnicodeError as error:
            raise TextFileError(f"{path}: is no text in UTF-8: save it as that") from error


def lines_of(path: Path, text: TextIO) -> Iterator[tuple[int, str]]:
    """Yield number, from 1, and content of each line; TextFileError for one beyond `LINE_LIMIT`."""
    for number, line in enumerate(iter(lambda: text.readline(LINE_LIMIT), ""), start=1):
        yield number, line
        if len(line) == LINE_LIMIT:
            raise TextFileError(
                f"{path}: line {number} has more than {LINE_LIMIT} characters: is it a text?"
            )


class _Content(io.RawIOBase):
    def __init__(
        self,
        file: BinaryIO,
        path: Path,
        limit_bytes: int,
        on_cut: Callable[[str], None] | None,
        compressed: bool,
    ) -> None:
        self._file, self._path, self._left, self._on_cut = file, path, limit_bytes, on_cut
        self._limit_bytes, self._ended = limit_bytes, False
        self._archive = gzip.GzipFile(fileobj=file, mode="rb") if compressed else None

    def readable(self) -> bool:
        return True

    def readinto(self, buffer: bytearray | memoryview) -> int:  # type: ignore[override]
        """Read up to a buffer's size; 0 is the end."""
        size = len(buffer)
        archive = self._archive
        content = self._file.read(size) if archive is None else self._decompressed(archive, size)
        self._left -= len(content)
        if self._left < 0:
            raise TextFileError(
                f"{self._path}: holds more than {self._limit_bytes} bytes, the most that is read "
                "of it: cut it in parts"
            )
        buffer[: len(content)] = content
        return len(content)

    def _decompressed(self, archive: gzip.GzipFile, size: int) -> bytes:
        """Return the next bytes, of all members of the archive; empty at its end."""
        try:
            return b"" if self._ended else archive.read1(size)
        except EOFError:
            return self._cut("cut")
        except (zlib.error, gzip.BadGzipFile):
            return self._cut("damaged")

    def _cut(self, how: str) -> bytes:
        self._ended = True
        place = f"{self._path.name} is {how} near byte {self._file.tell()} of the compressed file"
        if self._on_cut is None:
            raise TextFileError(f"{self._path}: {place}")
        self._on_cut(place)
        return b""
