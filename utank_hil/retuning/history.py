"""History of commands and outputs, as the law received them."""

import numpy as np

from utank_hil.base.arrays import FloatArray


class SampleHistory:
    """The latest `capacity` rows (command, outputs...), oldest first.

    The buffer has twice the capacity and is compacted every `capacity` samples, so that the latest
    rows are always contiguous.
    """

    def __init__(self, capacity: int, outputs: int) -> None:
        self.capacity = capacity
        self.outputs = outputs
        self._rows = np.zeros((2 * capacity, 1 + outputs))
        self._fresh = np.zeros(2 * capacity, dtype=np.bool_)
        self._end = 0
        self.count = 0  #: Number of samples taken so far.

    def add(self, command_pa: float, y: FloatArray, *, fresh: bool) -> None:
        """Append a sample.

        `command_pa` is the mean command since the previous sample; `y`, shape (m,), are the
        outputs, held values if nothing was measured; `fresh` says whether they are a new
        measurement.
        """
        if self._end == len(self._rows):
            kept = self.capacity - 1
            self._rows[:kept] = self._rows[self._end - kept :]
            self._fresh[:kept] = self._fresh[self._end - kept :]
            self._end = kept
        row = self._rows[self._end]
        row[0] = command_pa
        row[1:] = y
        self._fresh[self._end] = fresh
        self._end += 1
        self.count += 1

    def latest(self, samples: int) -> FloatArray:
        """Return at most `samples` latest rows as a view, valid until the next `add`."""
        return self._rows[max(0, self._end - min(samples, self.capacity)) : self._end]

    def record(self, samples: int) -> FloatArray:
        """Return a copy of at most `samples` latest rows, with gaps as NaN."""
        rows = self.latest(samples).copy()
        rows[~self._fresh[self._end - len(rows) : self._end], 1:] = np.nan
        return rows
