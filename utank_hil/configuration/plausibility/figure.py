"""A figure of a vessel with its plausible range."""

import math
from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Figure:
    """A figure of a vessel; `low` and `high` say problem and remedy of a value out of range."""

    key: str  #: Key that is most likely wrong if the figure lies outside.
    value: float
    refused_below: float = 0.0
    warned_below: float = 0.0
    low: str = ""
    warned_above: float = math.inf
    refused_above: float = math.inf
    high: str = ""

    @property
    def words(self) -> str:
        """Problem and remedy in words."""
        words = self.low if self.value < self.warned_below else self.high
        return words or "gives a figure that overflows"  # The value is not a number.

    @property
    def refused(self) -> bool:
        """Whether the value is impossible."""
        return not self.refused_below <= self.value <= self.refused_above

    @property
    def warned(self) -> bool:
        """Whether the value is possible, but unusual."""
        return not self.refused and not self.warned_below <= self.value <= self.warned_above
