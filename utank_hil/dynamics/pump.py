"""Axial propeller pump in the duct, its drive, and the pressure loop around it (thesis Fig. 2.2).

Blade model. At the effective radius r the blade moves at r n and the water at u = Q / A. The
relative speed is W = sqrt((r n)^2 + u^2) and the slip s = p n - u, p the pitch per radian::

    pressure rise   dP = rho / 2 lift W s
    shaft torque    T  = p A dP + rho / 2 friction A r^2 n W
    shaft power   T n  = dP Q + rho / 2 A W (lift s^2 + friction (r n)^2)

The torque is that of a blade force normal to the blade, plus skin friction. So shaft power is
hydraulic power plus losses that are never negative, in all four quadrants of speed n and flow Q.
dP increases with n and decreases with Q as long as the blade angle at r lies between 19.5 and 70.5
degrees (1/sqrt(8) < p/r < sqrt(8)). A positive dP raises the starboard level.

Pressure loop. The set-point is saturated, low-pass filtered and rate-limited to a reference. A PI
controller on the pressure error adds to the reference. The inverse head curve at the present flow
turns the sum into a speed, which the drive's speed loop follows within its limits of torque and
power. Inside the limits the pressure follows the set-point with a first-order lag of `lag_s`.

The functions take and return plain numbers and named tuples of numbers, so that they can be
compiled (`compile_pump`); this module does not import a compiler. The blade model is in a file of
its own, `pump_curve`, since the tick of a controller with a pressure loop is compiled, too.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass
from importlib.machinery import SourceFileLoader
from importlib.util import module_from_spec, spec_from_loader
from pathlib import Path
from types import FunctionType
from typing import Any, Final, NamedTuple

from utank_hil.base.elementary import exp
from utank_hil.base.parameters import Positive, Problem, range_problems, refuse
from utank_hil.dynamics.pump_curve import PumpCoefficients, pump_load, pump_pressure, pump_speed

_CURVE: Final = Path(__file__).with_name("pump_curve.py")


class PumpState(NamedTuple):
    """State and last outputs of the pump; all zero at rest, see `AT_REST`."""

    speed_rad_s: float
    reference_pa: float  # Set-point after limit, lag and rate limit.
    integral_pa: float
    pressure_pa: float  # Pressure rise at the end of the step.
    torque_nm: float  # Motor torque during the step.
    power_w: float  # Mean shaft power of the step; negative when the water drives the motor.
    limited: bool  # Speed, torque or power was at its limit.


AT_REST = PumpState(0.0, 0.0, 0.0, 0.0, 0.0, 0.0, False)


@dataclass(frozen=True, slots=True)
class Pump:
    """Propeller pump, motor and drive.

    ValueError is raised if a value is not positive and finite, the pitch makes the head curve
    ambiguous, or the loop is slower than the lag.
    """

    duct_area_m2: Positive  #: Cross-section A that the propeller fills.
    radius_m: Positive  #: Effective blade radius r.
    pitch_m: Positive  #: Advance p per radian without slip.
    lift: Positive  #: Blade coefficient for rho / 2: solidity times lift slope.
    friction: Positive  #: Blade coefficient for rho / 2: skin friction.
    #: Moment of inertia of rotor, motor (referred to the propeller) and entrained water.
    inertia_kg_m2: Positive
    max_speed_rad_s: Positive  #: Limit of motor and drive, in either direction.
    max_torque_nm: Positive  #: Limit of motor and drive, in either direction.
    max_power_w: Positive  #: Limit of the shaft power, in either direction.
    max_pressure_pa: Positive  #: Limit of the pressure reference.
    max_pressure_rate_pa_s: Positive  #: Limit of the rate of the pressure reference.
    lag_s: Positive = 0.1  #: Time constant from set-point to pressure, inside the limits.
    speed_bandwidth_rad_s: Positive = 30.0  #: Bandwidth of the drive's speed loop.
    pressure_gain: Positive = 1.0  #: Proportional gain of the pressure loop.
    integral_time_s: Positive = 0.5  #: Integral time of the pressure loop.
    density_kg_m3: Positive = 1000.0

    def __post_init__(self) -> None:
        problems = range_problems(self)
        if not problems:  # The checks below divide by these values.
            problems = [*self._blade_problems(), *self._lag_problems()]
        refuse("pump", problems)

    def _blade_problems(self) -> list[Problem]:
        if 1 / math.sqrt(8) < self.pitch_m / self.radius_m < math.sqrt(8):
            return []
        reason = (
            f"must be 0.354 to 2.83 times radius_m, got {self.pitch_m} and {self.radius_m}: "
            "outside, one pressure belongs to several speeds"
        )
        return [("pitch_m", reason)]

    def _lag_problems(self) -> list[Problem]:
        if self.reference_lag_s > 0:
            return []
        reason = (
            f"= {self.lag_s} must exceed the loop's own lag of {self._loop_lag_s:g} s: raise it, "
            "speed_bandwidth_rad_s or pressure_gain"
        )
        return [("lag_s", reason)]

    @classmethod
    def for_duct(cls, area_m2: float, max_pressure_pa: float = 50e3) -> "Pump":
        """Pump for a duct of `area_m2`, scaled from the first ship's pump by similarity.

        That pump (6.22 m^2, 50 kPa at up to 45 m^3/s, 2.25 MW of hydraulic power) has the size of
        a 3.5 MW tunnel thruster: 2.8 m, 25 rad/s, 67 % efficiency. With geometric similarity and
        water speeds proportional to the square root of pressure, shaft speed scales as sqrt(P/A),
        torque as P A^1.5, power as P^1.5 A and inertia as A^2.5. Patti-B's duct has 0.19 m^2.
        """
        if not (area_m2 > 0 and max_pressure_pa > 0):
            raise ValueError(
                f"pump needs positive area and pressure, got {area_m2}, {max_pressure_pa}"
            )
        size = math.sqrt(area_m2 / 6.22)  # Ratio of lengths.
        speed = math.sqrt(max_pressure_pa / 50e3)  # Ratio of water and blade speeds.
        return cls(
            duct_area_m2=area_m2,
            radius_m=0.985 * size,
            pitch_m=0.40 * size,
            lift=1.405,
            friction=0.005,
            inertia_kg_m2=1700.0 * size * size * size * size * size,
            max_speed_rad_s=28.0 * speed / size,
            max_torque_nm=200e3 * speed * speed * size * size * size,
            max_power_w=3.6e6 * speed * speed * speed * size * size,
            max_pressure_pa=max_pressure_pa,
            max_pressure_rate_pa_s=10 * max_pressure_pa,
        )

    @property
    def reference_lag_s(self) -> float:
        """Time constant of the reference filter: `lag_s` minus the lag of the pressure loop."""
        return self.lag_s - self._loop_lag_s

    @property
    def _loop_lag_s(self) -> float:
        return 1 / (self.speed_bandwidth_rad_s * (1 + self.pressure_gain))

    @property
    def coefficients(self) -> PumpCoefficients:
        """Parameters for the step functions."""
        return PumpCoefficients(
            area=self.duct_area_m2,
            radius=self.radius_m,
            pitch=self.pitch_m,
            half_rho_lift=self.density_kg_m3 / 2 * self.lift,
            half_rho_friction=self.density_kg_m3 / 2 * self.friction,
            inertia=self.inertia_kg_m2,
            max_speed=self.max_speed_rad_s,
            max_torque=self.max_torque_nm,
            max_power=self.max_power_w,
            max_pressure=self.max_pressure_pa,
            max_pressure_rate=self.max_pressure_rate_pa_s,
            reference_lag=self.reference_lag_s,
            speed_bandwidth=self.speed_bandwidth_rad_s,
            gain=self.pressure_gain,
            integral_time=self.integral_time_s,
        )


def pump_step(
    state: PumpState, setpoint: float, flow: float, step_s: float, c: PumpCoefficients
) -> PumpState:
    """Advance drive and pump by one step with closed pressure loop.

    Set-point in Pa and flow to starboard Q = At dh/dt in m^3/s are held over the step, of about 20
    ms at most.
    """
    target = min(max(setpoint, -c.max_pressure), c.max_pressure)
    change = (target - state.reference_pa) * (1.0 - exp(-step_s / c.reference_lag))
    bound = c.max_pressure_rate * step_s
    reference = state.reference_pa + min(max(change, -bound), bound)

    error = reference - pump_pressure(state.speed_rad_s, flow, c)
    demanded_speed = pump_speed(reference + c.gain * error + state.integral_pa, flow, c)
    command = min(max(demanded_speed, -c.max_speed), c.max_speed)

    # The implicit (linearised) load torque is stable for any step.
    load, slope = pump_load(state.speed_rad_s, flow, c)
    stiffness = c.inertia / step_s + slope
    speed_change = (command - state.speed_rad_s) * (1.0 - exp(-step_s * c.speed_bandwidth))
    demanded = load + stiffness * speed_change
    torque, speed = 0.0, state.speed_rad_s
    for _ in range(2):  # The power limit depends on the speed at the end of the step.
        fastest = max(abs(state.speed_rad_s), abs(speed), 1e-9)
        torque_limit = min(c.max_torque, c.max_power / fastest)
        torque = min(max(demanded, -torque_limit), torque_limit)
        speed = state.speed_rad_s + (torque - load) / stiffness

    limited = command != demanded_speed or torque != demanded
    integral = state.integral_pa
    if not limited:  # Conditional integration prevents windup.
        integral += error * step_s / c.integral_time
    return PumpState(
        speed,
        reference,
        integral,
        pump_pressure(speed, flow, c),
        torque,
        torque * (state.speed_rad_s + speed) / 2.0,
        limited,
    )


def pump_coast(state: PumpState, flow: float, step_s: float, c: PumpCoefficients) -> PumpState:
    """Advance by one step (`pump_step`) with the motor off; the water turns the rotor."""
    load, slope = pump_load(state.speed_rad_s, flow, c)
    speed = state.speed_rad_s - load / (c.inertia / step_s + slope)
    return PumpState(speed, 0.0, 0.0, pump_pressure(speed, flow, c), 0.0, 0.0, False)


def compile_pump(compiler: Callable[[Any], Any]) -> tuple[Callable[..., Any], Callable[..., Any]]:
    """Compile `pump_step` and `pump_coast` in a separate namespace, callees first, as `njit`."""
    # from its source: of what mypyc has compiled there is no code to compile again
    spec = spec_from_loader(_CURVE.stem, SourceFileLoader(_CURVE.stem, str(_CURVE)))
    assert spec is not None
    assert spec.loader is not None
    spec.loader.exec_module(curve := module_from_spec(spec))
    scope = dict(globals())
    scope["exp"] = compiler(exp)
    blade = (curve.pump_pressure, curve.pump_load, curve.pump_speed)
    for function in (*blade, pump_step, pump_coast):
        name = function.__name__
        scope[name] = compiler(FunctionType(function.__code__, scope, name))
    return scope["pump_step"], scope["pump_coast"]
