"""Losses of the pump, by the blade model's own formula."""

import math


def pump_losses(speed, flow, c):
    """Shaft power minus hydraulic power in W: slip and blade friction, never negative."""
    u = flow / c.area
    rn = c.radius * speed
    slip = c.pitch * speed - u
    per_speed = c.half_rho_lift * slip * slip + c.half_rho_friction * rn * rn
    return c.area * math.hypot(rn, u) * per_speed
