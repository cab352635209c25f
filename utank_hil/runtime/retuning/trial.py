"""Is the new law better than the old one: roll and pressure before and after."""

import math
from typing import NamedTuple

import numpy as np


class Effort(NamedTuple):
    """Root mean square over some time."""

    roll_rad: float
    pressure_pa: float


class MovingEffort:
    """Root mean square of roll and pressure over the latest samples.

    Parameters
    ----------
    samples : int
        Length of the window.
    """

    def __init__(self, samples: int) -> None:
        self._squares = np.zeros((samples, 2))
        self.samples = 0

    def clear(self) -> None:
        """Begin anew."""
        self.samples = 0

    def add(self, roll_rad: float, pressure_pa: float) -> None:
        """Take a sample."""
        row = self._squares[self.samples % len(self._squares)]
        row[0] = roll_rad * roll_rad
        row[1] = pressure_pa * pressure_pa
        self.samples += 1

    @property
    def full(self) -> bool:
        """Whether the window is full."""
        return self.samples >= len(self._squares)

    @property
    def effort(self) -> Effort | None:
        """Over what is in the window; None if nothing is."""
        if self.samples == 0:
            return None
        means = self._squares[: min(self.samples, len(self._squares))].mean(axis=0)
        return Effort(math.sqrt(means[0]), math.sqrt(means[1]))


def worsening(
    before: Effort, after: Effort, roll_factor: float, effort_factor: float
) -> tuple[str, ...]:
    """What got worse by more than the factors, in words; empty if nothing did."""
    found = []
    if after.roll_rad > roll_factor * before.roll_rad:
        found.append(
            f"roll rose from {math.degrees(before.roll_rad):.2f} to "
            f"{math.degrees(after.roll_rad):.2f} degrees RMS on trial"
        )
    if after.pressure_pa > effort_factor * before.pressure_pa:
        found.append(
            f"pressure rose from {before.pressure_pa / 1e3:.1f} to "
            f"{after.pressure_pa / 1e3:.1f} kPa RMS on trial"
        )
    return tuple(found)
