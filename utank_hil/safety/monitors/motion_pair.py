"""Which of two motion sensors is used, and what is found of the pair.

They are compared by the low-passed differences of roll and rate. Which of the two is wrong says
each one's own evidence: its roll against its rate, its noise, spikes and repetition, and the tank's
equation with its roll. What once spoke against a sensor counts until both agree again.

    in use             the other          then
    silent             heard, none        the other is used, and half the pressure (the inbox)
    silent             evidence           as if the one in use were the only one
    evidence           none, and heard    the other is used, and half the pressure
    none               evidence           half the pressure
    none               none               where they disagree half the pressure, and after 1.5 roll
                                          periods, since nobody knows who is right, the end
    evidence           evidence           as if the one in use were the only one

While one is silent they are not compared, and what was known of each is kept.
"""

import math
from typing import Final

from utank_hil.safety.monitors.finding import Finding
from utank_hil.safety.monitors.motion_watch import MotionWatch
from utank_hil.safety.monitors.tank_equation import TankEquation
from utank_hil.safety.monitors.thresholds import MonitorThresholds

MOUNTED_RAD: Final = math.radians(0.5)
"""So far two sensors may be mounted apart."""
NOISES: Final = 3.0
SMOOTH_S: Final = 0.25
APART_S: Final = 0.3
"""A difference that lasts so long is one; it passes through zero with each roll."""
PAUSE_S: Final = 1.0
"""Evidence may pause for so long, and a difference takes some of it until it counts."""
UNCLEAR_PERIODS: Final = 1.5
"""In so many roll periods the evidence of the tank's equation is there."""

EVIDENCE: Final = int(
    Finding.MOTION_SIGN
    | Finding.ROLL_STUCK
    | Finding.RATE_STUCK
    | Finding.DRIFT
    | Finding.DRIFT_LASTS
    | Finding.NOISE
    | Finding.SPIKES
    | Finding.WATER_SIGN
    | Finding.MOTION_LATE
    | Finding.MOTION_REPEATS
)
_DISAGREE: Final = int(Finding.SENSORS_DISAGREE)
_UNCLEAR: Final = int(Finding.SENSORS_UNCLEAR)


class SensorEvidence:
    """What speaks against one motion sensor.

    Parameters
    ----------
    watch : MotionWatch
    equation : TankEquation
        Fed with this sensor's roll.

    Attributes
    ----------
    watch, equation
        As given.
    water : int
        What the equation found last, bits of `Finding`.
    accused : bool
        Whether anything has spoken against it since both agreed.
    """

    def __init__(self, watch: MotionWatch, equation: TankEquation) -> None:
        self.watch = watch
        self.equation = equation
        self.water = 0
        self.accused = False

    def restart_water(self) -> None:
        """Begin anew after a gap."""
        self.equation.restart()
        self.water = 0

    @property
    def found(self) -> int:
        """What speaks against it now."""
        return (self.watch.found | self.water) & EVIDENCE


class MotionPair:
    """The comparison of two motion sensors.

    Parameters
    ----------
    thresholds : MonitorThresholds
    period_s : float
        Time between two updates.

    Attributes
    ----------
    unclear : bool
        Whether they disagree, or did within the last roll period, and nothing says which is wrong.
    """

    def __init__(self, thresholds: MonitorThresholds, period_s: float) -> None:
        frequency_rad_s = 2 * math.pi / thresholds.tank_period_s
        # the thresholds of noise are five times the noise of a sample
        self._roll_limit_rad = MOUNTED_RAD + NOISES / 5 * thresholds.roll_noise_rad
        self._rate_limit_rad_s = (
            2 * frequency_rad_s * MOUNTED_RAD + NOISES / 5 * thresholds.rate_noise_rad_s
        )
        self._period_s = period_s
        self._roll_period_s = thresholds.tank_period_s
        self._share = period_s / SMOOTH_S
        self._roll_rad = self._rate_rad_s = 0.0
        self._over_s = self._unclear_s = 0.0
        self._remembered_s = self._quiet_s = 0.0
        self.unclear = False

    def update(
        self, apart_rad: float, rate_apart_rad_s: float, used: SensorEvidence, spare: SensorEvidence
    ) -> int:
        """Take the differences of both; return what was found.

        Parameters
        ----------
        apart_rad, rate_apart_rad_s : float
            Roll and rate of one less those of the other; NaN where one is silent.
        used, spare : SensorEvidence
        """
        both = not math.isnan(apart_rad)
        if both:
            self._compare(apart_rad, rate_apart_rad_s)
        apart = self._remembered_s > 0
        if used.found or spare.found:
            self._quiet_s = 0.0
        elif both:  # of one that is silent nothing new is known
            self._quiet_s += self._period_s
        for sensor in (used, spare):
            keeps = apart or self._quiet_s <= PAUSE_S
            sensor.accused = sensor.found != 0 or (sensor.accused and keeps)
        self.unclear = both and apart and used.accused is spare.accused
        if both:
            self._unclear_s = self._unclear_s + self._period_s if self.unclear else 0.0
        if not (apart or used.accused or spare.accused):
            return 0
        if self.unclear and self._unclear_s > UNCLEAR_PERIODS * self._roll_period_s:
            return _DISAGREE | _UNCLEAR
        return _DISAGREE

    def _compare(self, apart_rad: float, rate_apart_rad_s: float) -> None:
        self._roll_rad += self._share * (apart_rad - self._roll_rad)
        self._rate_rad_s += self._share * (rate_apart_rad_s - self._rate_rad_s)
        over = (
            abs(self._roll_rad) > self._roll_limit_rad
            or abs(self._rate_rad_s) > self._rate_limit_rad_s
        )
        self._over_s = self._over_s + self._period_s if over else 0.0
        if self._over_s >= APART_S:
            self._remembered_s = self._roll_period_s
        else:
            self._remembered_s = max(self._remembered_s - self._period_s, 0.0)
