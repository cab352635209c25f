"""How long a file of a recording may be, and how many stay; imports no Rerun."""

import os
from collections.abc import Iterable, Iterator
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Final

_GROWTH: Final = 1.05  # compression differs from file to file
SUFFIXES: Final = (".rrd", ".frames")
"""Files of one recording, which come and go together."""


@dataclass(frozen=True, slots=True)
class Rotation:
    """When the next file begins, and what is removed for it.

    Attributes
    ----------
    part_s : float
        Length of a file.
    keep_bytes : int or None
        Before a file begins, the oldest recordings of its folder are removed until those that are
        left and another as long as the last fit in; None removes none.
    """

    part_s: float
    keep_bytes: int | None = None


def part_of(file: Path, number: int) -> Path:
    """Name of the part of a recording with a number; the first has the recording's own."""
    return file if number == 1 else file.with_stem(f"{file.stem}-part{number:03d}")


def whole_of(file: Path) -> tuple[Path, int]:
    """Return the first part of a recording, by the name of one, and the number of that one."""
    stem, mark, number = file.stem.rpartition("-part")
    return (file.with_stem(stem), int(number)) if mark and number.isdecimal() else (file, 1)


def make_room(file: Path, number: int, rotation: Rotation | None) -> None:
    """Remove the oldest recordings before a part of one begins, if its rotation says so.

    Parameters
    ----------
    file : Path
        Of the first part.
    number : int
        Of the part that begins.
    """
    if rotation is not None and rotation.keep_bytes is not None:
        room_bytes = 0 if number == 1 else round(_GROWTH * bytes_of(part_of(file, number - 1)))
        remove_oldest(part_of(file, number), rotation.keep_bytes - room_bytes)


def bytes_of(file: Path) -> int:
    """Size of a recording, all its files together."""
    return sum(status.st_size for _, status in _found(file.with_suffix(s) for s in SUFFIXES))


def _found(paths: Iterable[Path]) -> Iterator[tuple[Path, os.stat_result]]:
    """Files and what is known of them; whoever else clears the folder may be quicker."""
    for path in paths:
        with suppress(FileNotFoundError):
            yield path, path.stat()


def remove_oldest(file: Path, keep_bytes: int) -> list[Path]:
    """Remove the oldest recordings of a folder until the rest is no larger than some bytes.

    Parameters
    ----------
    file : Path
        A recording of the folder, there or to come, which stays; other parts of it go last. Others
        are those whose names begin alike, up to the first hyphen.

    Returns
    -------
    list of Path
        What was removed.
    """
    alike: dict[str, dict[Path, os.stat_result]] = {}
    for suffix in SUFFIXES:
        for path, status in _found(file.parent.glob(f"{file.stem.partition('-')[0]}-*{suffix}")):
            if path.stem != file.stem:
                alike.setdefault(path.stem, {})[path] = status
    own, _ = whole_of(file)  # newer than all others, even by a clock that was set back

    def age(stem: str) -> tuple[bool, int, str]:
        of_own_run = whole_of(file.with_stem(stem))[0].stem == own.stem
        return of_own_run, max(status.st_mtime_ns for status in alike[stem].values()), stem

    sizes = {
        stem: sum(status.st_size for status in files.values()) for stem, files in alike.items()
    }
    left = sum(sizes.values())
    removed: list[Path] = []
    for stem in sorted(alike, key=age):
        if left <= keep_bytes:
            break
        for path in alike[stem]:
            path.unlink(missing_ok=True)
        left -= sizes[stem]
        removed += alike[stem]
    return removed
