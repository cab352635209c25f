"""Numba's compiler with its cache, if a folder is available."""

from collections.abc import Callable
from typing import Any, TypeVar

import numba

F = TypeVar("F", bound=Callable[..., Any])


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
        return compiled

    return decorate
