"""A figure of a vessel and where it may lie."""

import math
from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Figure:
    """A figure of a vessel, and where it may lie.

    Parameters
    ----------
    key : str
        What is most likely wrong when it lies outside.
    low, high : str
        What is wrong with a value too low and too high, and the remedy.
    """

    key: str
    value: float
    refused_below: float = 0.0
    warned_below: float = 0.0
    low: str = ""
    warned_above: float = math.inf
    refused_above: float = math.inf
    high: str = ""

    @property
    def words(self) -> str:
        """What is wrong, and the remedy."""
        words = self.low if self.value < self.warned_below else self.high
        return words or "gives a figure that overflows"  # of what is not a number

    @property
    def refused(self) -> bool:
        """Whether it can't be."""
        return not self.refused_below <= self.value <= self.refused_above

    @property
    def warned(self) -> bool:
        """Whether it can be, but hardly is."""
        return not self.refused and not self.warned_below <= self.value <= self.warned_above
