"""Numba's compiler with its cache, if a folder is available."""

from collections.abc import Callable
from functools import cache
from hashlib import sha256
from pathlib import Path
from typing import Any, Final, TypeVar

import numba

from utank_hil.base import elementary

F = TypeVar("F", bound=Callable[..., Any])
SOURCES: Final = [Path(elementary.__file__), *sorted(Path(__file__).parent.rglob("*.py"))]
"""Files of what a kernel may call, beside the kernels in its own folder."""


def njit(**options: Any) -> Callable[[F], F]:
    """Decorate as `numba.njit` and cache the compiled code for the next process.

    The cache is beside the source, in the user's cache folder, or in ``NUMBA_CACHE_DIR``. With a
    read-only installation and a user without a home there is none, and every process compiles.
    """

    def decorate(function: F) -> F:
        try:
            compiled: F = numba.njit(cache=True, **options)(function)
        except RuntimeError:  # There is no folder for the cache.
            compiled = numba.njit(**options)(function)
        index = getattr(getattr(compiled, "_cache", None), "_cache_file", None)
        if index is not None:  # numba itself looks at the kernel's own file alone
            index._source_stamp = _digest(Path(function.__code__.co_filename))
        return compiled

    return decorate


@cache
def _digest(file: Path) -> str:
    """Digest of what a file's kernels may call. Its own time would differ from mount to mount."""
    beside = [file, *sorted(file.parent.glob("*kernel*.py"))]
    return sha256(b"\0".join(each.read_bytes() for each in (*SOURCES, *beside))).hexdigest()
