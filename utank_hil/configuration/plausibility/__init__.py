"""Plausibility of a ship with its tank and pump, to find wrong units and slips of a digit.

Each figure is compared with those of real ships, tanks and pumps. A value far outside, by a factor
of a hundred or so, is refused at the key that is most likely wrong; one outside is a warning. The
figures are ratios to the vessel's own size and period, so that a basin model passes like a
container ship. The limits are wide: they find slips and do not judge a design.
"""

from typing import Final

import numpy as np

from utank_hil.base.parameters import Problem
from utank_hil.configuration.plausibility.vessel import free_surface_nm_rad, holding, stages
from utank_hil.dynamics.linear import coupled_matrices
from utank_hil.dynamics.nonlinear import RollModel, righting_range
from utank_hil.dynamics.pump import Pump
from utank_hil.dynamics.ship import RollShip
from utank_hil.dynamics.tank import Tank
from utank_hil.dynamics.valves import Valve

__all__ = ["free_surface_nm_rad", "holding", "tank_problems", "vessel_problems", "vessel_warnings"]

LEAST_RIGHTING_RAD: Final = 0.01
"""Smallest range of righting: below, half a degree of heel would capsize the ship."""


def vessel_problems(
    ship: RollShip, tank: Tank, pump: Pump | None, valve: Valve | None = None
) -> list[Problem]:
    """Return why a vessel is impossible: the first cause, because dependent figures mislead."""
    with np.errstate(all="ignore"):  # Overflowing numbers are refused by their figure.
        for figures in stages(ship, tank, pump, valve):
            if found := [(each.key, each.words) for each in figures if each.refused]:
                return found
    return tank_problems(ship, tank)


def vessel_warnings(
    ship: RollShip, tank: Tank, pump: Pump | None, valve: Valve | None = None
) -> list[Problem]:
    """Return what is unusual in a vessel without problems."""
    return [
        (each.key, each.words)
        for figures in stages(ship, tank, pump, valve)
        for each in figures
        if each.warned
    ]


def tank_problems(ship: RollShip, tank: Tank) -> list[Problem]:
    """Return why a ship can't carry a tank.

    Inertia, stability, and the righting moment over some heel must stay positive with its water.
    """
    mass, _, stiffness = coupled_matrices(ship, tank)
    water = mass[1, 1] * (tank.width_m / 2) ** 2  # about the ship's axis, as in mass_ratio
    if not (0 < water < mass[0, 0] and np.linalg.det(mass) > 0):
        reason = (
            f"has more roll inertia in its water than the ship, {water:.3g} of "
            f"{ship.inertia_kg_m2:.3g} kg m2: make reservoir_area_m2 or width_m smaller, unless "
            "inertia_kg_m2 and stiffness_nm_rad are given in thousands (t m2, kN m), or "
            "displacement_t in kt"
        )
        return [("tank", reason)]
    if not (stiffness[0, 0] > 0 and np.linalg.det(stiffness) > 0):
        reason = (
            f"takes all of the ship's stability by its free surface, "
            f"{free_surface_nm_rad(ship, tank):.3g} of {ship.stiffness_nm_rad:.3g} N m/rad: lower "
            "reservoir_area_m2, width_m or height_m"
        )
        return [("tank", reason)]
    greatest_rad = righting_range(RollModel(ship, tank)).greatest_rad
    if greatest_rad < LEAST_RIGHTING_RAD:
        reason = (
            f"leaves a ship whose righting moment is greatest at {greatest_rad:.2g} rad of heel: "
            "check the ship's righting levers (gz_m with gz_step_rad, or restoring_odd_nm)"
        )
        return [("tank", reason)]
    return []
