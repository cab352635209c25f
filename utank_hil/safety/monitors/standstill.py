"""Standstill: a level gauge that had noise sends one level to the last bit.

A node that hangs with its counter going on, or that repeats its last measurement, does so. Noise of
three steps of the message leaves fourteen levels in a row the same once in 10^14 times, and
ten of both gauges less often. A gauge without noise may stand still: where the water does, or at a
turning point. Noise is told from the water's motion by the line through the last two levels: this
finding needs no other evidence, as that of `Repetition` does.
"""

import math
from typing import Final

STILL_LEVELS: Final = 10
"""So many in a row are the same as the one before them: of both gauges."""
STILL_ALONE: Final = 14
"""And of one."""
JERK_M: Final = 1.5e-3
"""Off the line by more than a step of the message: what the water does in 20 ms is less."""
NOISY_SHARE: Final = 0.7
"""So many of the levels before were off it."""
MEMORY: Final = 0.01
"""Share of the newest level in that share."""
_LEFT_OF_IT: Final = NOISY_SHARE * (1 - MEMORY) ** STILL_LEVELS


class Standstill:
    """The levels of one gauge.

    Attributes
    ----------
    still : int
        How many levels in a row were the same; zero for less than `STILL_LEVELS`, and where those
        before them had no noise.
    """

    def __init__(self) -> None:
        self._level_m = math.nan
        self._step_m = self._noisy = 0.0
        self._same = self.still = 0

    def take(self, level_m: float) -> None:
        """Take the next level."""
        step_m = level_m - self._level_m
        self._noisy -= MEMORY * self._noisy
        if abs(step_m - self._step_m) > JERK_M:
            self._noisy += MEMORY
        self._level_m, self._step_m = level_m, step_m
        if step_m:
            self._same = self.still = 0
            return
        self._same += 1
        if self.still or (self._same == STILL_LEVELS and self._noisy > _LEFT_OF_IT):
            self.still = self._same


def gauges_stand_still(port: int, starboard: int) -> bool:
    """Whether both gauges do, by `Standstill.still`, or one for so long that it is no chance."""
    return (port > 0 and starboard > 0) or port >= STILL_ALONE or starboard >= STILL_ALONE
