"""History of commands and outputs, as the law received them, and warm-up of a new law with it."""

from typing import Final

import numpy as np

from utank_hil.base.arrays import FloatArray
from utank_hil.retuning.law_bank import MonitoredLaw

WARM_UP_SAMPLES: Final = 1000
"""Past samples that a new law is stepped through: more than the memory of any law or washout."""
WARM_UP_CHUNK: Final = 50  #: Number of warm-up samples processed in one sample time.


class SampleHistory:
    """The latest `capacity` rows (command, outputs...), oldest first."""

    def __init__(self, capacity: int, outputs: int) -> None:
        self.capacity = capacity
        self.outputs = outputs
        self._rows = np.zeros((capacity, 1 + outputs))
        self._fresh = np.zeros(capacity, dtype=np.bool_)
        self.count = 0  #: Number of samples taken so far.

    def add(self, command_pa: float, y: FloatArray, *, fresh: bool) -> None:
        """Append a sample.

        `command_pa` is the mean command since the previous sample; `y`, shape (m,), are the
        outputs, held values if nothing was measured; `fresh` says whether they are a new
        measurement.
        """
        at = self.count % self.capacity
        row = self._rows[at]
        row[0] = command_pa
        row[1:] = y
        self._fresh[at] = fresh
        self.count += 1

    def latest(self, samples: int) -> FloatArray:
        """Return at most `samples` latest rows."""
        rows: FloatArray = self._rows[self._places(samples)]
        return rows

    def record(self, samples: int) -> FloatArray:
        """Return at most `samples` latest rows, with gaps as NaN."""
        places = self._places(samples)
        rows: FloatArray = self._rows[places]
        rows[~self._fresh[places], 1:] = np.nan
        return rows

    def _places(self, samples: int) -> np.ndarray:
        """Indices of the latest rows; taking them makes a copy."""
        first = self.count - min(samples, self.capacity, self.count)
        return np.arange(first, self.count) % self.capacity


class WarmUp:
    """Steps a new law through past samples, one chunk per sample time."""

    def __init__(self, law: MonitoredLaw, history: SampleHistory) -> None:
        self.law = law
        self._history = history
        self._stepped = max(0, history.count - WARM_UP_SAMPLES)

    @property
    def done(self) -> bool:
        """Whether the law has been stepped through all samples."""
        return self._stepped == self._history.count

    def advance(self) -> None:
        """Step the law through the next chunk."""
        controller, missing = self.law.controller, self._history.count - self._stepped
        rows = self._history.latest(missing)[:WARM_UP_CHUNK]
        for row in rows:
            controller.applied(row[:1])
            controller.step(row[1:])
        self._stepped += len(rows)
