"""Telemetry log in memory, for runs of known length."""

import numpy as np

from utank_hil.arrays import FloatArray


class MemoryLog:
    """Keeps every n-th row of a run in memory.

    Parameters
    ----------
    width : int
        Columns of a row.
    rows : int
        Rows written over the whole run; the log keeps ``ceil(rows / every)`` of them.
    every : int
        Decimation factor: one row of this many is kept, the first.
    """

    def __init__(self, width: int, rows: int, every: int = 1) -> None:
        self._kept = np.empty((-(-rows // every), width))
        self._every = every
        self._written = 0

    def write(self, row: FloatArray) -> None:
        """Append a copy of one row, shape (width,); later ones than `rows` are dropped."""
        index, rest = divmod(self._written, self._every)
        if rest == 0 and index < len(self._kept):
            self._kept[index] = row
        self._written += 1

    @property
    def rows(self) -> FloatArray:
        """The kept rows, shape (n, width)."""
        return self._kept[: min(len(self._kept), -(-self._written // self._every))]
