"""Radiation and excitation of a hull between the points of its data, and its free roll.

At the frequency of free roll w, the undamped mode v of sway, roll and yaw (v = 1 in roll) turns the
coupled equations into one of roll alone, ``C44`` its stiffness::

    w^2 = C44 / (v (M + A) v),    zeta = w v B v / (2 C44)
"""

import math
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from utank_hil.base.arrays import ComplexArray, FloatArray
from utank_hil.dynamics.hull.hull_data import HullData

_LATERAL = [1, 3, 5]
_MIRRORED = np.array([1, -1, 1, -1, 1, -1])
_MOST_TURN_DEG = 45.0
"""Between headings farther apart than this, forces are not known: seakeeping runs have 10 to 30."""


class FreeRoll(NamedTuple):
    """Free roll of a hull, with the damping of the waves that it radiates."""

    period_s: float  #: Natural period, sway and yaw free.
    radiation_ratio: float  #: Damping ratio.
    mode: FloatArray  #: shape (3,): sway, roll and yaw, 1 in roll.


def wave_number(omega_rad_s: FloatArray, depth_m: float, gravity_m_s2: float) -> FloatArray:
    """Return k with w^2 = g k tanh(k depth), in 1/m, by Newton's method."""
    deep = omega_rad_s**2 / gravity_m_s2
    if not math.isfinite(depth_m):
        return np.asarray(deep)
    k = np.maximum(deep, omega_rad_s / math.sqrt(gravity_m_s2 * depth_m))
    for _ in range(20):
        t = np.tanh(k * depth_m)
        k = k - (k * t - deep) / (t + k * depth_m * (1 - t**2))
    return np.asarray(k)


def radiation_at(hull: HullData, omega_rad_s: float) -> tuple[FloatArray, FloatArray]:
    """Return added mass and damping, shape (6, 6), between the frequencies of the data.

    ValueError is raised if the frequency lies outside of the data.
    """
    grid = hull.frequency_rad_s
    _inside(hull, "frequency_rad_s", grid, omega_rad_s)
    return _between(grid, hull.added_mass, omega_rad_s), _between(grid, hull.damping, omega_rad_s)


def excitation_at(hull: HullData, omega_rad_s: float, heading_deg: float) -> ComplexArray:
    """Return force and moment per metre, shape (6,), at a wave frequency and heading.

    Headings that the data lack are those of the other side of the ship, mirrored. ValueError is
    raised for a frequency outside of the data, and between headings far apart.
    """
    grid = hull.wave_frequency_rad_s
    _inside(hull, "wave_frequency_rad_s", grid, omega_rad_s)
    force = _between(grid, hull.excitation.transpose(1, 0, 2), omega_rad_s)
    both = np.concatenate([hull.heading_deg, -hull.heading_deg]) % 360
    around, first = np.unique(np.round(both, 6), return_index=True)
    force = np.concatenate([force, _MIRRORED * force])[first]
    around = np.concatenate([around[-1:] - 360, around, around[:1] + 360])
    force = np.concatenate([force[-1:], force, force[:1]])
    heading = heading_deg % 360
    n = int(np.searchsorted(around, heading))
    if around[n] - around[n - 1] > _MOST_TURN_DEG and around[n] != heading:
        near = f"{heading_deg:g} degrees, the nearest are {around[n - 1]:g} and {around[n]:g}"
        raise ValueError(f"{hull.source}: heading_deg does not cover {near}")
    return np.asarray(_between(around, force, heading), dtype=np.complex128)


def free_roll(hull: HullData) -> FreeRoll:
    """Return the free roll of the ship at rest.

    ValueError is raised if mass, inertia, centre of gravity, restoring or a frequency is not in the
    data, or the ship is not stable upright.
    """
    ship = hull.about_gravity_centre()
    stiffness = float(ship.known("hydrostatic")[3, 3])
    if stiffness <= 0:
        raise ValueError(f"{hull.source}: C44 is {stiffness:.3g} N m/rad: GM must be positive")
    omega = math.sqrt(stiffness / (1.3 * ship.mass_matrix[3, 3]))  # hulls add a third in roll
    for _ in range(50):
        added, damping = radiation_at(ship, omega)
        inertia = (ship.mass_matrix + added)[np.ix_(_LATERAL, _LATERAL)]
        mode = _mode(inertia)
        before, omega = omega, math.sqrt(stiffness / float(mode @ inertia @ mode))
        if abs(omega - before) < 1e-9 * omega:
            break
    radiated = float(mode @ damping[np.ix_(_LATERAL, _LATERAL)] @ mode)
    return FreeRoll(2 * math.pi / omega, omega * radiated / (2 * stiffness), mode)


def _mode(inertia: FloatArray) -> FloatArray:
    """Return sway, 1, yaw of free roll: sway and yaw have inertia alone."""
    others = np.ix_([0, 2], [0, 2])
    sway, yaw = -np.linalg.solve(inertia[others], inertia[[0, 2], 1])
    return np.array([sway, 1.0, yaw])


def _inside(hull: HullData, name: str, grid: FloatArray, at: float) -> None:
    if not grid[0] <= at <= grid[-1]:
        raise ValueError(f"{hull.source}: {name} goes from {grid[0]:g} to {grid[-1]:g}, not {at:g}")


def _between(grid: FloatArray, values: npt.NDArray[Any], at: float) -> Any:
    """Return values between those of a grid, which is their first index."""
    if len(grid) == 1:
        return values[0]
    n = int(np.clip(np.searchsorted(grid, at) - 1, 0, len(grid) - 2))
    share = (at - grid[n]) / (grid[n + 1] - grid[n])
    return (1 - share) * values[n] + share * values[n + 1]
