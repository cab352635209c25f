"""Share of the pressure that pays: predicted from what the pump has made of the roll so far.

The ship's roll is that of the passive twin plus the roll d that the pump made. With the share s of
the pressure it made d, so with another share it would make about d times that ratio: with gains for
less pressure (`control.gentle_lqg`) its phase is then about the same. The mean square
of the roll is least at the share ``-s mean(twin d) / mean(d d)``, with means about the mean values
and an exponential memory. A law that only rolls the ship more thus ends at `LEAST`, next to no
power, and comes back as soon as it helps. A ship that is not the twin's makes d wrong by as much as
its answer to the pump differs: in short waves, loaded to 1.3 times its roll period, it gets less
pressure than would pay.
"""

import math
from typing import Final

LEAST: Final = 0.05
"""Least share: the pump's effect is computed, so it needs no more to be known. With 0.25 a ship
loaded to 1.3 times its period rolled 1.10 times the passive roll in short waves, with 0.05 1.05."""
FIRST: Final = 0.5
"""Share before anything is known: a quarter of the power, three quarters of most of the gain."""
MEMORY_PERIODS: Final = 8.0
"""Roll periods in the means; five and eight gave the same roll in eleven seas."""
PACE: Final = 2.0  #: Speed of the share over that of the means.


class Effort:
    """The share, from the rolls of ship and twin; `samples` are those of a roll period."""

    def __init__(self, samples: float) -> None:
        self._part = 1.0 / (MEMORY_PERIODS * samples)
        self.clear()

    def clear(self) -> None:
        """Forget everything."""
        self.share = FIRST
        self._twin_rad = self._made_rad = self._together = self._made_square = 0.0

    def update(self, roll_rad: float, passive_roll_rad: float) -> None:
        """Take a sample; with an unknown passive roll the share goes to one."""
        best, part = 1.0, self._part
        if math.isfinite(roll_rad + passive_roll_rad):
            twin, made = passive_roll_rad - self._twin_rad, roll_rad - passive_roll_rad
            made -= self._made_rad
            self._twin_rad += part * twin
            self._made_rad += part * made
            self._together += part * (twin * made - self._together)
            self._made_square += part * (made * made - self._made_square)
            if self._made_square > 0.0:
                best = -self.share * self._together / self._made_square
        self.share += PACE * part * (min(max(best, LEAST), 1.0) - self.share)
