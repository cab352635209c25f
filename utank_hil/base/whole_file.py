"""Files that are there whole or not at all, and files named by the time."""

import os
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from datetime import UTC, datetime
from io import FileIO
from itertools import count
from pathlib import Path


def write_whole(path: Path, content: bytes | str) -> None:
    """Write a file over `path`, a text in UTF-8; on a full disk no half of it is left."""
    with left_whole(path):
        path.write_bytes(content.encode() if isinstance(content, str) else content)


def append_whole(file: FileIO, content: bytes) -> None:
    """Append to an unbuffered file and sync it; without room OSError, and no part of it is left."""
    begin, left = file.seek(0, os.SEEK_END), memoryview(content)
    try:
        while left:  # A partial write is followed by one that gives the reason.
            left = left[file.write(left) :]
        os.fsync(file.fileno())
    except OSError:
        with suppress(OSError):
            file.truncate(begin)
        raise


@contextmanager
def left_whole(path: Path) -> Iterator[None]:
    """While a file is written: whatever ends that, no half is left; an `OSError` has its name."""
    with errors_name(path):
        try:
            yield
        except BaseException as error:
            if path.is_file() and not isinstance(error, PermissionError):
                path.unlink()
            raise


@contextmanager
def errors_name(path: Path) -> Iterator[None]:
    """Have an `OSError` say of which file it is: one of writing does not."""
    try:
        yield
    except OSError as error:
        reason = os.strerror(error.errno) if error.errno else str(error)
        raise OSError(error.errno, reason, str(path)) from error


def claimed_files(folder: Path, *names: str, stamp: str | None = None) -> tuple[Path, ...]:
    """Files named by the time (UTC), numbered where that is taken; all are made, and empty.

    `names` have `{}` in place of the time, or of `stamp`, that of files of others.
    """
    now = stamp = stamp or f"{datetime.now(UTC):%Y%m%dT%H%M%SZ}"
    for number in count(2):
        files = tuple(folder / name.format(stamp) for name in names)
        made: list[Path] = []
        try:
            for file in files:
                file.touch(exist_ok=False)  # a link that leads nowhere is taken, too
                made.append(file)
        except OSError as error:
            for file in made:
                file.unlink()
            if not isinstance(error, FileExistsError):
                raise
        else:
            break
        stamp = f"{now}-{number}"
    return files
