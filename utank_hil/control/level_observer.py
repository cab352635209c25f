"""Level and its rate from level gauges and pump pressure: an observer with the tank's own model.

An alpha-beta filter alone gives the rate late by two of its time constants, and the level barrier
(`utank_hil.control.limits`) pays for each tenth of a second with level and with roll. Gravity and
pump make most of the water's acceleration, so they are fed forward; what is left to the filter is
the ship's push::

    h'' = (P - 2 rho g h - loss h') / (rho (2H + L At/Ap)) + unknown
"""

import math

from utank_hil.dynamics.tank import GRAVITY_M_S2, Tank


class LevelObserver:
    """Observer of the level with both poles at the same place (critically damped).

    Parameters
    ----------
    tank : Tank
    period_s : float
        Time between two measurements.
    bandwidth_rad_s : float
        Poles of the observer in continuous time; the level itself moves below 1 rad/s.

    Attributes
    ----------
    level_m, rate_m_s : float
        Estimated level, and its rate.

    Raises
    ------
    ValueError
        If the period or the bandwidth is not positive.

    References
    ----------
    Y. Bar-Shalom, X. Li, T. Kirubarajan, Estimation with Applications to Tracking and Navigation,
    2001, section 6.5.
    """

    def __init__(self, tank: Tank, period_s: float, bandwidth_rad_s: float = 6.0) -> None:
        if not (period_s > 0 and bandwidth_rad_s > 0):
            raise ValueError(
                f"period_s and bandwidth_rad_s must be positive, got {period_s}, {bandwidth_rad_s}"
            )
        pole = math.exp(-bandwidth_rad_s * period_s)
        self._period_s = period_s
        self._alpha = 1.0 - pole**2
        self._beta = (1.0 - pole) ** 2
        self._inertia_pa_s2_m = tank.density_kg_m3 * tank.effective_length_m
        self._stiffness_pa_m = 2 * tank.density_kg_m3 * GRAVITY_M_S2
        self._loss_pa_s_m = tank.loss_pa_per_m_s
        self.level_m = 0.0
        self.rate_m_s = 0.0

    def update(self, measured_m: float, pressure_pa: float) -> None:
        """Take the next level and the pump's pressure since the last one."""
        period_s = self._period_s
        push_pa = (
            pressure_pa - self._stiffness_pa_m * self.level_m - self._loss_pa_s_m * self.rate_m_s
        )
        gain_m_s = push_pa / self._inertia_pa_s2_m * period_s
        predicted_m = self.level_m + (self.rate_m_s + gain_m_s / 2) * period_s
        surprise_m = measured_m - predicted_m
        self.level_m = predicted_m + self._alpha * surprise_m
        self.rate_m_s += gain_m_s + self._beta / period_s * surprise_m
