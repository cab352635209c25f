"""Spikes: how often samples had to be discarded."""

from typing import Final


class SpikeCount:
    """Leaky count of discarded samples: it falls by one each second; five in one are too many."""

    MOST: Final = 4.0

    def __init__(self) -> None:
        self._level = 0.0
        self._seen = 0
        self.found = False

    def update(self, discarded: int, elapsed_s: float) -> bool:
        """Take the number discarded so far; return whether there were too many."""
        new = discarded - self._seen
        self._seen = discarded
        # forgotten two seconds after the last
        self._level = min(max(self._level - elapsed_s, 0.0) + new, self.MOST + 2.0)
        self.found = self._level > self.MOST
        return self.found
