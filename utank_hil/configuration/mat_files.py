"""Files of MATLAB up to version 7."""

import zlib
from pathlib import Path
from typing import Any, Final

from utank_hil.base.apart import apart

_LIMIT_BYTES: Final = 1 << 26  #: Unpacked; a law of a hundred states has some 200 kB.
_COMPRESSED: Final = 15  #: Type of a compressed element.


def read_mat(path: Path, **options: Any) -> dict[str, Any]:
    """Read the variables of a file, with options of `scipy.io.loadmat`.

    ValueError is raised for a damaged file, and one that unpacks to more than `_LIMIT_BYTES`;
    OSError if it can't be opened.
    """
    try:
        _refuse_greater(path)
    except zlib.error as error:
        raise ValueError(str(error)) from error
    from scipy.io import loadmat  # Few configurations need this import.

    (content,) = apart(loadmat, str(path), appendmat=False, **options)
    return dict(content)


def _refuse_greater(path: Path) -> None:
    with path.open("rb") as file:
        order: Any = "big" if file.read(128)[126:] == b"MI" else "little"
        left = _LIMIT_BYTES
        while len(tag := file.read(8)) == 8:
            size = int.from_bytes(tag[4:], order)
            if int.from_bytes(tag[:4], order) == _COMPRESSED:
                left -= len(zlib.decompressobj().decompress(file.read(size), left + 1))
            else:
                file.seek(size, 1)
            if left < 0:
                raise ValueError(
                    f"it unpacks to more than {_LIMIT_BYTES} bytes, the most that is read"
                )
