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
from typing import Annotated

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
