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

from utank_hil.base.tick import TICK_S
from utank_hil.canbus.measurements import MotionSample
from utank_hil.safety.monitors.finding import Finding
from utank_hil.safety.monitors.noise import Noise, SecondDifference, within
from utank_hil.safety.monitors.thresholds import NOISE_LIMIT, MonitorThresholds

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


class RollAgainstRate:
    """Compares roll and integrated rate: `unexplained_rad` is the leaky sum of what is left."""

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
        found = Finding.NOISE if noisy else 0
        if abs(summed_rad) <= limit_rad:
            if abs(summed_rad) < 0.5 * limit_rad:
                self._over_s = 0.0
            if self._trial_s > 0.0:
                self._trial_s -= elapsed_s
                found |= Finding.DRIFT | Finding.DRIFT_LASTS
            return found
        self._over_s += elapsed_s
        found |= Finding.DRIFT
        if self._trial_s > 0.0:
            self._trial_s = TRIAL_S
            found |= Finding.DRIFT_LASTS
        if self._over_s > DRIFT_LASTS_S or abs(self._smooth_rad) > LARGE_DRIFT * limit_rad:
            found |= Finding.DRIFT_LASTS
        return found

    def _forget(self) -> None:
        """Learn the bias as at the start; what was found so far stays so until that succeeds."""
        self._bias_rad_s = self.unexplained_rad = self._smooth_rad = self._beyond_s = 0.0
        self._learned_s = FIRST_BIAS_S
        self._trial_s = TRIAL_S


MOUNTED_RAD: Final = math.radians(0.5)
"""So far two sensors may be mounted apart."""
NOISES: Final = 3.0
APART_S: Final = 0.3
"""A spike is gone by then; a wrong sign passes through zero for a shorter time with each roll."""


class MotionPair:
    """Whether two motion sensors agree, by the low-passed differences of roll and rate.

    Two can't tell which of them is wrong, and a ship that rolls by a wrong sensor is worse off than
    a passive one: where they disagree the pressure falls to zero. While one is silent the other is
    used, and nothing is compared. `period_s` is the time between two updates.
    """

    def __init__(self, thresholds: MonitorThresholds, period_s: float) -> None:
        fastest_rad_s = 2 * 2 * math.pi / thresholds.tank_period_s
        noises = NOISES / NOISE_LIMIT
        self._roll_limit_rad = MOUNTED_RAD + noises * thresholds.roll_noise_rad
        self._rate_limit_rad_s = fastest_rad_s * MOUNTED_RAD + noises * thresholds.rate_noise_rad_s
        self._period_s = period_s
        self._share = period_s / SMOOTH_S
        self._roll_rad = self._rate_rad_s = self._over_s = 0.0

    def update(self, apart_rad: float, rate_apart_rad_s: float) -> int:
        """Take roll and rate of one less those of the other, NaN where one is silent."""
        if apart_rad != apart_rad:
            self._over_s = 0.0
            return 0
        self._roll_rad += self._share * (apart_rad - self._roll_rad)
        self._rate_rad_s += self._share * (rate_apart_rad_s - self._rate_rad_s)
        over = (
            abs(self._roll_rad) > self._roll_limit_rad
            or abs(self._rate_rad_s) > self._rate_limit_rad_s
        )
        self._over_s = self._over_s + self._period_s if over else 0.0
        return Finding.SENSORS_DISAGREE if self._over_s >= APART_S else 0


class SpikeCount:
    """Leaky count of discarded samples: it falls by one each second; five in one are too many."""

    MOST: Final = 4.0

    def __init__(self) -> None:
        self._level = 0.0
        self._seen = 0
        self.found = False

    def update(self, discarded: int, elapsed_s: float) -> bool:
        """Take the number discarded so far; return whether there were too many."""
        new = discarded - self._seen
        self._seen = discarded
        # forgotten two seconds after the last
        self._level = min(max(self._level - elapsed_s, 0.0) + new, self.MOST + 2.0)
        self.found = self._level > self.MOST
        return self.found


DEAD_PERIODS: Final = 0.2
DEAD_S: Final = 1.0
"""So much of T, and so long at least, a live sensor does not repeat itself: noise changes its last
digit, and without any a roll of five digits at w0 stays within one at a crest for 0.2 T. A gateway
repeats for less than a second."""
SLOW_CYCLE_S: Final = 0.02
"""Of a slower sensor not every look finds a new sample, nor two looks the same number of them."""


class MotionWatch:
    """The monitors of one motion sensor, of which a sample comes every `cycle_s`."""

    def __init__(self, thresholds: MonitorThresholds, cycle_s: float = TICK_S) -> None:
        self._half_s = 0.5 * cycle_s
        self._slow = cycle_s > SLOW_CYCLE_S  # pragma: no mutate: just that serves as either
        self._bent_ns = 0  # pragma: no mutate: long ago
        self.motion = RollAgainstRate(thresholds)
        self.rate_noise = Noise(math.sqrt(6) * thresholds.rate_noise_rad_s)
        self._rate_bend = SecondDifference()
        self._spikes = SpikeCount()
        # pragma: no mutate start: of the first sample nothing is told, and it is heard later
        self._last_roll_rad = self._last_rate_rad_s = 0.0
        self._heard_ns = 0
        # pragma: no mutate end
        self._dead_s = max(DEAD_PERIODS * thresholds.tank_period_s, DEAD_S)
        self._repeated_s = 0.0
        self._waited_s = self._turned_rad = 0.0
        self.found = 0  #: Bits of `Finding`.

    def turn(self, sample: MotionSample, elapsed_s: float) -> None:
        """Integrate the rate up to the newest sample, once a tick.

        Each rate counts for the time from the sample before it: where some were lost, the roll is
        as old.
        """
        self._waited_s += elapsed_s
        if sample.heard_ns != self._heard_ns:
            self._heard_ns = sample.heard_ns
            self._turned_rad += sample.roll_rate_rad_s * self._waited_s
            self._waited_s = 0.0

    def update(
        self, sample: MotionSample, elapsed_s: float, *, stale: bool, water_moves: bool = False
    ) -> None:
        """Take a sample, and set `found`; one that is `stale` begins anew.

        Roll and rate that repeat themselves to the last digit count while the water moves: one
        that is coarse may do so at a quay.
        """
        roll_rad, rate_rad_s = sample.roll_rad, sample.roll_rate_rad_s
        if stale or roll_rad != self._last_roll_rad or rate_rad_s != self._last_rate_rad_s:
            self._repeated_s = 0.0
        elif water_moves:
            self._repeated_s += elapsed_s
        # half a cycle of the ends makes a trapezoid of the sum, where no sample was lost
        turned_rad = self._turned_rad - self._half_s * (rate_rad_s - self._last_rate_rad_s)
        self._turned_rad = 0.0
        self._last_roll_rad, self._last_rate_rad_s = roll_rad, rate_rad_s
        if stale:
            self.motion.restart()
            self._rate_bend.restart()
            self.found = 0
            return
        found = self._look(sample, turned_rad, elapsed_s)
        # the largest samples of noise are discarded, too
        if self._spikes.update(sample.discarded, elapsed_s) and not found & Finding.NOISE:
            found |= Finding.SPIKES
        self.found = found | Finding.ROLL_STUCK if self._repeated_s > self._dead_s else found

    def _look(self, sample: MotionSample, turned_rad: float, elapsed_s: float) -> int:
        """Roll against rate, and the noise of both; of a slow sensor each sample counts once."""
        if not self._slow:
            found = self.motion.update(sample.roll_rad, turned_rad, elapsed_s)
            bend = self._rate_bend.update(sample.roll_rate_rad_s)
        else:
            since_s = (sample.heard_ns - self._bent_ns) * 1e-9
            if since_s <= 0:
                return self.found & ~Finding.SPIKES
            self._bent_ns = sample.heard_ns
            elapsed_s = since_s
            found = self.motion.update(sample.roll_rad, turned_rad, since_s, even=False)
            bend = self._rate_bend.update_after(sample.roll_rate_rad_s, since_s)
        return found | Finding.NOISE if self.rate_noise.update(bend, elapsed_s) else found
