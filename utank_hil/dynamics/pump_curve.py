"""Blade model of a pump: pressure, torque and speed, see `utank_hil.dynamics.pump`."""

import math
from typing import NamedTuple


class PumpCoefficients(NamedTuple):
    """Parameters of a `Pump` for the step functions, in SI units."""

    area: float
    radius: float
    pitch: float
    half_rho_lift: float
    half_rho_friction: float
    inertia: float
    max_speed: float
    max_torque: float
    max_power: float
    max_pressure: float
    max_pressure_rate: float
    reference_lag: float
    speed_bandwidth: float
    gain: float
    integral_time: float


def pump_pressure(speed: float, flow: float, c: PumpCoefficients) -> float:
    """Pressure rise in Pa at a speed (rad/s) and a flow to starboard (m^3/s)."""
    u, rn = flow / c.area, c.radius * speed
    # `hypot` is the C library's, and not the same everywhere
    return c.half_rho_lift * math.sqrt(rn * rn + u * u) * (c.pitch * speed - u)


def pump_load(speed: float, flow: float, c: PumpCoefficients) -> tuple[float, float]:
    """Load torque of the water in N m, and its derivative by speed in N m s, zero or more."""
    area, radius, pitch = c.area, c.radius, c.pitch
    lift, friction = c.half_rho_lift, c.half_rho_friction
    u = flow / area
    rn = radius * speed
    w = math.sqrt(rn * rn + u * u) + 1e-9  # The offset avoids division by zero.
    slip = pitch * speed - u
    drag = pitch * lift * slip + friction * radius * rn
    drag_slope = lift * pitch * pitch + friction * radius * radius
    slope = area * (radius * rn / w * drag + w * drag_slope)
    return area * w * drag, max(slope, 0.0)


def pump_speed(pressure: float, flow: float, c: PumpCoefficients) -> float:
    """Speed in rad/s that gives a pressure rise at a flow: the inverse of `pump_pressure`."""
    radius, pitch = c.radius, c.pitch  # read once: Python takes most of its time for that
    u = flow / c.area
    wanted = pressure / c.half_rho_lift
    # The start is from the slip s of (a |s| + b |u|) = wanted, exact without flow or slip.
    a = radius / pitch
    b = math.sqrt(1.0 + a * a) * abs(u)
    slip = 2.0 * wanted / (b + math.sqrt(b * b + 4.0 * a * abs(wanted)) + 1e-12)
    speed = (u + slip) / pitch
    for _ in range(8):  # Newton's method: the head curve is smooth and monotone.
        rn = radius * speed
        w = math.sqrt(rn * rn + u * u)
        slip = pitch * speed - u
        slope = w * pitch + radius * radius * speed * slip / (w + 1e-12)
        if slope < 1e-9:
            break
        change = (w * slip - wanted) / slope
        speed -= change
        if abs(change) < 1e-12 * abs(speed):
            break
    return speed
