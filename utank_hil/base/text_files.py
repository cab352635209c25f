"""Files of other programs: one convention for gzip, encodings, line ends, sizes and damaged ends.

Text is UTF-8 with or without a byte order mark, or UTF-16 with one; lines end with LF, CR LF or CR.
"""

import csv
import gzip
import io
import math
import re
import zlib
from array import array
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from datetime import UTC, datetime
from difflib import get_close_matches
from itertools import chain, islice
from pathlib import Path
from typing import Any, BinaryIO, Final, TextIO

import numpy as np

from utank_hil.base.arrays import FloatArray

_GZIP: Final = b"\x1f\x8b"
_UTF_16: Final = (b"\xff\xfe", b"\xfe\xff")
LIMIT_BYTES: Final = 1 << 30
"""Largest content that is read whole."""
VALUES_LIMIT: Final = 40_000_000
"""Most values of a table that are held, 320 MB: a day at 10 Hz with 46 columns."""
_MOST_NAMES: Final = 1000  #: Of a folder that are compared with one that is not there.
LINE_LIMIT: Final = 1 << 16
"""Longest line of a log in characters; that of a CAN FD frame has some 300."""


class TextFileError(ValueError):
    """The file can't be read; the message names it, the cause and the remedy."""


def kind_of(path: Path) -> str:
    """Return the suffix in small letters, the one before it where that is ``.gz``."""
    return Path(path.stem if path.suffix.lower() == ".gz" else path.name).suffix.lower()


def refuse_device(path: Path) -> None:
    """Raise TextFileError for a folder, and a pipe, socket or device, which may never end."""
    if path.is_dir():
        raise TextFileError(f"{path}: is a folder; name a file in it")
    if path.exists() and not path.is_file():
        raise TextFileError(f"{path}: is no regular file but a pipe, socket or device")


def where_instead(path: Path) -> str:
    """Say where what is not at a path may be: under a name like it, or that its folder lacks."""
    folder = path.parent
    if not folder.is_dir():
        return f"there is no folder {folder}"
    with suppress(OSError):  # a folder that must not be read names nothing
        others = sorted(
            islice(folder.iterdir(), _MOST_NAMES), key=lambda each: each.suffix == path.suffix
        )
        by_stem = {each.stem: each for each in others}  # of one stem that of the same kind
        if near := get_close_matches(path.stem, by_stem, n=1):
            return f"did you mean {by_stem[near[0]]}?"
    return f"it is not in {folder.absolute()}: name it with its folder"


def unread(error: OSError) -> str:
    """Say that a data file of a configuration can't be read, and where its name is looked up."""
    missing = isinstance(error, FileNotFoundError)
    remedy = "; a path begins beside the file that names it" if missing else ""
    return f"{error.filename} can't be read: {error.strerror}{remedy}"


@contextmanager
def open_content(
    path: Path, limit_bytes: int = LIMIT_BYTES, on_cut: Callable[[str], None] | None = None
) -> Iterator[BinaryIO]:
    """Open a file, decompressed if it is compressed with gzip, whatever its name.

    `on_cut` is called with the place where compressed content is cut or damaged, at which reading
    ends; without it that is a TextFileError, as is larger content.
    """
    refuse_device(path)
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
        begin = content.peek(512)  # type: ignore[attr-defined]  # of a BufferedReader
        encoding = "utf-16" if begin[:2] in _UTF_16 else "utf-8-sig"
        try:
            yield io.TextIOWrapper(content, encoding, errors)
        except UnicodeError as error:
            other = " but a recording, picture or archive: name a text file"
            what = other if b"\0" in begin else ": save it as that"
            raise TextFileError(f"{path}: is no text in UTF-8{what}") from error


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


NUMBER: Final = re.compile(r"[-+]?(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eE][-+]?[0-9]+)?")
"""A decimal number as any program writes it; no infinity, no underscores, no other digits."""
_NO_DATE_S: Final = 1e7
"""Seconds below which a number beside dates is none: no measurement is of the year 1970."""
_MISSING: Final = ("", "nan")  # Fields, in small letters, that stand for no value.
_TIME: Final = "time"  # Beginning, in small letters, of the names of columns that may hold dates.


def read_number_table(path: Path) -> dict[str, FloatArray]:
    """Return the columns of a table by their names; a field without a value is NaN.

    A column of times may hold dates by ISO 8601, in UTC unless they name another zone; it becomes
    ``time_s``, in seconds from its first row. TextFileError has the line, the cause and the remedy.
    """
    with open_text(path) as text:
        content = (line for _, line in lines_of(path, text))
        first = next(content, "")
        lines = csv.reader(chain([first], content), delimiter=max(",;\t", key=first.count))
        try:
            names = [name.strip() for name in next(lines, [])]
            _check_names(path, names)
            values = array("d")
            dates: set[int] = set()
            for row in filter(None, lines):
                dates |= _append_row(path, names, row, lines.line_num, values)
                if len(values) > VALUES_LIMIT:
                    raise more_values(path)
        except csv.Error as error:
            raise TextFileError(f"{path}: line {lines.line_num} is no row: {error}") from error
    if not values:
        raise TextFileError(f"{path}: has a line of names and no rows")
    table = np.frombuffer(values).reshape(-1, len(names))
    return dict(_named(path, names, table, dates))


def more_values(path: object) -> TextFileError:
    """Return the error of a table with more than `VALUES_LIMIT` values."""
    return TextFileError(
        f"{path}: has more than {VALUES_LIMIT} values, the most of a table that are held: take a "
        "part, or fewer columns"
    )


def since_first(path: Path, name: str, seconds: FloatArray) -> tuple[str, FloatArray]:
    """Return a column of dates as ``time_s``, from its first row on, which needs one."""
    if math.isnan(seconds[0]):
        raise TextFileError(f"{path}: {name} has no date in its first row: fill it in")
    return "time_s", seconds - seconds[0]


def is_time(name: str) -> bool:
    """Return whether a column of this name may hold dates."""
    return name.lower().startswith(_TIME)


def _named(
    path: Path, names: list[str], table: FloatArray, dates: set[int]
) -> Iterator[tuple[str, FloatArray]]:
    for index, name in enumerate(names):
        column = table[:, index]
        if index in dates:
            if (np.abs(column) < _NO_DATE_S).any():
                raise TextFileError(f"{path}: {name} holds dates and numbers: use one of them")
            yield since_first(path, name, column)
        elif name:
            yield name, column


def _check_names(path: Path, names: list[str]) -> None:
    if not any(names):
        raise TextFileError(f"{path}: line 1 must name the columns, such as time_s,roll_deg")
    for name in filter(None, names):
        if names.count(name) > 1:
            raise TextFileError(f"{path}: line 1 names {name!r} twice: rename one")
        if NUMBER.fullmatch(name):
            raise TextFileError(
                f"{path}: line 1 holds the number {name[:60]}: it must name the columns, such as "
                "time_s,roll_deg"
            )


def _append_row(path: Path, names: list[str], row: list[str], line: int, values: Any) -> set[int]:
    if len(row) != len(names):
        raise TextFileError(f"{path}: line {line} has {len(row)} fields, line 1 names {len(names)}")
    dated = set()
    for index, (name, field) in enumerate(zip(names, row, strict=True)):
        word = field.strip()
        number = math.nan
        if NUMBER.fullmatch(word):
            number = float(word)
            if math.isinf(number):
                raise TextFileError(f"{path}: line {line}, {name}: {word[:60]} is too large")
        elif word.lower() not in _MISSING:
            date = _date_s(word) if is_time(name) else None
            if date is None:
                comma = "; write decimals with a point" if "," in word else ""
                raise TextFileError(
                    f"{path}: line {line}, {name}: {field[:60]!r} is no number{comma}"
                )
            number = date
            dated.add(index)
        if not name and word:
            raise TextFileError(f"{path}: line 1 has no name for column {index + 1}: name it")
        values.append(number)
    return dated


def _date_s(word: str) -> float | None:
    """Return the seconds from 1970 to a date and time; None for another word."""
    try:
        date = datetime.fromisoformat(word)
    except ValueError:
        return None
    return (date if date.tzinfo else date.replace(tzinfo=UTC)).timestamp()
