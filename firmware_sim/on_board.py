"""Effect of a bench's roll on people: its exceedance, and the comfort at a place.

The bench knows roll alone; sway, heave and pitch add to it on a real ship.
"""

import math
from dataclasses import dataclass
from typing import Final

import numpy as np

from firmware_sim.place import Place
from utank_hil.analysis.motion.comfort import Comfort, comfort
from utank_hil.analysis.motion.statistics import exceedance, rayleigh_exceedance
from utank_hil.base.arrays import FloatArray

LEVELS_RAD: Final = tuple(math.radians(degrees) for degrees in (2.5, 5.0, 7.5, 10.0, 15.0, 20.0))
"""Single amplitudes of roll whose exceedance is stated."""


@dataclass(frozen=True, slots=True)
class OnBoard:
    """Effect of a run's roll on people."""

    #: Shares of the single amplitudes of roll above each of `LEVELS_RAD`; None for a record without
    #: a half-cycle.
    exceedance: tuple[float, ...] | None
    #: The shares for a narrow-banded Gaussian roll of the same standard deviation.
    rayleigh: tuple[float, ...]
    comfort: Comfort  #: Comfort at the place.


def on_board(roll_rad: FloatArray, step_s: float, place: Place) -> OnBoard:
    """Judge a roll record of shape (n,), n at least 3."""
    levels = np.array(LEVELS_RAD)
    try:
        above: tuple[float, ...] | None = tuple(exceedance(roll_rad, levels).tolist())
    except ValueError:
        above = None
    deviation = float(roll_rad.std())
    rayleigh = rayleigh_exceedance(deviation, levels) if deviation > 0 else 0 * levels
    return OnBoard(
        above,
        tuple(rayleigh.tolist()),
        comfort(roll_rad, np.gradient(roll_rad, step_s), step_s, place.height_m, place.starboard_m),
    )
