"""Tanks of other mass and frequency in the same place, and the roll that they leave."""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Final

from utank_hil.analysis.loop.sea_response import at_its_motion, motion_in_sea
from utank_hil.analysis.tank_response import roll_without_tank
from utank_hil.analysis.tank_sizing import MOST_STABILITY_SHARE, stability_taken, tank_cost
from utank_hil.control import DesignPlant
from utank_hil.dynamics.ship import RollShip
from utank_hil.dynamics.tank import GRAVITY_M_S2, Tank
from utank_hil.sea import Harmonics

STABILITY_SHARES: Final = (0.04, 0.08, 0.12, 0.16, 0.2, MOST_STABILITY_SHARE)
"""Shares of stability of a sweep. Chosen; no study."""
FREQUENCY_RATIOS: Final = (0.7, 0.8, 0.9, 1.0, 1.1, 1.25, 1.4)
"""Frequency ratios of a sweep. Chosen; no study."""


@dataclass(frozen=True, slots=True)
class SweptTank:
    """One tank of a sweep; the roll is a linear prediction for the passive tank."""

    stability_share: float  #: Share of the ship's stability that its free surface takes.
    frequency_ratio: float  #: Frequency of the water per roll frequency.
    reservoir_area_m2: float
    duct_area_m2: float
    water_t: float
    roll_rms_rad: float
    level_rms_m: float
    passive_below_no_tank: float


def sweep_tank(plant: DesignPlant, wave_moment: Harmonics) -> tuple[SweptTank, ...]:
    """Predict the roll in waves (moment in N m) for tanks of other mass and frequency.

    Losses are unchanged. The reservoirs' area gives the share of stability, the duct's the
    frequency; tanks that no duct makes fast enough are left out.
    """
    bare_rad = roll_without_tank(plant, wave_moment)
    return tuple(_swept(plant, wave_moment, bare_rad))


def _swept(plant: DesignPlant, waves: Harmonics, bare_rad: float) -> Iterator[SweptTank]:
    for share in STABILITY_SHARES:
        for ratio in FREQUENCY_RATIOS:
            tank = _varied(plant.ship, plant.tank, share, ratio)
            if tank is None:
                continue
            moving = at_its_motion(None, replace(plant, tank=tank), (), waves)
            motion = motion_in_sea(None, moving, (), waves)
            yield SweptTank(
                share,
                ratio,
                tank.reservoir_area_m2,
                tank.duct_area_m2,
                tank_cost(plant.ship, tank).water_t,
                motion.roll_rms_rad,
                motion.level_rms_m,
                1 - motion.roll_rms_rad / bare_rad,
            )


def _varied(ship: RollShip, tank: Tank, share: float, ratio: float) -> Tank | None:
    area_m2 = tank.reservoir_area_m2 * share / stability_taken(ship, tank)
    frequency_rad_s = ratio * ship.natural_frequency_rad_s
    duct_part_m = 2 * GRAVITY_M_S2 / frequency_rad_s**2 - 2 * tank.height_m
    if duct_part_m <= 0:
        return None
    duct_m2 = tank.width_m * area_m2 / duct_part_m
    return replace(tank, reservoir_area_m2=area_m2, duct_area_m2=duct_m2)
