"""Roll against its integrated rate: a drift, a signal that stands still, one sign that is wrong.

Over a step the roll moves by m, and the integrated rate says that it turned by t. What is left,
m - t, is summed with a leak of 15 s, so that a sensor's noise stays small in it. A gyroscope's
constant bias is learned over five minutes and taken off. A slow drift is learned for a while, too:
a sensor that is replaced, or right again, would not be believed for what was learned of it before.
So a bias that explains nothing for a minute is forgotten, and learned as at the start. The drift
goes on being found until the two have agreed for half a minute.
"""

import math
from typing import Final

from utank_hil.safety.monitors.finding import Finding
from utank_hil.safety.monitors.noise import Noise, SecondDifference, within
from utank_hil.safety.monitors.thresholds import MonitorThresholds

LEAK_S: Final = 15.0
BIAS_S: Final = 300.0
FIRST_BIAS_S: Final = 30.0
"""The bias is zero at the start as if it had been learned for so long."""
SMOOTH_S: Final = 0.25
LEARN: Final = 3.0
"""Up to so many times the threshold what is left is taken for a bias."""
LARGE_DRIFT: Final = 4.0
"""So many times the threshold: no longer a drift to live with."""
DRIFT_LASTS_S: Final = 30.0
MOST_DRIFT: Final = 6.0
"""The sum is kept within so many thresholds: a fault that has gone is forgotten in time."""
FORGET_S: Final = 60.0
"""Beyond `LEARN` thresholds for so long: by now what was learned may be what is wrong."""
TRIAL_S: Final = 30.0
"""So long the two agree, from no bias on, before a sensor whose bias was forgotten is right."""

_DRIFT: Final = int(Finding.DRIFT)
_DRIFT_LASTS: Final = int(Finding.DRIFT_LASTS)
_NOISE: Final = int(Finding.NOISE)


class RollAgainstRate:
    """Compares the roll with its integrated rate.

    `unexplained_rad` is the leaky sum of the roll's moves that the rate does not account for.
    """

    def __init__(self, thresholds: MonitorThresholds) -> None:
        self._limit_rad = thresholds.drift_rad
        #: Of the roll, by its second difference.
        self.noise = Noise(math.sqrt(6) * thresholds.roll_noise_rad)
        self._bend = SecondDifference()
        self._bias_rad_s = 0.0
        self._learned_s = FIRST_BIAS_S
        self._beyond_s = self._trial_s = 0.0
        self.restart()

    def restart(self) -> None:
        """Begin anew after a gap, with the bias that was learned."""
        self._roll_rad = math.nan
        self._bend.restart()
        self.unexplained_rad = 0.0
        self._over_s = self._smooth_rad = 0.0

    def update(
        self, roll_rad: float, turned_rad: float, elapsed_s: float, *, even: bool = True
    ) -> int:
        """Take a sample; return what was found.

        `turned_rad` is the integral of the rate since the last sample, `elapsed_s` ago; `even` says
        whether that time is the same each time.
        """
        moved_rad = roll_rad - self._roll_rad
        self._roll_rad = roll_rad
        if moved_rad != moved_rad:  # the first sample
            return 0
        limit_rad = self._limit_rad
        turned_rad += self._bias_rad_s * elapsed_s
        left_rad = moved_rad - turned_rad
        bend = self._bend
        left = bend.update(roll_rad) if even else bend.update_after(roll_rad, elapsed_s)
        noisy = self.noise.update(left, elapsed_s)
        slow_rad = within(left_rad, limit_rad)  # a jump is no bias
        if abs(self.unexplained_rad) < LEARN * limit_rad:  # a fault is no bias
            self._learned_s = min(self._learned_s + elapsed_s, BIAS_S)
            self._bias_rad_s += slow_rad / self._learned_s
            self._beyond_s = 0.0
        else:
            self._beyond_s += elapsed_s
            if self._beyond_s > FORGET_S:
                self._forget()
        keep = max(1 - elapsed_s / LEAK_S, 0.0)  # a late tick may span more than that
        summed_rad = within(keep * (self.unexplained_rad + left_rad), MOST_DRIFT * limit_rad)
        self.unexplained_rad = summed_rad
        self._smooth_rad += (summed_rad - self._smooth_rad) * min(elapsed_s / SMOOTH_S, 1.0)
        found = _NOISE if noisy else 0
        if abs(summed_rad) <= limit_rad:
            if abs(summed_rad) < 0.5 * limit_rad:
                self._over_s = 0.0
            if self._trial_s > 0.0:
                self._trial_s -= elapsed_s
                found |= _DRIFT | _DRIFT_LASTS
            return found
        self._over_s += elapsed_s
        found |= _DRIFT
        if self._trial_s > 0.0:
            self._trial_s = TRIAL_S
            found |= _DRIFT_LASTS
        if self._over_s > DRIFT_LASTS_S or abs(self._smooth_rad) > LARGE_DRIFT * limit_rad:
            found |= _DRIFT_LASTS
        return found

    def _forget(self) -> None:
        """Learn the bias as at the start; what was found so far stays so until that succeeds."""
        self._bias_rad_s = self.unexplained_rad = self._smooth_rad = self._beyond_s = 0.0
        self._learned_s = FIRST_BIAS_S
        self._trial_s = TRIAL_S
