"""Telemetry log in memory, for runs of known length."""

import numpy as np

from utank_hil.base.arrays import FloatArray


class MemoryLog:
    """Keeps up to `rows` rows of a run, of `width` columns each, in memory."""

    def __init__(self, width: int, rows: int) -> None:
        self._kept = np.empty((rows, width))
        self._written = 0

    def write(self, row: FloatArray) -> None:
        """Append a copy of one row, shape (width,); rows beyond the capacity are dropped."""
        if self._written < len(self._kept):
            self._kept[self._written] = row
            self._written += 1

    @property
    def rows(self) -> FloatArray:
        """The rows so far, shape (n, width)."""
        return self._kept[: self._written]
