"""PD control of the level, thesis (3.5): the pump makes the tank the best passive one.

P = -k h - c h', with k and c such that the water in a ship held still has the frequency and damping
ratio of `passive_optimum`. The pump changes the water's stiffness and loss, but not the coupling of
ship and water.
"""

from dataclasses import dataclass
from typing import Final, Literal

import numpy as np

from utank_hil.control.design_plant import DesignPlant
from utank_hil.control.gain import GainLaw
from utank_hil.control.interface import BuiltLaw
from utank_hil.control.optimal_tank import passive_optimum, ship_ratios
from utank_hil.dynamics import RollShip, Tank, coupled_matrices

PD_MEASURED: Final = ("level_m", "level_rate_m_s")


def design_pd(ship: RollShip, tank: Tank, sample_time_s: float = 0.02) -> GainLaw:
    """PD law on `PD_MEASURED` that gives the tank its best frequency and damping.

    The gains assume no delay, so the sample time must be short against the roll period.
    """
    ratios, ship_frequency = ship_ratios(ship, tank)
    best = passive_optimum(ratios)
    mass, damping, stiffness = (matrix[1, 1] for matrix in coupled_matrices(ship, tank))
    frequency = best.frequency_ratio * ship_frequency
    spring = mass * frequency**2 - stiffness
    loss = 2 * best.damping_ratio * frequency * mass - damping
    return GainLaw(np.array([[spring, loss]]) / tank.reservoir_area_m2, sample_time_s)


@dataclass(frozen=True, slots=True)
class PDDesign:
    """PD on the level as a law of a configuration."""

    kind: Literal["pd"] = "pd"

    def build(self, plant: DesignPlant) -> BuiltLaw:
        """Design the law for a plant."""
        law = design_pd(plant.ship, plant.tank)
        return BuiltLaw(law.controller, PD_MEASURED, law)
