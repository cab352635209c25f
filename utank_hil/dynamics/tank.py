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

from utank_hil.base.parameters import Checked, Finite, NotNegative, Positive, Range, Share

GRAVITY_M_S2 = 9.80665  # Standard gravity (ISO 80000-3).
SWING = 8 / (3 * math.pi)
"""Linear coefficient per amplitude of the rate that takes the work of ``|x'| x'`` in a swing."""
IRREGULAR = math.sqrt(8 / math.pi)
"""As `SWING`, per root mean square of a Gaussian rate."""


@dataclass(frozen=True, slots=True)
class Tank(Checked, owner="tank"):
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

    @property
    def water_kg(self) -> float:
        """Mass of the water."""
        area, duct = self.reservoir_area_m2, self.duct_area_m2
        return self.density_kg_m3 * (2 * area * self.height_m + duct * self.width_m)

    @property
    def water_lever_kgm(self) -> float:
        """First moment of the water at rest, positive below the ship's centre of gravity."""
        height, lz = self.height_m, self.lz_m
        in_duct = self.duct_area_m2 * self.width_m * lz
        in_reservoirs = self.reservoir_area_m2 * (2 * lz * height - height * height)
        return self.density_kg_m3 * (in_reservoirs + in_duct)

    @property
    def water_squares_kg_m2(self) -> tuple[float, float]:
        """Integrals of y^2 and z^2 over the water at rest; their sum is its roll inertia."""
        at, ap, length = self.reservoir_area_m2, self.duct_area_m2, self.width_m
        height, lz, rho = self.height_m, self.lz_m, self.density_kg_m3
        across = at * length * length * height / 2 + ap * length * length * length / 12
        down = 2 * height * height * height / 3 - 2 * lz * height * height + 2 * lz * lz * height
        return rho * across, rho * (at * down + ap * length * lz * lz)

    @property
    def swirl_kgm(self) -> float:
        """Angular momentum of the flow about the roll axis per rate of the level."""
        flow = self.density_kg_m3 * self.reservoir_area_m2
        return -flow * (self.width_m * (self.height_m + self.lz_m))

    @property
    def across_kg(self) -> float:
        """First moment of the water to starboard per level."""
        return self.density_kg_m3 * self.reservoir_area_m2 * self.width_m


def negligible(tank: Tank) -> Tank:
    """Return a tank with 1e-9 of the water, strongly damped: the ship moves as without a tank."""
    return replace(
        tank,
        reservoir_area_m2=1e-9 * tank.reservoir_area_m2,
        duct_area_m2=1e-9 * tank.duct_area_m2,
        damping_ratio=1.0,
    )
