"""The waves of a scenario for linear predictions: many realisations as one."""

import math
from typing import Final

import numpy as np

from firmware_sim.scenario import Scenario
from utank_hil.dynamics.ship import RollShip
from utank_hil.sea import Harmonics

REALISATIONS: Final = 16
"""A lightly damped ship needs a fine spectrum."""


def pooled_wave_moment(scenario: Scenario, ship: RollShip) -> Harmonics:
    """The sea's moment on the ship, as many realisations with a share of the energy each."""
    seas = [
        scenario.sea.roll_moment(scenario.sea.sea(seed), ship.stiffness_nm_rad)
        for seed in range(REALISATIONS)
    ]
    return Harmonics(
        np.concatenate([sea.amplitude for sea in seas]) / math.sqrt(REALISATIONS),
        np.concatenate([sea.frequency_rad_s for sea in seas]),
        np.concatenate([sea.phase_rad for sea in seas]),
    )
