"""Spikes: a sample that nothing on board can have moved to since the last one is discarded."""

from typing import Final

STEP_SAMPLES: Final = 5
"""So many in a row are no spike but a step, which is taken."""


class SpikeGate:
    """Passes the samples of a signal that are near enough to the last one that passed.

    Parameters
    ----------
    spike : float
        Distance from the last sample, noise included, that is always near enough.
    most_per_s : float
        So much more for each second since then.

    Attributes
    ----------
    discarded : int
        Samples so far that did not pass.
    """

    def __init__(self, spike: float, most_per_s: float) -> None:
        self._spike = spike
        self._most_per_ns = most_per_s * 1e-9
        self._value = 0.0
        self._value_ns = -(1 << 62)
        self._in_a_row = 0
        self.discarded = 0

    def passes(self, value: float, now_ns: int) -> bool:
        """Take a sample; return whether it may be used."""
        moved = value - self._value
        near = self._spike + self._most_per_ns * (now_ns - self._value_ns)
        if -near <= moved <= near or self._in_a_row == STEP_SAMPLES - 1:
            self._value = value
            self._value_ns = now_ns
            self._in_a_row = 0
            return True
        self._in_a_row += 1
        self.discarded += 1
        return False


class SpikeCount:
    """Leaky count of what the gates discarded: one a second is forgotten, five are too many.

    Attributes
    ----------
    found : bool
    """

    MOST: Final = 5.0

    def __init__(self) -> None:
        self._level = 0.0
        self._seen = 0
        self.found = False

    def update(self, discarded: int, elapsed_s: float) -> bool:
        """Take the number discarded so far; return whether there were too many."""
        new = discarded - self._seen
        self._seen = discarded
        # what was five stays so for a second
        self._level = min(max(self._level - elapsed_s, 0.0) + new, self.MOST + 1.0)
        self.found = self._level >= self.MOST
        return self.found
