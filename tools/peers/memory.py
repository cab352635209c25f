"""How much more memory a task takes at its height, whoever allocates it."""

import ctypes
import gc
from collections.abc import Callable
from pathlib import Path

_STATUS, _CLEAR = Path("/proc/self/status"), Path("/proc/self/clear_refs")
_RESET_PEAK = "5"


def peak_mb(task: Callable[[], object]) -> float:
    """Growth of the resident memory at its peak, in MB. Linux with glibc only."""
    gc.collect()
    ctypes.CDLL(None).malloc_trim(0)  # what was freed before would be taken again unseen
    _CLEAR.write_text(_RESET_PEAK)
    before = _resident_mb("VmRSS")
    task()
    return max(0.0, _resident_mb("VmHWM") - before)


def _resident_mb(name: str) -> float:
    for line in _STATUS.read_text().splitlines():
        if line.startswith(name + ":"):
            return int(line.split()[1]) * 1024 / 1e6
    raise OSError(f"{_STATUS} has no line {name}: it is made by Linux")
