"""Files named by the time, so that none is overwritten."""

from datetime import UTC, datetime
from itertools import count
from pathlib import Path


def unused_stamp(folder: Path, *names: str) -> str:
    """The time (UTC) to name files by, numbered where it is taken.

    Parameters
    ----------
    folder : Path
    *names : str
        Of the files to come, with `{}` in the stamp's place.
    """
    now = stamp = f"{datetime.now(UTC):%Y%m%dT%H%M%SZ}"
    for number in count(2):
        if not any((folder / name.format(stamp)).exists() for name in names):
            break
        stamp = f"{now}-{number}"
    return stamp
