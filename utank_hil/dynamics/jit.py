"""Numba's compiler with its cache, if a folder is available."""

import fcntl
from collections.abc import Callable
from contextlib import suppress
from functools import cache
from hashlib import sha256
from pathlib import Path
from threading import Event
from typing import IO, Any, Final, TypeVar

import numba
from numba.core.caching import NullCache
from numba.core.compiler_lock import global_compiler_lock

from utank_hil.base import elementary

F = TypeVar("F", bound=Callable[..., Any])
SOURCES: Final = [Path(elementary.__file__), *sorted(Path(__file__).parent.rglob("*.py"))]
"""Files of what a kernel may call, beside the kernels in its own folder."""
MOST_WAITS: Final = 1200  #: For another process, 50 ms each; the plant's kernel takes 16 s.
_turn: list[IO[bytes]] = []  # The locked file while a kernel is compiled.


def njit(**options: Any) -> Callable[[F], F]:
    """Decorate as `numba.njit` and cache the compiled code for the next process.

    The cache is beside the source, in the user's cache folder, or in ``NUMBA_CACHE_DIR``. With a
    read-only installation and a user without a home, or where what it holds can't be read, there is
    none, and every process compiles. Of processes that need a kernel at once, one compiles and the
    others wait for it.
    """

    def decorate(function: F) -> F:
        try:
            compiled: F = numba.njit(cache=True, **options)(function)
        except RuntimeError:  # There is no folder for the cache.
            compiled = numba.njit(**options)(function)
        index = getattr(getattr(compiled, "_cache", None), "_cache_file", None)
        if index is not None:  # numba itself looks at the kernel's own file alone
            index._source_stamp = _digest(Path(function.__code__.co_filename))
            _compile_in_turn(compiled)
        return compiled

    return decorate


def _compile_in_turn(compiled: Any) -> None:
    load_and_compile = compiled.compile

    def load_or_compile(signature: Any) -> Any:
        try:
            return load_and_compile(signature)
        except PermissionError:  # The cache is another user's, who shares it with nobody.
            compiled._cache = NullCache()
            return load_and_compile(signature)

    def in_turn(signature: Any) -> Any:
        with global_compiler_lock:
            if _turn:  # of a kernel that calls this one
                return load_or_compile(signature)
            with open(__file__, "rb") as file:
                _turn.append(file)
                try:
                    _await_lock(file)
                    return load_or_compile(signature)
                finally:
                    _turn.clear()
                    with suppress(OSError):
                        fcntl.flock(file, fcntl.LOCK_UN)  # A forked process has the file, too.

    compiled.compile = in_turn


def _await_lock(file: IO[bytes]) -> None:
    """Lock a file, or end without: whoever may read it may lock it, and must stop no start."""
    for _ in range(MOST_WAITS):
        try:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            Event().wait(0.05)
        except OSError:  # A file system without locks: each compiles.
            return
        else:
            return


@cache
def _digest(file: Path) -> str:
    """Digest of what a file's kernels may call. Its own time would differ from mount to mount."""
    beside = [file, *sorted(file.parent.glob("*kernel*.py"))]
    return sha256(b"\0".join(each.read_bytes() for each in (*SOURCES, *beside))).hexdigest()
