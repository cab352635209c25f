"""Waves of a scenario for linear predictions: many realisations in one sum."""

import math
from typing import Final

import numpy as np

from firmware_sim.scenario import Scenario
from utank_hil.sea import Harmonics

REALISATIONS: Final = 16
"""Number of realisations: a lightly damped ship needs a fine spectrum. Chosen; no study."""


def pooled_wave_moment(scenario: Scenario) -> Harmonics:
    """Wave moment on the ship: many realisations, each with an equal share of the energy."""
    seas = [scenario.wave_moment(seed) for seed in range(REALISATIONS)]
    return Harmonics(
        np.concatenate([sea.amplitude for sea in seas]) / math.sqrt(REALISATIONS),
        np.concatenate([sea.frequency_rad_s for sea in seas]),
        np.concatenate([sea.phase_rad for sea in seas]),
    )
