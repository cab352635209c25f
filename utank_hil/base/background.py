"""Processes beside the loop: they give way to it, for the processor and for memory."""

import os
from contextlib import suppress
from pathlib import Path
from typing import Final

_SCORE: Final = Path("/proc/self/oom_score_adj")
_FIRST_TO_GO: Final = 500


def give_way(niceness: int) -> None:
    """Have this process, and those it starts, run after the loop and be killed before it.

    Where memory is short the kernel kills the process with the highest score, and the service gives
    all of its processes one that hardly any other has.
    """
    os.nice(niceness)
    with suppress(OSError):  # a score that is higher already may not be lowered; there is no /proc
        _SCORE.write_text(str(_FIRST_TO_GO), encoding="ascii")
