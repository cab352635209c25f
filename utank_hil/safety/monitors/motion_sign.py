"""Whether roll or roll rate has the wrong sign: a sequential test.

With the roll's move M and its turn T by the integrated rate, both since a step began, a wrong sign
of one of them is M = -T. It is found against a roll that does not move, M = 0, and with that
against health, M = T. The samples of a step add their log-likelihood ratio, -cov(T, M + T / 2) over
the variance of a sample, and the sum is kept above zero (CUSUM; Page, Continuous Inspection
Schemes, Biometrika 41, 1954). The covariance is summed over the step's samples: where the roll
truly began is not known, so their mean is taken off.
"""

import math
from typing import Final

from utank_hil.safety.monitors.noise import within
from utank_hil.safety.monitors.thresholds import MonitorThresholds

SCATTER_S: Final = 2.0
"""Memory of the noise: a shorter one knows it less well."""
BURST_S: Final = 0.15
BURST: Final = 1.5
"""So many times as much in a shorter one is noise that has just begun."""
SHORTEST_S: Final = 0.14
LONGEST_S: Final = 0.6
"""A step lasts until a wrong sign would add all that one step may, and so long at least and at
most: in a longer one a sensor's noise is a smaller share.
"""
MOST: Final = 8.0
"""Log-likelihood ratio from which a sign is wrong. To a sound sensor's sum, noise n of the roll, of
the standard deviation s, adds n^2 / 6 s^2 in a step at most.
"""
JUMP_NOISES: Final = 1.5
"""A move of so many times the noise of a second difference is no jump."""
STEP: Final = 5.0
"""One step adds so much at most: one jump is no wrong sign."""
LEAST: Final = 2.0
"""A longest step in which a wrong sign would add less than that is left out: it tells of the rate's
noise, not of a roll.
"""


class SignTest:
    """Compares the signs of roll and integrated rate.

    Attributes
    ----------
    sum : float
        Log-likelihood ratio of a wrong sign.
    """

    def __init__(self, thresholds: MonitorThresholds) -> None:
        self._jump_rad = thresholds.drift_rad
        # of a second difference, with the noise that the maker states, a fifth of the limit
        self._least_scatter = 6 * (thresholds.roll_noise_rad / 5) ** 2
        self._scatter = self._burst = self._least_scatter
        self.restart()

    def restart(self) -> None:
        """Begin anew after a gap, with the noise that is known."""
        self.sum = 0.0
        self._last_rad = math.nan
        self._begin_step()

    def _begin_step(self) -> None:
        self._moved_rad = self._turned_rad = self._elapsed_s = 0.0
        self._points = 1  # where it begins
        self._moved_sum = self._turned_sum = self._squares = self._products = 0.0

    def update(
        self, moved_rad: float, turned_rad: float, elapsed_s: float, *, judged: bool
    ) -> bool:
        """Take what the roll moved and the rate turned; return whether a sign is wrong.

        A step that ends while nothing is `judged` is left out.
        """
        # a jump is no wrong sign, and adds little to the noise; noise that is cut would walk
        scatter = max(self._scatter, self._burst)
        jump_rad = max(self._jump_rad, JUMP_NOISES * math.sqrt(scatter))
        moved_rad = within(moved_rad, abs(turned_rad) + jump_rad)
        bend_rad = moved_rad - self._last_rad
        self._last_rad = moved_rad
        if bend_rad == bend_rad:
            square = bend_rad * bend_rad
            self._scatter += (square - self._scatter) * min(elapsed_s / SCATTER_S, 1.0)
            self._burst += (square - self._burst) * min(elapsed_s / BURST_S, 1.0)
        moved_rad += self._moved_rad
        turned_rad += self._turned_rad
        self._moved_rad, self._turned_rad = moved_rad, turned_rad
        self._points += 1
        self._moved_sum += moved_rad
        self._turned_sum += turned_rad
        self._squares += turned_rad * turned_rad
        self._products += turned_rad * moved_rad
        self._elapsed_s += elapsed_s
        if self._elapsed_s >= SHORTEST_S:
            self._judge(judged=judged)
        return self.sum > MOST

    def _judge(self, *, judged: bool) -> None:
        """Take a step that says enough to the sum, and begin the next."""
        power = max(self._scatter, self._burst / BURST, self._least_scatter) / 6
        evidence = (self._squares - self._turned_sum**2 / self._points) / (2 * power)
        if evidence < STEP and self._elapsed_s < LONGEST_S:
            return
        if judged and evidence >= LEAST:
            shared = self._products - self._turned_sum * self._moved_sum / self._points
            against = -shared / power - evidence
            self.sum = min(max(self.sum + min(against, STEP), 0.0), 2 * MOST)
        self._begin_step()
