"""How long a file of a recording may be, and how many stay; imports no Rerun."""

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
    files = (file.with_suffix(suffix) for suffix in SUFFIXES)
    return sum(path.stat().st_size for path in files if path.exists())


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
    alike: dict[str, list[Path]] = {}
    for suffix in SUFFIXES:
        for path in file.parent.glob(f"{file.stem.partition('-')[0]}-*{suffix}"):
            if path.stem != file.stem:
                alike.setdefault(path.stem, []).append(path)
    found = [([path.stat() for path in paths], paths) for paths in alike.values()]
    own, _ = whole_of(file)  # newer than all others, even by a clock that was set back
    found.sort(
        key=lambda each: (
            whole_of(each[1][0])[0].stem == own.stem,
            max(status.st_mtime_ns for status in each[0]),
            each[1][0].stem,
        )
    )
    left = sum(status.st_size for statuses, _ in found for status in statuses)
    removed = []
    for statuses, paths in found:
        if left <= keep_bytes:
            break
        for path in paths:
            path.unlink(missing_ok=True)
        left -= sum(status.st_size for status in statuses)
        removed += paths
    return removed
