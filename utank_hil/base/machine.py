"""The machine that a result comes from, as far as its digits may depend on it."""

import ctypes
import os
import platform
from functools import cache
from pathlib import Path
from typing import Any, Final

import numpy as np

_CORE_NAMES: Final = tuple(
    f"{prefix}openblas_get_corename{suffix}" for prefix in ("scipy_", "") for suffix in ("64_", "")
)


@cache
def machine() -> dict[str, Any]:
    """Platform, processor, and the kernels that libraries chose for it, ready for `json.dumps`."""
    found: Any = np.show_config(mode="dicts")
    return {
        "platform": platform.platform(),
        "python": platform.python_version(),
        "cpus": os.cpu_count(),
        "processor": _processor(),
        "numpy": " ".join(found["SIMD Extensions"].get("found", [])) or "baseline",
        "blas": f"{found['Build Dependencies']['blas']['name']} {_blas_core()}".strip(),
        "libm": " ".join(platform.libc_ver()).strip() or "unknown",
    }


def kernels(of: dict[str, Any]) -> str:
    """Processor and kernels of a `machine` in words; empty if it does not say them."""
    if "processor" not in of:
        return ""
    return f"{of['processor']}, numpy {of['numpy']}, {of['blas']}, libm {of['libm']}"


def _processor() -> str:
    lines = _lines("/proc/cpuinfo")
    names = [line.partition(":")[2].strip() for line in lines if line.startswith("model name")]
    return names[0] if names else platform.processor() or platform.machine()


def _blas_core() -> str:
    """Kind of processor whose kernels OpenBLAS runs; empty for another library."""
    for path in {line.split()[-1] for line in _lines("/proc/self/maps") if "openblas" in line}:
        library = ctypes.CDLL(path)
        for name in _CORE_NAMES:
            if hasattr(library, name):
                core_name = getattr(library, name)
                core_name.restype = ctypes.c_char_p
                return str(core_name().decode())
    return ""


def _lines(path: str) -> list[str]:
    """Lines of a file that only Linux has."""
    file = Path(path)
    return file.read_text().splitlines() if file.exists() else []
