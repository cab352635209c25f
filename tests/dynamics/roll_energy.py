"""Test oracle: energy of ship and tank water in roll, from the particles and not from the model."""

import numpy as np
from streamline import GRAVITY, particles

from utank_hil.dynamics import RollShip, Tank

THESIS_SHIP = RollShip(1.9275e9, 1.9275e9 * 0.25)
THESIS_TANK = Tank(17.1, 4.88, 17.11, 6.22, lz_m=1.83, restitution=1.0)
PATTI = RollShip(1.468e6, 2.366e6 * 0.2138, restoring_odd_nm=(-2.366e6 * 0.6713,))
PATTI_TANK = Tank(5.0, 2.0, 2.0, 0.19, lz_m=-1.0, restitution=1.0)
LEVERS = RollShip(
    1.9275e9,
    5e7 * 1.2,
    displacement_n=5e7,
    gz_step_rad=np.radians(10),
    gz_m=(0.0, 0.21, 0.45, 0.72, 0.85, 0.8, 0.6, 0.3, -0.05, -0.4),
)


def ship_potential(ship, roll):
    """Work against the restoring moment, integrated by hand from an independent spline."""
    if not ship.gz_m:
        powers = np.arange(2, 2 * len(ship.restoring_odd_nm) + 3, 2)
        odd = np.array([ship.stiffness_nm_rad, *ship.restoring_odd_nm])
        return (odd / powers * roll[:, None] ** powers).sum(axis=1)
    heel = ship.gz_step_rad * np.arange(len(ship.gz_m))
    slope = ship.stiffness_nm_rad / ship.displacement_n
    # quintic spline as slope x + a x^3 + b x^5 + truncated fifth powers at the inner knots
    knots = heel[1:-2]

    def basis(x, power_up):
        return np.column_stack(
            [x ** (3 + power_up), x ** (5 + power_up)]
            + [np.maximum(x - knot, 0) ** (5 + power_up) for knot in knots]
        )

    weights = np.linalg.solve(basis(heel[1:], 0), np.array(ship.gz_m[1:]) - slope * heel[1:])
    x = np.abs(roll)
    divisors = np.array([4.0] + [6.0] * (1 + len(knots)))
    return ship.displacement_n * (slope * x**2 / 2 + basis(x, 1) @ (weights / divisors))


def energy(ship, tank, state):
    """Total energy of states (n, 4)."""
    roll, rate, level, level_rate = np.asarray(state).T
    r, dm, _, tangents, speeds = particles(tank, level)
    spin = np.stack([rate, 0 * rate, 0 * rate], axis=-1)[:, None, :]
    velocity = np.cross(spin, r) + (level_rate[:, None] * speeds)[..., None] * tangents
    kinetic = 0.5 * np.einsum("nk,nki,nki->n", dm, velocity, velocity)
    depth = r[..., 1] * np.sin(roll)[:, None] + r[..., 2] * np.cos(roll)[:, None]
    return (
        kinetic
        - GRAVITY * np.einsum("nk,nk->n", dm, depth)
        + 0.5 * ship.inertia_kg_m2 * rate**2
        + ship_potential(ship, roll)
        - ship.offset_moment_nm * np.sin(roll)
        - ship.wind_moment_nm * roll
    )


def bounded_starts(ship, tank, count, rng):
    """States at rest, at any level, that cannot reach a saddle; the first one lies near it.

    The saddle is where heel and level are both in equilibrium; without one, up to 60 degrees.
    """
    roll = np.radians(np.linspace(0, 89, 8901))
    balanced = np.minimum(np.tan(roll) * tank.width_m / 2, tank.level_limit_m)
    rest = np.zeros_like(roll)
    profile = energy(ship, tank, np.stack([roll, rest, balanced, rest], axis=-1))
    falling = np.flatnonzero(np.diff(profile) < 0)
    top = falling[0] if falling.size else None
    widest = 0.95 * roll[top] if falling.size else np.radians(60)
    ceiling = profile[top] if falling.size else np.inf
    level = min(np.tan(widest) * tank.width_m / 2, tank.level_limit_m)
    starts = [np.array([widest, 0, level, 0])]
    while len(starts) < count:
        start = np.array(
            [rng.uniform(-1, 1) * widest, 0, rng.uniform(-1, 1) * tank.level_limit_m, 0]
        )
        if energy(ship, tank, start[None])[0] < ceiling:
            starts.append(start)
    return starts
