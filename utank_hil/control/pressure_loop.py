"""Pressure loop around a drive that follows torque or speed: feed-forward and PI.

The set-point is filtered to a reference; the inverse head curve at the present flow turns reference
and correction into a speed. Torque is that of the water at this speed, of the rotor's acceleration,
and of a speed loop. What is measured is compared with what the reference has led to so far, which
is late by the way through bus and drive: only what the model lacks is corrected. With a delay T
both loops are those of the SIMC rule (Skogestad, J. Process Control 13 (2003) 291) for the tightest
closed loop that it recommends: an open loop of exp(-sT) / (2 T s).
"""

import math
from dataclasses import dataclass

from utank_hil.base.elementary import exp
from utank_hil.dynamics.pump import Pump
from utank_hil.dynamics.pump_curve import pump_load, pump_speed


@dataclass(frozen=True, slots=True)
class LoopMargins:
    """What the loop stands where its delay is another one than it was designed for."""

    crossover_rad_s: float
    phase_rad: float
    gain: float


def loop_margins(design_delay_s: float, delay_s: float) -> LoopMargins:
    """Margins of exp(-s delay_s) / (2 design_delay_s s)."""
    crossover_rad_s = 0.5 / design_delay_s
    return LoopMargins(
        crossover_rad_s, math.pi / 2 - crossover_rad_s * delay_s, math.pi * design_delay_s / delay_s
    )


class PressureLoop:
    """From a pressure that is wanted to the drive's target, once in `cycle_s`.

    `delay_s` is that of the way from measurement to torque; with `torque` the target is one in
    N m, else a speed in rad/s.
    """

    def __init__(self, pump: Pump, cycle_s: float, delay_s: float, *, torque: bool) -> None:
        self._pump, self._c = pump, pump.coefficients
        self._cycle_s, self._torque = cycle_s, torque
        self._lag_s = 0.0 if torque else 1 / pump.speed_bandwidth_rad_s
        self._toward = 1 - exp(-cycle_s / (pump.lag_s - self._lag_s))
        self._follow = 1 - exp(-cycle_s / self._lag_s) if self._lag_s else 1.0
        self._per_s = 0.5 / delay_s
        self._late = max(1, round(delay_s / cycle_s))
        self._most_pa = pump.max_pressure_rate_pa_s * cycle_s
        self._inertia = pump.coefficients.inertia
        self.most_speed_rad_s, self._most_torque = self._c.max_speed, self._c.max_torque
        self.reset()

    def reset(self) -> None:
        """Forget the past: the pump has stood still."""
        self._reference_pa = self._expected_pa = self._correction_pa = 0.0
        self._speed_rad_s = 0.0
        self._references = [0.0] * self._late
        self._speeds = [0.0] * self._late

    def speed_rad_s(self, pressure_pa: float, flow_m3_s: float) -> float:
        """The rotor's speed that makes a pressure at a flow."""
        return pump_speed(pressure_pa, flow_m3_s, self._c)

    def step(
        self, wanted_pa: float, measured_pa: float, flow_m3_s: float, speed_rad_s: float
    ) -> float:
        """The next target; NaN as a measurement leaves its correction as it is."""
        c, cycle_s, most_pa = self._c, self._cycle_s, self._most_pa
        change_pa = self._toward * (wanted_pa - self._reference_pa)
        self._reference_pa += min(max(change_pa, -most_pa), most_pa)
        self._expected_pa += self._follow * (self._references.pop(0) - self._expected_pa)
        self._references.append(self._reference_pa)
        follows = self._speeds.pop(0)
        error_pa = self._expected_pa - measured_pa if math.isfinite(measured_pa) else 0.0
        proportional_pa = self._per_s * self._lag_s * error_pa
        correction_pa = self._correction_pa + self._per_s * cycle_s * error_pa
        demanded = pump_speed(self._reference_pa + correction_pa + proportional_pa, flow_m3_s, c)
        speed = min(max(demanded, -self.most_speed_rad_s), self.most_speed_rad_s)
        target = limited = speed
        if self._torque:
            acceleration = (speed - self._speed_rad_s) / cycle_s
            behind = follows - speed_rad_s if math.isfinite(speed_rad_s) else 0.0
            target = pump_load(speed, flow_m3_s, c)[0] + self._inertia * (
                acceleration + self._per_s * behind
            )
            limited = min(max(target, -self._most_torque), self._most_torque)
        self._speed_rad_s = speed
        self._speeds.append(speed)
        # at a limit the correction grows no further into it
        # pragma: no mutate start: the sign of the product counts, and no error corrects nothing
        inward = error_pa * demanded < 0
        # pragma: no mutate end
        if (speed == demanded and target == limited) or inward:
            self._correction_pa = correction_pa
        return limited
