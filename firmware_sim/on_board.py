"""What the roll of a bench means for people: how often it is great, and how it feels at a place.

Roll is all that the bench knows; sway, heave and pitch add to it on a real ship.
"""

import math
from dataclasses import asdict, dataclass
from typing import Any, Final

import numpy as np

from firmware_sim.bench import BenchResult
from firmware_sim.place import Place
from utank_hil.analysis.motion.comfort import EXPOSURE_S, Comfort, comfort
from utank_hil.analysis.motion.exceedance import exceedance, rayleigh_exceedance
from utank_hil.base.arrays import FloatArray

LEVELS_RAD: Final = tuple(math.radians(degrees) for degrees in (2.5, 5.0, 7.5, 10.0, 15.0, 20.0))
"""Single amplitudes of roll whose exceedance is stated."""
_NO_TANK: Final = "no tank"


@dataclass(frozen=True, slots=True)
class OnBoard:
    """A run, for people.

    Attributes
    ----------
    exceedance : tuple of float, or None
        Shares of the single amplitudes of roll above each of `LEVELS_RAD`; None where the record
        holds no half-cycle.
    rayleigh : tuple of float
        The same of a narrow-banded Gaussian roll of this standard deviation.
    comfort : Comfort
        At the place.
    """

    exceedance: tuple[float, ...] | None
    rayleigh: tuple[float, ...]
    comfort: Comfort


def on_board(roll_rad: FloatArray, step_s: float, place: Place) -> OnBoard:
    """Judge a roll record, shape (n,), n of three or more."""
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


def judged_runs(result: BenchResult) -> dict[str, OnBoard]:
    """The bare ship and the runs that can be compared with it, over the bench's window.

    A ship that capsized lies still, and nothing on board is to be judged.
    """
    from firmware_sim.run import RECORD_S

    place = result.scenario.place_on_board
    rolls = {}
    if result.without_tank_capsized_s >= result.end_s:
        rolls[_NO_TANK] = result.without_tank_rad[round(result.settle_s / RECORD_S) :]
    for run in result.runs:
        if result.compares(run) and run.capsized_s >= result.end_s:
            window = run.between(result.settle_s, result.end_s)
            rolls[run.name] = run.column("true_roll_rad")[window]
    return {name: on_board(roll, RECORD_S, place) for name, roll in rolls.items() if len(roll) >= 3}


def on_board_json(result: BenchResult) -> dict[str, Any]:
    """The figures in SI units, ready for `json.dumps`."""
    return {
        "place": asdict(result.scenario.place_on_board),
        "exposure_s": EXPOSURE_S,
        "levels_rad": list(LEVELS_RAD),
        "runs": {name: asdict(each) for name, each in judged_runs(result).items()},
    }
