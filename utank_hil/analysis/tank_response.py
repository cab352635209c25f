"""Linear roll of a ship with a tank in regular waves, beside the energy of a sea."""

from dataclasses import dataclass, replace

import numpy as np

from utank_hil.analysis.loop.margins import closed_loop_response
from utank_hil.analysis.loop.sea_response import (
    CalmSeaError,
    at_its_motion,
    at_work,
    rms,
    roll_response_without_tank,
)
from utank_hil.base.arrays import ComplexArray, FloatArray
from utank_hil.control import BuiltLaw, DesignPlant, SeaModel
from utank_hil.dynamics import STATES, RollShip
from utank_hil.dynamics.tank import negligible
from utank_hil.sea import Harmonics

_BANDS = 40  # Number of bands of the sea's energy. Chosen; no study.


def expected_sea(ship: RollShip, wave_moment: Harmonics) -> SeaModel:
    """Return the sea of a roll moment in N m as a law expects it, up to four roll frequencies.

    Raises `CalmSeaError` if it has no waves up to twice the roll frequency.
    """
    w, energy = wave_moment.frequency_rad_s, np.square(wave_moment.amplitude)
    own_rad_s = ship.natural_frequency_rad_s
    bands, edges = np.histogram(w, 2 * _BANDS, (0.0, 4 * own_rad_s), weights=energy)
    if not bands[:_BANDS].any():
        raise CalmSeaError(
            f"the sea has no waves below {2 * own_rad_s:.2g} rad/s, twice the roll frequency, or "
            "none from the side: it does not roll the ship"
        )
    density = bands / 2 / np.diff(edges) / ship.stiffness_nm_rad**2
    return SeaModel.of_slope((edges[1:] + edges[:-1]) / 2, density)


@dataclass(frozen=True, slots=True, eq=False)
class RollCurves:
    """Roll over static roll in regular waves, and the distribution of the sea's energy."""

    period_s: FloatArray  #: shape (N,): wave periods.
    #: without_tank, passive: shape (N,)
    without_tank: FloatArray
    passive: FloatArray
    active: FloatArray | None  #: shape (N,)
    #: sea_period_s, sea: shape (M,): energy of the moment in each band over that of the greatest
    #: band.
    sea_period_s: FloatArray
    sea: FloatArray


def roll_curves(plant: DesignPlant, waves: Harmonics, law: BuiltLaw | None) -> RollCurves:
    """Roll over static roll in regular waves of half to twice the roll period.

    The tank has the loss of its passive motion in the sea, of which `waves` are the roll moment.
    """
    ship, plant = plant.ship, at_work(plant, waves)
    own = ship.natural_frequency_rad_s
    w = own * np.geomspace(0.5, 2.0, 300)
    roll = STATES.index("roll_rad")

    def magnified(response: ComplexArray) -> FloatArray:
        size: FloatArray = np.abs(response) * ship.stiffness_nm_rad
        return size

    active = None
    if law is not None and law.linear is not None:
        motions, _ = closed_loop_response(law.linear, plant, law.linear_measured, w)
        active = magnified(motions[:, roll])
    passive, _ = closed_loop_response(None, plant, (), w)
    edges = own * np.geomspace(0.5, 2.0, _BANDS + 1)
    energy, _ = np.histogram(waves.frequency_rad_s, edges, weights=np.square(waves.amplitude))
    density = energy / np.diff(edges)
    return RollCurves(
        period_s=2 * np.pi / w,
        without_tank=magnified(roll_response_without_tank(ship, w)),
        passive=magnified(passive[:, roll]),
        active=active,
        sea_period_s=2 * np.pi / np.sqrt(edges[1:] * edges[:-1]),
        sea=density / max(density.max(), 1e-300),
    )


def roll_without_tank(plant: DesignPlant, waves: Harmonics) -> float:
    """Roll RMS of the ship alone."""
    bare = at_its_motion(None, replace(plant, tank=negligible(plant.tank)), (), waves).ship
    return rms(roll_response_without_tank(bare, waves.frequency_rad_s), waves)
