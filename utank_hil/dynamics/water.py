"""Mass, first moment and inertia of the tank water, exact in the level.

The water fills three straight tubes (port reservoir, duct, starboard reservoir), so every integral
over its mass is a polynomial in the level h.
"""

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from utank_hil.base.arrays import FloatArray
from utank_hil.dynamics.tank import Tank


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
    """Moments of the tank water at the given levels, any shape."""
    h = np.asarray(level_m, dtype=np.float64)
    rho, at, ap = tank.density_kg_m3, tank.reservoir_area_m2, tank.duct_area_m2
    length, height, lx, lz = tank.width_m, tank.height_m, tank.lx_m, tank.lz_m
    zero = np.zeros_like(h)
    mass = rho * (2 * at * height + ap * length)

    # These are integrals of y, z, y^2, z^2, y z over the mass; those of x follow from x = lx.
    first_y = rho * at * length * h
    first_z = rho * (at * (2 * lz * height - height * height - h * h) + ap * length * lz)
    square_y = rho * (at * length * length * height / 2 + ap * length * length * length / 12)
    square_z = rho * (
        at
        * (
            2 * height * height * height / 3
            - 2 * lz * height * height
            + 2 * lz * lz * height
            + 2 * (height - lz) * h * h
        )
        + ap * length * lz * lz
    )
    product_yz = rho * at * length * (lz - height) * h
    slope_y, slope_z = rho * at * length, -2 * rho * at * h
    slope_zz, slope_yz = 4 * rho * at * (height - lz) * h, rho * at * length * (lz - height)

    inertia = np.empty((*h.shape, 3, 3))
    inertia[..., 0, 0] = square_y + square_z
    inertia[..., 1, 1] = mass * lx * lx + square_z
    inertia[..., 2, 2] = mass * lx * lx + square_y
    inertia[..., 0, 1] = inertia[..., 1, 0] = -lx * first_y
    inertia[..., 0, 2] = inertia[..., 2, 0] = -lx * first_z
    inertia[..., 1, 2] = inertia[..., 2, 1] = -product_yz
    inertia_slope = np.zeros((*h.shape, 3, 3))
    inertia_slope[..., 0, 0] = inertia_slope[..., 1, 1] = slope_zz
    inertia_slope[..., 0, 1] = inertia_slope[..., 1, 0] = -lx * slope_y
    inertia_slope[..., 0, 2] = inertia_slope[..., 2, 0] = -lx * slope_z
    inertia_slope[..., 1, 2] = inertia_slope[..., 2, 1] = -slope_yz

    flow = rho * at  # The mass flow per dh/dt is the same along the whole streamline.
    return WaterMoments(
        mass_kg=mass,
        first_kgm=np.stack([zero + mass * lx, first_y, zero + first_z], axis=-1),
        first_slope_kg=np.stack([zero, zero + slope_y, zero + slope_z], axis=-1),
        first_curvature_kg_m=np.array([0.0, 0.0, -2 * flow]),
        inertia_kgm2=inertia,
        inertia_slope_kgm=inertia_slope,
        swirl_kgm=flow
        * np.stack([zero - length * (height + lz), 2 * lx * h, zero + length * lx], axis=-1),
        swirl_slope_kg=np.array([0.0, 2 * flow * lx, 0.0]),
    )
