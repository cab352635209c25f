"""Noise of a signal: the power of what can't be its motion."""

import math
from typing import Final

NOISE_S: Final = 0.7
MOST: Final = 2.0
"""A residual counts as so many limits at most: one jump is no noise."""


def within(value: float, most: float) -> float:
    """The value, cut to +-most; a fifth of the time of `min` and `max`."""
    return -most if value < -most else most if value > most else value


class Noise:
    """Power of a residual, averaged over 0.7 s, against a limit on its standard deviation."""

    def __init__(self, limit: float) -> None:
        self._limit_power = limit * limit
        self._most = MOST * limit
        self.power = 0.0  #: Averaged square of the residual.
        self.found = False

    @property
    def share(self) -> float:
        """Noise over the limit."""
        return math.sqrt(self.power / self._limit_power)

    def update(self, residual: float, elapsed_s: float) -> bool:
        """Take a residual; return whether there is too much noise."""
        residual = within(residual, self._most)
        self.power += (residual * residual - self.power) * min(elapsed_s / NOISE_S, 1.0)
        self.found = self.power > self._limit_power
        return self.found


class SecondDifference:
    """What three samples in a row leave of a signal that is smooth.

    White noise of deviation s leaves sqrt(6) s.
    """

    def __init__(self) -> None:
        self.restart()

    def restart(self) -> None:
        """Begin anew after a gap."""
        self._last = self._before = math.nan
        self._step_s = 0.0

    def update(self, value: float) -> float:
        """Take the next sample; return the second difference, zero as long as there is none."""
        difference = value - 2 * self._last + self._before
        self._before, self._last = self._last, value
        return difference if difference == difference else 0.0

    def update_after(self, value: float, step_s: float) -> float:
        """The same of samples that are not equally far apart: `step_s` since the last one.

        What is left of the line through the last two; scaled so that white noise leaves as much.
        """
        ratio = step_s / self._step_s if self._step_s else math.nan
        bend = value - self._last - ratio * (self._last - self._before)
        self._before, self._last, self._step_s = self._last, value, step_s
        if bend != bend:
            return 0.0
        return bend * math.sqrt(6.0 / (1.0 + (1.0 + ratio) * (1.0 + ratio) + ratio * ratio))
