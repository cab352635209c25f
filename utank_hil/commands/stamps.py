"""Files named by the time, so that none is overwritten."""

from datetime import UTC, datetime
from itertools import count
from pathlib import Path


def claimed_files(folder: Path, *names: str) -> tuple[Path, ...]:
    """Files named by the time (UTC), numbered where that is taken; the first is made, and empty.

    Parameters
    ----------
    folder : Path
    *names : str
        With `{}` in the time's place.

    Raises
    ------
    OSError
        If the first can't be made.
    """
    now = stamp = f"{datetime.now(UTC):%Y%m%dT%H%M%SZ}"
    for number in count(2):
        files = tuple(folder / name.format(stamp) for name in names)
        if not any(file.exists() for file in files):
            try:
                files[0].touch(exist_ok=False)
            except FileExistsError:  # another program's, this very moment
                pass
            else:
                break
        stamp = f"{now}-{number}"
    return files
