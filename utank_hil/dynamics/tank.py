"""The U-tube tank: two reservoirs at the ship's sides, joined by a duct with an axial pump.

Frame and signs, used everywhere in this project: body axes at the ship's centre of gravity, x
forward, y to starboard, z down; roll positive when starboard goes down. The duct's centre lies at
(lx, 0, lz), so a positive lz is below the centre of gravity. The level `h` is positive when the
starboard reservoir stands above its still level and the port one below by the same amount. The tank
angle is tau = h / (L / 2); in a slow static heel it equals the roll angle. A positive pump pressure
raises the starboard level.
"""

import math
from dataclasses import dataclass, replace
from typing import Annotated, NamedTuple

import numpy as np
import numpy.typing as npt

from utank_hil.base.arrays import FloatArray
from utank_hil.base.parameters import (
    Finite,
    NotNegative,
    Positive,
    Range,
    Share,
    range_problems,
    refuse,
)

GRAVITY_M_S2 = 9.80665  # Standard gravity (ISO 80000-3).
SWING = 8 / (3 * math.pi)
"""Linear coefficient per amplitude of the rate that takes the work of ``|x'| x'`` in a swing."""
IRREGULAR = math.sqrt(8 / math.pi)
"""As `SWING`, per root mean square of a Gaussian rate."""


@dataclass(frozen=True, slots=True)
class Tank:
    """Geometry and losses of a U-tube tank."""

    width_m: Positive  #: Duct length L, the distance between the reservoirs' centre lines.
    height_m: Positive  #: Still-water height H of the reservoirs above the duct.
    reservoir_area_m2: Positive  #: Horizontal area At of one reservoir.
    duct_area_m2: Positive  #: Cross-section Ap of the duct.
    lx_m: Finite = 0.0  #: Duct centre forward of the ship's centre of gravity.
    lz_m: Finite = 0.0  #: Duct centre below the ship's centre of gravity.
    density_kg_m3: Positive = 1000.0  #: Density of the tank water.
    #: Linear loss, as the damping ratio of the water's free oscillation in a fixed ship.
    damping_ratio: NotNegative = 0.0
    #: Coefficient zeta of the pressure loss ``zeta rho / 2 |u| u``, u the speed in the duct.
    quadratic_loss: NotNegative = 0.0
    #: Height of the reservoirs' roof above the still level.
    headroom_m: Annotated[float, Range(above=0, infinite=True)] = math.inf
    #: Coefficient of restitution of the level at its limits: 0 plastic, 1 elastic.
    restitution: Share = 0.0

    def __post_init__(self) -> None:
        refuse("tank", range_problems(self))

    @property
    def effective_length_m(self) -> float:
        """Length 2H + L At/Ap of a uniform tube with the same inertia per reservoir area."""
        return 2 * self.height_m + self.width_m * self.reservoir_area_m2 / self.duct_area_m2

    @property
    def natural_frequency_rad_s(self) -> float:
        """Natural frequency sqrt(2 g / (2H + L At/Ap)) of the water in a fixed ship."""
        return math.sqrt(2 * GRAVITY_M_S2 / self.effective_length_m)

    @property
    def loss_pa_per_m_s(self) -> float:
        """Linear pressure loss per reservoir speed dh/dt that gives `damping_ratio`."""
        inertia = self.density_kg_m3 * self.effective_length_m
        return 2 * self.damping_ratio * self.natural_frequency_rad_s * inertia

    @property
    def quadratic_loss_pa_per_m2_s2(self) -> float:
        """Quadratic pressure loss per ``|dh/dt| dh/dt``, from `quadratic_loss`."""
        area_ratio = self.reservoir_area_m2 / self.duct_area_m2
        return self.quadratic_loss * self.density_kg_m3 / 2 * area_ratio * area_ratio

    def linearized(self, rate_m_s: float, share: float = SWING) -> "Tank":
        """Return the tank with the quadratic loss of levels of a rate in the damping ratio.

        The rate is an amplitude, or with `share` `IRREGULAR` a root mean square.
        """
        loss = share * rate_m_s * self.quadratic_loss_pa_per_m2_s2
        critical = 2 * self.natural_frequency_rad_s * self.density_kg_m3 * self.effective_length_m
        ratio = self.damping_ratio + loss / critical
        return replace(self, damping_ratio=ratio, quadratic_loss=0.0)

    @property
    def level_limit_m(self) -> float:
        """Level at which one reservoir is full or the other one is empty, whichever is less."""
        return min(self.headroom_m, self.height_m)


def negligible(tank: Tank) -> Tank:
    """Return a tank with 1e-9 of the water, strongly damped: the ship moves as without a tank."""
    return replace(
        tank,
        reservoir_area_m2=1e-9 * tank.reservoir_area_m2,
        duct_area_m2=1e-9 * tank.duct_area_m2,
        damping_ratio=1.0,
    )


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
