"""Monitor of whether the ship still matches the ship that a law was designed for.

The estimated ship (`MotionEstimate`) is compared with the law's, independently of the sea. A
difference counts, in either direction, if it exceeds three standard deviations and the previous
estimate was of the same ship.
"""

import math
from typing import Final

from utank_hil.base.elementary import exp, log
from utank_hil.canbus import Verdict
from utank_hil.retuning.estimate import MotionEstimate, ShipFigures

SIGNIFICANT: Final = 3.0  #: Number of standard deviations from which a difference is significant.


class ChangeMonitor:
    """Monitor that compares the present ship with the ship that a law was designed for."""

    def __init__(self, ship: ShipFigures) -> None:
        self._ship = ship
        self._latest: ShipFigures | None = None
        #: Ratio (1 or more) of the roll periods or of the square roots of the stiffnesses,
        #: whichever is larger; 1 while no difference is significant.
        self.change = 1.0

    def watch(self, estimate: MotionEstimate) -> None:
        """Take a new estimate; OUTDATED clears the change, one without a good ship leaves it."""
        now, before = estimate.ship, self._latest
        if estimate.of_ship is Verdict.OUTDATED:
            self._latest, self.change = None, 1.0
        if estimate.of_ship is not Verdict.GOOD or now is None:
            return
        self._latest = now
        if before is not None and ship_factor(now, before) == 1:
            self.change = ship_factor(now, self._ship)

    def restart(self) -> None:
        """Take the latest ship as the law's own."""
        self._ship = self._latest or self._ship
        self.change = 1.0


def ship_factor(now: ShipFigures, then: ShipFigures) -> float:
    """Factor, 1 or more, by which two ships differ; 1 if that is not significant."""
    by_period = _significant(
        now.roll_period_s / then.roll_period_s,
        _together(now.period_deviation, then.period_deviation),
    )
    by_stiffness = _significant(
        math.sqrt(now.stiffness_nm_rad / then.stiffness_nm_rad),
        _together(now.stiffness_deviation, then.stiffness_deviation) / 2,
    )
    return max(by_period, by_stiffness)


def _together(a: float, b: float) -> float:
    return math.sqrt(a * a + b * b)


def _significant(ratio: float, deviation: float) -> float:
    """Return the ratio as a factor of 1 or more; 1 if it is within the deviations."""
    change = abs(log(ratio))
    return exp(change) if change > SIGNIFICANT * deviation else 1.0
