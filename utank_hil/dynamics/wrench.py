"""Force and moment of the tank water on a ship in arbitrary motion, thesis (2.11), (2.14), (2.16).

The printed expressions contain errors (docs/thesis.md), so these are derived from the water's
linear and angular momentum. With m, S, J the mass, first moment and inertia tensor of the water
about the centre of gravity, and s the angular momentum of the flow relative to the ship per dh/dt::

    P = m v + W x S + S' h'                       momentum
    H = S x v + J W + s h'                        angular momentum about the CG
    F = m g - dP/dt,    M = S x g - dH/dt - v x P

(dash: d/dh for S, J, s and d/dt for h). Differentiating S' h' brings -2 rho At h'^2 in heave, the
momentum flux of the water at the two corners, which an integral of the particles' accelerations
does not contain.
"""

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from utank_hil.base.arrays import FloatArray
from utank_hil.dynamics.tank import GRAVITY_M_S2, Tank


class WaterMoments(NamedTuple):
    """Integrals over the mass of the water, and their derivatives with respect to the level."""

    mass_kg: float
    first_kgm: FloatArray  #: shape (..., 3): Integral of r dm about the ship's centre of gravity.
    #: shape (..., 3): d first / dh; times dh/dt it is the momentum of the flow relative to the
    #: ship.
    first_slope_kg: FloatArray
    first_curvature_kg_m: FloatArray  #: shape (3,): d2 first / dh2.
    #: shape (..., 3, 3): Inertia tensor about the ship's centre of gravity.
    inertia_kgm2: FloatArray
    inertia_slope_kgm: FloatArray  #: shape (..., 3, 3): d inertia / dh.
    #: shape (..., 3): Angular momentum of the flow relative to the ship per dh/dt.
    swirl_kgm: FloatArray
    swirl_slope_kg: FloatArray  #: shape (3,): d swirl / dh.


def water_moments(tank: Tank, level_m: npt.ArrayLike) -> WaterMoments:
    """Moments of the tank water at the given levels, any shape.

    They are exact: the water fills three straight tubes (port reservoir, duct, starboard
    reservoir), so every integral over its mass is a polynomial in the level h.
    """
    h = np.asarray(level_m, dtype=np.float64)
    zero, lx, mass = np.zeros_like(h), tank.lx_m, tank.water_kg
    above = tank.height_m - tank.lz_m  # from the centre of gravity up to the still level
    flow = tank.density_kg_m3 * tank.reservoir_area_m2  # per dh/dt, along the whole streamline

    # These are integrals of y, z, y^2, z^2, y z over the mass; those of x follow from x = lx.
    slope_y, slope_z = tank.across_kg, -2 * flow * h
    first_y, first_z = slope_y * h, tank.water_lever_kgm - flow * h * h
    square_y, at_rest = tank.water_squares_kg_m2
    square_z = at_rest + 2 * flow * above * h * h
    slope_yz, slope_zz = -slope_y * above, 4 * flow * above * h

    inertia = np.empty((*h.shape, 3, 3))
    inertia[..., 0, 0] = square_y + square_z
    inertia[..., 1, 1] = mass * lx * lx + square_z
    inertia[..., 2, 2] = mass * lx * lx + square_y
    inertia[..., 0, 1] = inertia[..., 1, 0] = -lx * first_y
    inertia[..., 0, 2] = inertia[..., 2, 0] = -lx * first_z
    inertia[..., 1, 2] = inertia[..., 2, 1] = -slope_yz * h
    inertia_slope = np.zeros((*h.shape, 3, 3))
    inertia_slope[..., 0, 0] = inertia_slope[..., 1, 1] = slope_zz
    inertia_slope[..., 0, 1] = inertia_slope[..., 1, 0] = -lx * slope_y
    inertia_slope[..., 0, 2] = inertia_slope[..., 2, 0] = -lx * slope_z
    inertia_slope[..., 1, 2] = inertia_slope[..., 2, 1] = -slope_yz

    return WaterMoments(
        mass_kg=mass,
        first_kgm=np.stack([zero + mass * lx, first_y, zero + first_z], axis=-1),
        first_slope_kg=np.stack([zero, zero + slope_y, zero + slope_z], axis=-1),
        first_curvature_kg_m=np.array([0.0, 0.0, -2 * flow]),
        inertia_kgm2=inertia,
        inertia_slope_kgm=inertia_slope,
        swirl_kgm=np.stack(
            [zero + tank.swirl_kgm, 2 * flow * lx * h, zero + slope_y * lx], axis=-1
        ),
        swirl_slope_kg=np.array([0.0, 2 * flow * lx, 0.0]),
    )


def tank_wrench(
    tank: Tank,
    h: npt.ArrayLike,
    h_dot: npt.ArrayLike,
    h_ddot: npt.ArrayLike,
    velocity: npt.ArrayLike,
    rate: npt.ArrayLike,
    acceleration: npt.ArrayLike,
    rate_dot: npt.ArrayLike,
    roll: npt.ArrayLike,
    pitch: npt.ArrayLike,
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Force and moment of the water on the ship, and the residual of the water's own equation.

    Exact in the level; leading shapes broadcast. Body axes at the ship's centre of gravity.

    ValueError is raised if a vector argument does not end in an axis of length 3.

    Parameters
    ----------
    h, h_dot, h_ddot : array_like, shape (...)
        Level in m and its derivatives in m/s and m/s^2.
    velocity : array_like, shape (..., 3)
        (u, v, w) of the centre of gravity in m/s.
    rate : array_like, shape (..., 3)
        (p, q, r) in rad/s.
    acceleration : array_like, shape (..., 3)
        (u_dot, v_dot, w_dot) in m/s^2: derivatives of the body components as in (2.6), without
        rate x velocity.
    rate_dot : array_like, shape (..., 3)
        (p_dot, q_dot, r_dot) in rad/s^2.
    roll, pitch : array_like, shape (...)
        Euler angles in rad.

    Returns
    -------
    force : ndarray, shape (..., 3)
        N, weight and corner momentum flux included.
    moment : ndarray, shape (..., 3)
        N m about the centre of gravity.
    residual : ndarray, shape (...)
        Line integral of (particle acceleration - g) from the port to the starboard surface in
        m^2/s^2. The water moves so that density times residual equals pump pressure minus losses.
    """
    v0, omega, v0_dot, omega_dot = (
        _vector(name, value)
        for name, value in (
            ("velocity", velocity),
            ("rate", rate),
            ("acceleration", acceleration),
            ("rate_dot", rate_dot),
        )
    )
    level, speed, level_acceleration = (
        np.asarray(value, dtype=np.float64) for value in (h, h_dot, h_ddot)
    )
    speed_, level_acceleration_ = speed[..., None], level_acceleration[..., None]
    water = water_moments(tank, level)
    mass, first = water.mass_kg, water.first_kgm

    specific_force = v0_dot + np.cross(omega, v0) - gravity_body(roll, pitch)
    flow_momentum = water.first_slope_kg * speed_
    flow_momentum_dot = (
        water.first_slope_kg * level_acceleration_ + water.first_curvature_kg_m * speed_**2
    )
    force = -(
        mass * specific_force
        + np.cross(omega_dot, first)
        + np.cross(omega, np.cross(omega, first) + 2 * flow_momentum)
        + flow_momentum_dot
    )
    relative = np.einsum("...ij,...j->...i", water.inertia_kgm2, omega) + water.swirl_kgm * speed_
    relative_dot = (
        np.einsum("...ij,...j->...i", water.inertia_kgm2, omega_dot)
        + np.einsum("...ij,...j->...i", water.inertia_slope_kgm, omega) * speed_
        + water.swirl_kgm * level_acceleration_
        + water.swirl_slope_kg * speed_**2
    )
    moment = -(np.cross(first, specific_force) + relative_dot + np.cross(omega, relative))

    # Along the streamline the Coriolis acceleration does no work, and the centrifugal one is the
    # gradient of -|rate x r|^2 / 2, so that only its values at the two surfaces remain.
    flow_kg_m = tank.density_kg_m3 * tank.reservoir_area_m2
    zero = np.zeros_like(level)
    across = np.stack([zero, zero + tank.width_m, -2 * level], axis=-1)  # port to starboard surface
    middle = np.array([tank.lx_m, 0.0, tank.lz_m - tank.height_m])
    residual = (
        tank.effective_length_m * level_acceleration
        + _dot(specific_force, across)
        + _dot(omega_dot, water.swirl_kgm) / flow_kg_m
        - _dot(np.cross(omega, across), np.cross(omega, middle))
    )
    return force, moment, residual


def gravity_body(roll: npt.ArrayLike, pitch: npt.ArrayLike) -> FloatArray:
    """Gravity in body axes, shape (..., 3), in m/s^2, for Euler angles in rad."""
    phi, theta = np.broadcast_arrays(
        np.asarray(roll, dtype=np.float64), np.asarray(pitch, dtype=np.float64)
    )
    return GRAVITY_M_S2 * np.stack(
        [-np.sin(theta), np.cos(theta) * np.sin(phi), np.cos(theta) * np.cos(phi)], axis=-1
    )


def _vector(name: str, value: npt.ArrayLike) -> FloatArray:
    array = np.asarray(value, dtype=np.float64)
    if array.shape[-1:] != (3,):
        raise ValueError(f"{name} must have shape (..., 3), got {array.shape}")
    return array


def _dot(a: FloatArray, b: FloatArray) -> FloatArray:
    return np.asarray(np.sum(a * b, axis=-1), dtype=np.float64)
