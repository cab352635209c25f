"""Limiter of the pump's command: pressure, power, tank level and pressure rate.

The level barrier. At a constant pressure P in a ship at rest, the water swings as an undamped
oscillator of frequency w0 about h_e = P / (2 rho g). From the level h and its rate it comes to rest
at the limit h_max when ::

    h_e = (h_max^2 - h^2 - (h' / w0)^2) / (2 (h_max - h))          (rising water; falling: mirrored)

so P_touch = 2 rho g h_e is the greatest pressure without overshoot. As long as P_touch is well
above the braking pressure -P_b there is time left to brake, and more is allowed::

    P <= -P_b + sharpness (P_touch + P_b)

A pressure above P_touch lowers P_touch; both meet at -P_b, where the pump brakes with the share of
its pressure reserved for it. The rest of the pump's pressure, beyond P_b, is reserved against the
wave's moment, which is unknown.
"""

import math

from utank_hil.control.interface import PumpLimits
from utank_hil.dynamics.tank import GRAVITY_M_S2, Tank


class CommandLimiter:
    """Limits a desired pressure to `PumpLimits`; called once every command period `period_s`."""

    def __init__(self, limits: PumpLimits, tank: Tank, period_s: float) -> None:
        if not (math.isfinite(period_s) and period_s > 0):
            raise ValueError(f"command period_s must be positive, got {period_s}")
        self._limits = limits
        self._step_pa = limits.rate_pa_s * period_s
        self._stiffness_pa_m = 2 * tank.density_kg_m3 * GRAVITY_M_S2
        self._frequency_rad_s = tank.natural_frequency_rad_s
        self._area_m2 = tank.reservoir_area_m2
        self.command_pa = 0.0  #: The last command.
        self.limiting = False  #: Whether the last command was smaller than desired.
        self._sum_pa = 0.0
        self._count = 0

    def limit(
        self, desired_pa: float, level_m: float, level_rate_m_s: float, share: float = 1.0
    ) -> float:
        """Return the command within the limits that is nearest to `desired_pa`.

        `share` is the currently allowed part of the greatest pressure. If an argument is not
        finite, the command falls to zero at its rate limit.
        """
        # a sum of these, or a difference, is finite only if all of them are
        if math.isfinite(desired_pa + level_m + level_rate_m_s):
            target_pa = self._permitted_pa(desired_pa, level_m, level_rate_m_s, share)
        else:
            target_pa = 0.0
        command = self._towards(target_pa)
        self.limiting = command != desired_pa
        return command

    def ramp_to_zero(self) -> float:
        """Reduce the command to zero at its rate limit."""
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
        """Mean of the commands since the last call, for a controller's `applied`."""
        mean = self._sum_pa / self._count if self._count else self.command_pa
        self._sum_pa = 0.0
        self._count = 0
        return mean

    def _permitted_pa(
        self, desired_pa: float, level_m: float, rate_m_s: float, share: float
    ) -> float:
        """Limit a pressure by the pressure, level and power limits."""
        most = self._limits.pressure_pa * share
        flow_m3_s = self._area_m2 * abs(rate_m_s)
        if flow_m3_s == 0:  # as it also is at the smallest rates
            return min(max(desired_pa, -most), most)
        way = math.copysign(1.0, rate_m_s)  # positive in the direction of the water's motion
        power_pa = self._limits.power_w / flow_m3_s
        high = min(self._barrier_pa(way * level_m, abs(rate_m_s), most), power_pa)
        return way * max(min(way * desired_pa, high), -most)

    def _barrier_pa(self, level_m: float, rate_m_s: float, most_pa: float) -> float:
        """Greatest pressure for water rising at `rate_m_s` > 0 towards the positive limit.

        The braking pressure is at most `most_pa`, so a pump held to a share of its pressure begins
        to brake earlier.
        """
        limits = self._limits
        level_m += rate_m_s * limits.lookahead_s
        room_m = limits.level_m - level_m
        if room_m <= 1e-3:
            return -most_pa
        swing_m = rate_m_s / self._frequency_rad_s
        squares_m2 = limits.level_m * limits.level_m - level_m * level_m - swing_m * swing_m
        touch_m = squares_m2 / (2 * room_m)
        brake_pa = limits.brake_share * most_pa
        allowed = -brake_pa + limits.sharpness * (self._stiffness_pa_m * touch_m + brake_pa)
        return min(max(allowed, -most_pa), most_pa)
