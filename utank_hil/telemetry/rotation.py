"""Rotation of the files of a recording: their length, and how many are kept.

A long one has parts: `run-x.frames`, `run-x-part002.frames`, ...
"""

import os
import stat
import time
from collections.abc import Iterable, Iterator
from contextlib import suppress
from os import stat_result
from pathlib import Path
from typing import Final

_EARLIER: Final = ".rrd"  #: Ending of the recordings of 0.2.0, which count too.
_GROWTH: Final = 1.05  #: Growth of a file over the one before: compression differs.


def make_room(file: Path, number: int, keep_bytes: int) -> None:
    """Remove the oldest recordings before part `number` of the recording `file` begins.

    The others and one as long as the last part then fit into the folder.
    """
    if number == 1:
        _put_before(file, time.time_ns())
    before = [] if number == 1 else [part_of(file, number - 1)]
    last_bytes = sum(status.st_size for _, status in _found(before))
    remove_oldest(part_of(file, number), keep_bytes - round(_GROWTH * last_bytes))


def part_of(file: Path, number: int) -> Path:
    """Return the name of a numbered part of a recording; the first has the recording's own."""
    return file if number == 1 else file.with_stem(f"{file.stem}-part{number:03d}")


def whole_of(file: Path) -> tuple[Path, int]:
    """Return the first part of a recording, and the number of the given part."""
    stem, mark, number = file.stem.rpartition("-part")
    return (file.with_stem(stem), int(number)) if mark and number.isdecimal() else (file, 1)


def _found(paths: Iterable[Path]) -> Iterator[tuple[Path, stat_result]]:
    """Return files and their status, no links; another process may remove some meanwhile."""
    for path in paths:
        with suppress(FileNotFoundError):
            status = path.lstat()
            if stat.S_ISREG(status.st_mode):
                yield path, status


def _alike(file: Path) -> Iterator[tuple[Path, stat_result]]:
    """Return other files of names like that of `file` up to the first hyphen, and their status."""
    names = f"{file.stem.partition('-')[0]}-*"
    for suffix in {file.suffix, _EARLIER}:
        for path, status in _found(file.parent.glob(names + suffix)):
            if path.stem != file.stem:
                yield path, status


def _put_before(file: Path, now_ns: int) -> None:
    """Give recordings whose time is still to come, as the clock was set back, times before now.

    So they stay in the order of their runs, before this one.
    """
    ages = sorted((status.st_mtime_ns, path) for path, status in _alike(file))
    late = [path for time_ns, path in ages if time_ns >= now_ns]
    for before, path in enumerate(reversed(late), 1):
        with suppress(FileNotFoundError, PermissionError):
            os.utime(path, ns=(now_ns - before, now_ns - before))


def remove_oldest(file: Path, keep_bytes: int) -> list[Path]:
    """Remove the oldest recordings of a folder until its size is within a limit; return them.

    Only names like that of `file` up to the first hyphen count. It stays, as what another user
    owns; other parts of it go last.
    """
    alike = dict(_alike(file))
    own, _ = whole_of(file)  # It is newer than all others, even by a clock that was set back.

    def age(path: Path) -> tuple[bool, int, str]:
        return whole_of(path)[0].stem == own.stem, alike[path].st_mtime_ns, path.stem

    left = sum(status.st_size for status in alike.values())
    removed: list[Path] = []
    for path in sorted(alike, key=age):
        if left <= keep_bytes:
            break
        with suppress(PermissionError):  # Of another user.
            path.unlink(missing_ok=True)
            left -= alike[path].st_size
            removed.append(path)
    return removed
