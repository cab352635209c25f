"""Files named by the time, so that none is overwritten."""

from datetime import UTC, datetime
from itertools import count
from pathlib import Path


def claimed_files(folder: Path, *names: str, stamp: str | None = None) -> tuple[Path, ...]:
    """Files named by the time (UTC), numbered where that is taken; all are made, and empty.

    `names` have `{}` in the time's place. `stamp` is in the place of the present time, for files
    that belong to others. Raises `OSError` if one can't be made.
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
