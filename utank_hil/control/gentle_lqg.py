"""A linear law that can do with less pressure: gains of the same estimate at a higher cost of it.

A part of a law's command is no optimum for less pressure. Its phase is that of the full command, so
in seas beside the roll period a small part rolls the ship more, not less: the first ship's clipped
law, loaded to 0.85 times its roll period in waves of 8 s, rolls it 0.66 times the passive roll with
all of its command and 1.25 times with a tenth. With the pressure's cost divided by the square of a
share the gain is the best one for about that share of the pressure, and the roll hardly exceeds the
passive one with any (1.02 times over loads of 0.85 to 1.3 and waves of 6 to 14 s, without limits).
"""

from typing import Final

import numpy as np

from utank_hil.base.arrays import FloatArray
from utank_hil.base.ordered_sums import product
from utank_hil.control.lqg import LQGController, LQGLaw

SHARES: Final = (1.0, 0.5, 0.25, 0.12, 0.05)
"""Shares for which there are gains, by factors of about two; between two of them the gain is
interpolated."""


class GentleController(LQGController):
    """Stepping of an `LQGLaw` of one command, with a gain for each share of the pressure.

    `gains`, shape (len(SHARES) - 1, n), are those for the shares below one.
    """

    def __init__(self, law: LQGLaw, gains: FloatArray) -> None:
        super().__init__(law)
        ahead = self._advance[: law.gain.shape[1]]
        self._rows = -product(np.vstack([law.gain, gains]), ahead)

    def use(self, share: float) -> None:
        """Take the gain for a share, at least the last of `SHARES` and at most 1."""
        share = min(max(share, SHARES[-1]), SHARES[0])
        lower = 1
        while share < SHARES[lower]:
            lower += 1
        upper = lower - 1
        part = (SHARES[upper] - share) / (SHARES[upper] - SHARES[lower])
        self._advance[-1] = (1.0 - part) * self._rows[upper] + part * self._rows[lower]
