"""Telemetry kept in memory, for runs whose length is known."""

import numpy as np

from utank_hil.arrays import FloatArray


class Table:
    """Every n-th row of a run, in memory.

    Parameters
    ----------
    width : int
        Columns of a row.
    rows : int
        Rows offered over the whole run; the table holds ``ceil(rows / every)`` of them.
    every : int
        Keep the first of so many rows.
    """

    def __init__(self, width: int, rows: int, every: int = 1) -> None:
        self._kept = np.empty((-(-rows // every), width))
        self._every = every
        self._offered = 0

    def write(self, row: FloatArray) -> None:
        """Take one row, shape (width,); copied."""
        index, rest = divmod(self._offered, self._every)
        if rest == 0 and index < len(self._kept):
            self._kept[index] = row
        self._offered += 1

    @property
    def rows(self) -> FloatArray:
        """What was kept so far, shape (n, width)."""
        return self._kept[: min(len(self._kept), -(-self._offered // self._every))]
