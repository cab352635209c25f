"""Keeps the pump's command within pressure, power, tank level and pressure rate.

The level barrier. Held at a pressure P in a ship at rest, the water swings as an undamped
oscillator of frequency w0 about h_e = P / (2 rho g). From the level h and its rate it comes to rest
at the limit h_max when ::

    h_e = (h_max^2 - h^2 - (h' / w0)^2) / (2 (h_max - h))          (rising water; falling: mirrored)

so P_touch = 2 rho g h_e is the pressure that just does not overshoot. As long as P_touch is well
above the braking pressure -P_b there is time left to brake, and more may be allowed now::

    P <= -P_b + sharpness (P_touch + P_b)

A pressure above P_touch lowers P_touch; both meet at -P_b, where the pump brakes with the share of
its pressure that was kept for it. The wave's own push is not known; that is what the rest of the
pump's pressure, beyond P_b, is for.
"""

import math

from utank_hil.control.limits import PumpLimits
from utank_hil.dynamics.tank import GRAVITY_M_S2, Tank


class CommandLimiter:
    """Brings a desired pressure within `PumpLimits`, once every command period.

    Parameters
    ----------
    limits : PumpLimits
    tank : Tank
    period_s : float
        Time between two commands.

    Attributes
    ----------
    command_pa : float
        The last command.
    limiting : bool
        Whether the last command fell short of what was desired.
    """

    def __init__(self, limits: PumpLimits, tank: Tank, period_s: float) -> None:
        if not (math.isfinite(period_s) and period_s > 0):
            raise ValueError(f"command period_s must be positive, got {period_s}")
        self._limits = limits
        self._step_pa = limits.rate_pa_s * period_s
        self._stiffness_pa_m = 2 * tank.density_kg_m3 * GRAVITY_M_S2
        self._frequency_rad_s = tank.natural_frequency_rad_s
        self._area_m2 = tank.reservoir_area_m2
        self.command_pa = 0.0
        self.limiting = False
        self._sum_pa = 0.0
        self._count = 0

    def limit(
        self, desired_pa: float, level_m: float, level_rate_m_s: float, share: float = 1.0
    ) -> float:
        """The command nearest to `desired_pa` that keeps within the limits.

        Parameters
        ----------
        desired_pa : float
        level_m, level_rate_m_s : float
        share : float
            Part of the greatest pressure that is allowed at present.

        Returns
        -------
        float
            On its way to zero if an argument is not a finite number.
        """
        if math.isfinite(desired_pa + level_m + level_rate_m_s):
            target_pa = self._permitted_pa(desired_pa, level_m, level_rate_m_s, share)
        else:
            target_pa = 0.0
        command = self._towards(target_pa)
        self.limiting = command != desired_pa
        return command

    def ramp_to_zero(self) -> float:
        """Let the command fall to zero at its rate limit."""
        self.limiting = False
        return self._towards(0.0)

    def cut(self) -> float:
        """Set the command to zero at once."""
        self.command_pa = 0.0
        self.limiting = False
        self._count += 1
        return 0.0

    def _towards(self, target_pa: float) -> float:
        step = self._step_pa
        command = min(max(target_pa, self.command_pa - step), self.command_pa + step)
        self.command_pa = command
        self._sum_pa += command
        self._count += 1
        return command

    def mean_since_last_call(self) -> float:
        """Mean of the commands since the last call: what a controller's `applied` wants to know."""
        mean = self._sum_pa / self._count if self._count else self.command_pa
        self._sum_pa = 0.0
        self._count = 0
        return mean

    def _permitted_pa(
        self, desired_pa: float, level_m: float, rate_m_s: float, share: float
    ) -> float:
        """Within pressure, level and power limits."""
        most = self._limits.pressure_pa * share
        flow_m3_s = self._area_m2 * abs(rate_m_s)
        if flow_m3_s == 0:  # that of the smallest rate is, too
            return min(max(desired_pa, -most), most)
        way = math.copysign(1.0, rate_m_s)  # seen in the direction in which the water moves
        power_pa = self._limits.power_w / flow_m3_s
        high = min(most, self._barrier_pa(way * level_m, abs(rate_m_s), most), power_pa)
        return way * max(min(way * desired_pa, high), -most)

    def _barrier_pa(self, level_m: float, rate_m_s: float, most_pa: float) -> float:
        """Greatest pressure for water rising at `rate_m_s` > 0 towards the positive limit.

        It reckons with no more than `most_pa` for braking: a pump that is held to a share of its
        pressure has to begin earlier.
        """
        limits = self._limits
        level_m += rate_m_s * limits.lookahead_s
        room_m = limits.level_m - level_m
        if room_m <= 1e-3:
            return -most_pa
        swing_m = rate_m_s / self._frequency_rad_s
        touch_m = (limits.level_m**2 - level_m**2 - swing_m**2) / (2 * room_m)
        brake_pa = limits.brake_share * most_pa
        allowed = -brake_pa + limits.sharpness * (self._stiffness_pa_m * touch_m + brake_pa)
        return min(max(allowed, -most_pa), most_pa)
