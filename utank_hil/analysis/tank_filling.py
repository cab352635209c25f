"""Filling advice: the still level of the tank that rolls a ship least, loading by loading.

The tank's walls stay. Another still level H changes the water's period by 2H + L At/Ap, the mass
of the water, and the room below the roof; the free surface is the same. Another loading is a ship
of another displacement and GM: its inertia follows the displacement (the same radius of gyration),
its damping ratio stays, and so does the waves' slope. The tank's height above the ship's centre of
gravity is taken as it is in the file.
"""

from collections.abc import Iterable
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from utank_hil.analysis.loop.sea_response import at_its_motion, motion_in_sea
from utank_hil.analysis.tank_response import roll_without_tank
from utank_hil.analysis.tank_sizing import tank_cost
from utank_hil.control import DesignPlant
from utank_hil.dynamics import GRAVITY_M_S2, RollShip, Tank
from utank_hil.sea import Harmonics

SHARES: Final = tuple(np.linspace(0.1, 0.9, 33).tolist())
"""Still levels that are tried, over the height of the reservoirs."""


@dataclass(frozen=True, slots=True)
class Filling:
    """The best filling for one loading, and what it does in a sea."""

    displacement_t: float
    gm_m: float  #: Without the tank's free surface.
    roll_period_s: float
    level_m: float  #: Still level above the duct.
    water_t: float
    water_period_s: float
    gm_loss_m: float  #: By the tank's free surface.
    #: without_tank_rad, passive_rad: roll RMS.
    without_tank_rad: float
    passive_rad: float
    tuned: bool  #: False if the best level is the least or greatest that the tank can take.

    @property
    def passive_below_no_tank(self) -> float:
        """Reduction of the roll by the passive tank, as a share."""
        return 1 - self.passive_rad / self.without_tank_rad


def loaded(ship: RollShip, displacement_t: float, gm_m: float) -> RollShip:
    """Return the ship in another loading; it is linear, without a curve of levers."""
    weight_n = 1e3 * displacement_t * GRAVITY_M_S2
    heavier, stiffness = weight_n / ship.displacement_n, weight_n * gm_m
    stiffer = stiffness / ship.stiffness_nm_rad
    return replace(
        ship,
        inertia_kg_m2=heavier * ship.inertia_kg_m2,
        stiffness_nm_rad=stiffness,
        damping_nms_rad=(heavier * stiffer) ** 0.5 * ship.damping_nms_rad,
        displacement_n=weight_n,
        gz_m=(),
    )


def fillings(
    plant: DesignPlant,
    wave_moment: Harmonics,
    loadings: Iterable[tuple[float, float]],
    pump_pa: float = 0.0,
) -> tuple[Filling, ...]:
    """Return the best filling for each loading (displacement in t, GM in m) in the same waves.

    `wave_moment` is in N m on the plant's ship, `pump_pa` the pump's greatest pressure, 0 without
    one. A level counts if its significant motion, and beside it what the pump can hold, stay within
    the reservoirs; where none does, the one of least roll is taken and is not `tuned`.

    Raises `ValueError` if the ship has no displacement or the tank no roof.
    """
    if not plant.ship.displacement_n > 0:
        raise ValueError("ship.displacement_t is needed to tell GM from stiffness: state it")
    roof_m = plant.tank.height_m + plant.tank.headroom_m
    if not np.isfinite(roof_m):
        raise ValueError("tank.headroom_m is needed, as the roof limits the filling: state it")
    held_m = pump_pa / (2 * plant.tank.density_kg_m3 * GRAVITY_M_S2)
    return tuple(_best(plant, wave_moment, roof_m, held_m, *loading) for loading in loadings)


def _best(
    plant: DesignPlant,
    wave_moment: Harmonics,
    roof_m: float,
    held_m: float,
    displacement_t: float,
    gm_m: float,
) -> Filling:
    ship = loaded(plant.ship, displacement_t, gm_m)
    scale = ship.stiffness_nm_rad / plant.ship.stiffness_nm_rad
    waves = replace(wave_moment, amplitude=scale * wave_moment.amplitude)
    tried: list[tuple[bool, float, Tank]] = []
    for share in SHARES:
        tank = replace(plant.tank, height_m=share * roof_m, headroom_m=(1 - share) * roof_m)
        each = at_its_motion(None, replace(plant, ship=ship, tank=tank), (), waves)
        motion = motion_in_sea(None, each, (), waves)
        full = 2 * motion.level_rms_m + held_m > tank.level_limit_m
        tried.append((full, motion.roll_rms_rad, tank))
    at = min(range(len(tried)), key=lambda k: tried[k][:2])
    full, roll_rad, tank = tried[at]
    inside = 0 < at < len(tried) - 1 and not (tried[at - 1][0] or tried[at + 1][0])
    cost = tank_cost(ship, tank)
    assert cost.gm_loss_m is not None
    return Filling(
        displacement_t=displacement_t,
        gm_m=gm_m,
        roll_period_s=2 * np.pi / ship.natural_frequency_rad_s,
        level_m=tank.height_m,
        water_t=cost.water_t,
        water_period_s=cost.water_period_s,
        gm_loss_m=cost.gm_loss_m,
        without_tank_rad=roll_without_tank(replace(plant, ship=ship, tank=tank), waves),
        passive_rad=roll_rad,
        tuned=inside and not full,
    )
