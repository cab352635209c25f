"""Numba's compiler with its cache, where there is a folder for that."""

from collections.abc import Callable
from typing import Any, TypeVar

import numba

F = TypeVar("F", bound=Callable[..., Any])


def njit(**options: Any) -> Callable[[F], F]:
    """Decorate as `numba.njit`; what is compiled is kept for the next process.

    Beside the source, in the user's cache, or in ``NUMBA_CACHE_DIR``. An installation that is not
    to be written and a user without a home have none of them: every process compiles then.
    """

    def decorate(function: F) -> F:
        try:
            compiled: F = numba.njit(cache=True, **options)(function)
        except RuntimeError:  # no folder for the cache
            compiled = numba.njit(**options)(function)
        return compiled

    return decorate
