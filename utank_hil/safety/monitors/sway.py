"""The sway of a ship in waves, which no sensor measures: what it may do to the water.

The centre of gravity is accelerated by c g times the slope of the waves, c from 0 to the share that
the ship has at most, and 1 in long waves. The moment that rolls the ship is r times stiffness times
slope with an effective wave slope r below 1, so that k = c / r of `SlopePush` is what sway takes.

k is a constant of the hull, nearly, and in phase. Of three hulls (Wigley hull and FPSO by panels,
supply vessel by strip theory; beam sea, damping ratios of 0.03 to 0.1) it is 1.1 to 1.6 around roll
resonance, 1 in long waves, as ship and water then move alike.
"""

import math
from typing import Final

from utank_hil.dynamics.linear import coupled_matrices
from utank_hil.dynamics.ship import MOST_SWAY, RollShip
from utank_hil.dynamics.tank import GRAVITY_M_S2, Tank
from utank_hil.safety.monitors.noise import DerivativeFilter, within

LEAST_SLOPE: Final = 0.5
"""Least effective wave slope of a ship that rolls: the weather criterion's (2008 IS Code, part A,
2.3) is 0.73 + 0.6 OG/d, 0.55 where the centre of gravity is lowest, 0.3 draughts below water."""
SPREAD: Final = 0.15
"""Of the largest share: so much of `SlopePush`, 0.3, may be left by a k that is not constant. The
three hulls leave 0.10 to 0.21, root mean square, from 0.75 to 1.25 of the frequency of roll."""
SPREAD_OF_SHARE: Final = 0.1
"""The same of the share that fits best. Chosen, see `tank_equation.BAND`."""
MEAN_PERIODS: Final = 3.0
"""Of the tank, in the mean that is taken off: it shifts a wave of twice the period by 6 degrees."""


def most_sway(ship: RollShip) -> float:
    """Return the largest share of `SlopePush` that the ship may have."""
    share = MOST_SWAY if ship.sway_of_slope is None else ship.sway_of_slope
    return share / LEAST_SLOPE


class SlopePush:
    """Push on the water by a ship that sways with the waves, from the moment that rolls it."""

    def __init__(self, ship: RollShip, tank: Tank, period_s: float) -> None:
        scale = GRAVITY_M_S2 * tank.width_m / ship.stiffness_nm_rad
        mass, damping, stiffness = (scale * each[0] for each in coupled_matrices(ship, tank))
        self._mass, self._coupling = mass.tolist()
        self._damping, self._quadratic = float(damping[0]), scale * ship.quadratic_damping_nms2_rad2
        self._stiffness, self._weight = stiffness.tolist()
        self._mean_share = period_s * tank.natural_frequency_rad_s / (2 * math.pi * MEAN_PERIODS)
        self.restart()

    def restart(self) -> None:
        """Begin anew after a gap."""
        self._roll_mean = self._level_mean = 0.0

    def update(
        self, roll: DerivativeFilter, roll_rad_s2: float, level_m: float, level_m_s2: float
    ) -> tuple[float, float]:
        """Return the push of a sway of g times the slope: what the roll and the level tell of it.

        Either is less its mean, since a steady heel is no wave.
        """
        rate_rad_s = roll.rate
        of_roll = self._mass * roll_rad_s2 + self._stiffness * roll.value
        of_roll += (self._damping + self._quadratic * abs(rate_rad_s)) * rate_rad_s
        of_level = self._coupling * level_m_s2 + self._weight * level_m
        self._roll_mean += self._mean_share * (of_roll - self._roll_mean)
        self._level_mean += self._mean_share * (of_level - self._level_mean)
        return of_roll - self._roll_mean, of_level - self._level_mean


class Misfit:
    """Squares of e + k u - z, with the share k of sway and the zero z that leave the least of them.

    e is what a case does not explain of the water's motion, u what a sway of g times the slope
    takes from the water in that case. The sums fade: `u` is that of u, `uu` of its squares. `share`
    is the last one found.
    """

    __slots__ = ("_e", "_ee", "_eu", "share", "u", "uu", "weight")

    def __init__(self) -> None:
        self._e = self._ee = self._eu = self.share = self.u = self.uu = self.weight = 0.0

    def add(self, e: float, u: float, keep: float) -> None:
        """Fade by `keep`, then add a sample."""
        self._e = keep * self._e + e
        self.u = keep * self.u + u
        self._ee = keep * self._ee + e * e
        self._eu = keep * self._eu + e * u
        self.uu = keep * self.uu + u * u
        self.weight = keep * self.weight + 1.0

    def least(self, most_share: float, most_zero: float) -> float:
        """Return the least sum for a share from 0 to `most_share` and a zero up to `most_zero`."""
        e, u, eu, uu, weight = self._e, self.u, self._eu, self.uu, self.weight
        # pragma: no mutate start: u has no mean, so that they hardly depend on one another
        share = zero = 0.0
        for _ in range(2):
            # pragma: no mutate end
            zero = within((e + share * u) / weight, most_zero)
            if uu > 0.0:
                share = min(max((zero * u - eu) / uu, 0.0), most_share)
        self.share = share
        of_share = share * (2.0 * eu + share * uu)
        of_zero = zero * (weight * zero - 2.0 * (e + share * u))
        return max(self._ee + of_share + of_zero, 0.0)
