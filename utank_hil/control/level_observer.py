"""Observer of the level and its rate, from level gauges, pump pressure and the tank's model.

An alpha-beta filter alone estimates the rate with a delay of two of its time constants, and each
tenth of a second costs the level barrier (`utank_hil.control.limiter`) level and roll. Gravity and
pump cause most of the water's acceleration, so they are fed forward; the filter estimates the
remainder, which is due to the ship's motion::

    h'' = (P - 2 rho g h - loss h') / (rho (2H + L At/Ap)) + unknown

Without measurements the model continues alone, and the next one corrects for the whole elapsed
time, with pole^n in place of the pole after n periods.
"""

import math
from typing import Final

from utank_hil.base.elementary import exp
from utank_hil.dynamics.tank import GRAVITY_M_S2, Tank

LONGEST_GAP_S: Final = 1.0
"""Gap after which the model's prediction is useless and the observer restarts at the measured
level."""

BANDWIDTH_RAD_S: Final = 6.0
"""Poles of the observer in continuous time; the level itself moves below 1 rad/s."""


class LevelObserver:
    """Observer of the level with a double pole (critically damped).

    `level_m` and `rate_m_s` are its estimates, `period_s` is the time between two measurements.

    References
    ----------
    Y. Bar-Shalom, X. Li, T. Kirubarajan, Estimation with Applications to Tracking and Navigation,
    2001, section 6.5.
    """

    def __init__(self, tank: Tank, period_s: float) -> None:
        if not period_s > 0:
            raise ValueError(f"period_s must be positive, got {period_s}")
        pole = exp(-BANDWIDTH_RAD_S * period_s)
        self._period_s = period_s
        self._pole = pole
        self._alpha = 1.0 - pole * pole
        self._beta = (1.0 - pole) * (1.0 - pole)
        self._longest = round(LONGEST_GAP_S / period_s)
        self._ahead = 0  # periods since the last measurement
        self._inertia_pa_s2_m = tank.density_kg_m3 * tank.effective_length_m
        self._stiffness_pa_m = 2 * tank.density_kg_m3 * GRAVITY_M_S2
        self._loss_pa_s_m = tank.loss_pa_per_m_s
        self.level_m = 0.0
        self.rate_m_s = 0.0

    @property
    def alone(self) -> bool:
        """Whether the model continues without measurements, more than one being missing."""
        return self._ahead > 1

    @property
    def next_due_s(self) -> float:
        """Time from the last measurement to the end of the next period."""
        return (self._ahead + 1) * self._period_s if self._ahead < self._longest else math.inf

    def update(self, measured_m: float, pressure_pa: float, periods: int = 1) -> None:
        """Take the next level and the pump's pressure since the last measurement.

        `periods` since the last measurement are more than one after a gap.
        """
        alpha, beta = self._alpha, self._beta
        if periods > self._longest:
            self.level_m, self.rate_m_s, self._ahead = measured_m, 0.0, 0
            return
        for _ in range(self._ahead, periods):
            self.predict(pressure_pa)
        self._ahead = 0
        if periods > 1:
            pole = 1.0
            for _ in range(periods):
                pole *= self._pole
            alpha, beta = 1.0 - pole * pole, (1.0 - pole) * (1.0 - pole) / periods
        surprise_m = measured_m - self.level_m
        self.level_m += alpha * surprise_m
        self.rate_m_s += beta / self._period_s * surprise_m

    def predict(self, pressure_pa: float) -> None:
        """Advance by a period without a measurement."""
        period_s = self._period_s
        push_pa = (
            pressure_pa - self._stiffness_pa_m * self.level_m - self._loss_pa_s_m * self.rate_m_s
        )
        gain_m_s = push_pa / self._inertia_pa_s2_m * period_s
        self.level_m += (self.rate_m_s + gain_m_s / 2) * period_s
        self.rate_m_s += gain_m_s
        self._ahead += 1
