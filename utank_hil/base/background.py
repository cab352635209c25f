"""Processes beside the loop: they give way to it and compute in one thread each."""

import os
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Final

_SCORE: Final = Path("/proc/self/oom_score_adj")
_FIRST_TO_GO: Final = 500  #: Score of 1000 of the kernel: well before the controller, which has 0.
_THREADS: Final = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")


def give_way(niceness: int) -> None:
    """Have this process, and those it starts, run after the loop and be killed before it.

    Where memory is short the kernel kills the process with the highest score.
    """
    os.nice(niceness)
    with suppress(OSError):  # a score that is higher already may not be lowered; there is no /proc
        _SCORE.write_text(str(_FIRST_TO_GO), encoding="ascii")


@contextmanager
def one_thread_each() -> Iterator[None]:
    """Processes started meanwhile keep their linear algebra to one thread: more hinder the loop."""
    before = {name: os.environ.get(name) for name in _THREADS}
    os.environ.update(dict.fromkeys(_THREADS, "1"))
    try:
        yield
    finally:
        for name, value in before.items():
            if value is None:
                del os.environ[name]
            else:
                os.environ[name] = value
