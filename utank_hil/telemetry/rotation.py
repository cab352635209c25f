"""How long a file of a recording may be, and how many stay; imports no Rerun."""

from dataclasses import dataclass
from pathlib import Path


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


def remove_oldest(file: Path, keep_bytes: int) -> list[Path]:
    """Remove the oldest recordings of a folder until the rest is no larger than some bytes.

    Parameters
    ----------
    file : Path
        A recording of the folder, there or to come, which stays. Others are those whose names begin
        alike, up to the first hyphen.
    keep_bytes : int

    Returns
    -------
    list of Path
        What was removed.
    """
    alike = file.parent.glob(f"{file.stem.partition('-')[0]}-*{file.suffix}")
    found = [(path.stat(), path) for path in alike if path != file]
    found.sort(key=lambda each: (each[0].st_mtime_ns, each[1].stem))
    left = sum(status.st_size for status, _ in found)
    removed = []
    for status, path in found:
        if left <= keep_bytes:
            break
        path.unlink(missing_ok=True)
        left -= status.st_size
        removed.append(path)
    return removed
