"""The best passive tank for a ship, as a tank that can be built."""

from dataclasses import dataclass, replace

import numpy as np

from utank_hil.control.optimal_tank import (
    ShipTankRatios,
    passive_optimum,
    roll_magnification,
    ship_ratios,
)
from utank_hil.dynamics.ship import RollShip
from utank_hil.dynamics.tank import GRAVITY_M_S2, Tank

_WAVES = np.geomspace(0.05, 5.0, 4000)
"""Wave frequencies over the roll frequency. Chosen; no study."""


@dataclass(frozen=True, slots=True)
class TankFigures:
    """Dimensionless numbers of a tank."""

    mass_ratio: float  #: As in `ShipTankRatios`, and the next.
    coupling_ratio: float
    frequency_ratio: float  #: Natural frequency of the water over the ship's roll frequency.
    damping_ratio: float  #: Damping ratio of the water.
    peak: float  #: Greatest roll over static roll, over all wave frequencies.
    duct_area_m2: float


def tank_figures(ship: RollShip, tank: Tank) -> TankFigures:
    """Dimensionless numbers of a ship's existing tank."""
    ratios, roll_rad_s = ship_ratios(ship, tank)
    frequency_ratio = tank.natural_frequency_rad_s / roll_rad_s
    roll = roll_magnification(_WAVES, frequency_ratio, tank.damping_ratio, ratios)
    return TankFigures(
        mass_ratio=ratios.mass_ratio,
        coupling_ratio=ratios.coupling_ratio,
        frequency_ratio=frequency_ratio,
        damping_ratio=tank.damping_ratio,
        peak=float(np.abs(roll).max()),
        duct_area_m2=tank.duct_area_m2,
    )


def best_passive_tank(ship: RollShip, tank: Tank) -> Tank:
    """Return the tank with the duct area and damping ratio of the passive optimum, thesis (3.2).

    Reservoirs, width, height and place are kept. The duct's area changes mass and coupling ratio
    too, so area and optimum are iterated to agreement. Raises `ValueError` if the reservoirs alone
    already make the water slower than the optimum.
    """
    for _ in range(50):
        ratios, roll_rad_s = ship_ratios(ship, tank)
        best = passive_optimum(_free(ratios))
        duct_part_m = 2 * GRAVITY_M_S2 / (best.frequency_ratio * roll_rad_s) ** 2
        duct_part_m -= 2 * tank.height_m
        if duct_part_m <= 0:
            raise ValueError(
                f"a tank of height_m {tank.height_m} can't be as fast as the best, "
                f"{best.frequency_ratio * roll_rad_s:.3g} rad/s: lower it"
            )
        area_m2 = tank.width_m * tank.reservoir_area_m2 / duct_part_m
        change = abs(area_m2 / tank.duct_area_m2 - 1)
        tank = replace(tank, duct_area_m2=area_m2, damping_ratio=best.damping_ratio)
        if change < 1e-6:
            break
    return tank


def _free(ratios: ShipTankRatios) -> ShipTankRatios:
    """Return the ratios of a tank built with its frequency ratio, instead of pumped to it."""
    return replace(ratios, static_coupling=None)
