"""Phase plane of a ship in calm water, its safe basin, and the basin's erosion by waves."""

import math
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from tools.thesis.capsize.threshold import Equilibrium, equilibria, erosion, safe_basin
from utank_hil.base.arrays import FloatArray
from utank_hil.dynamics import RollModel, WaveMoment, simulate

NEAR = 0.02  # distance of a trajectory's start from the saddle, relative to its heel
CYCLES = 5  # length of a trajectory in roll periods
COARSE = 4  # stride on the basin's grid for the erosion


class CapsizeMap(NamedTuple):
    """Phase plane of a ship; all starts have the water flat and at rest relative to the ship.

    Attributes
    ----------
    name : str
        Name of the ship in a figure.
    trajectories : tuple of ndarray, shape (k, 2)
        Roll and roll rate in calm water, starting on either side of each saddle.
    roll_rad : ndarray, shape (a,)
    roll_rate_rad_s : ndarray, shape (b,)
        Grid of starts.
    calm, in_waves : ndarray of bool, shape (b, a)
        Whether a start survives.
    wave_nm : float
        Wave moment amplitude of `in_waves`.
    amplitude_nm, area : ndarray, shape (n,)
        Area of the safe basin over the amplitude of the wave moment, relative to calm water.
    """

    name: str
    equilibria: tuple[Equilibrium, ...]
    trajectories: tuple[FloatArray, ...]
    roll_rad: FloatArray
    roll_rate_rad_s: FloatArray
    calm: npt.NDArray[np.bool_]
    in_waves: npt.NDArray[np.bool_]
    wave_nm: float
    amplitude_nm: FloatArray
    area: FloatArray


def phase_grid(model: RollModel, points: int) -> tuple[FloatArray, FloatArray]:
    """Grid of rolls and roll rates that contains the safe basin in calm water.

    Parameters
    ----------
    points : int
        Number in either direction.

    Returns
    -------
    roll_rad, roll_rate_rad_s : ndarray, shape (points,)

    Raises
    ------
    ValueError
        If the ship has no saddle.
    """
    saddle = max((abs(e.roll_rad) for e in equilibria(model) if not e.stable), default=0.0)
    if saddle == 0:
        raise ValueError(
            "the ship has no angle of vanishing stability below 89 degrees, so that nothing bounds "
            "its safe basin: give righting levers that end (restoring_odd_nm or a GZ table)"
        )
    roll, rate = 1.4 * saddle, model.ship.natural_frequency_rad_s * saddle
    return np.linspace(-roll, roll, points), np.linspace(-rate, rate, points)


def capsize_map(
    name: str,
    model: RollModel,
    frequency_rad_s: float,
    wave_nm: float,
    amplitude_nm: FloatArray,
    roll_rad: FloatArray,
    roll_rate_rad_s: FloatArray,
    duration_s: float,
) -> CapsizeMap:
    """Find equilibria, trajectories, safe basins and erosion of one ship.

    Parameters
    ----------
    frequency_rad_s : float
        Frequency of the wave moment, a cosine from the start on.
    wave_nm : float
        Wave moment amplitude for the basin.
    amplitude_nm : ndarray, shape (n,)
        Wave moment amplitudes for the erosion.
    roll_rad, roll_rate_rad_s : ndarray, shape (a,), (b,)
        Grid of starts; the erosion uses every fourth value.
    duration_s : float
        Time that a ship must survive.

    Raises
    ------
    ValueError
        If no start of the grid survives in calm water.
    """
    grid = (roll_rad, roll_rate_rad_s, duration_s)
    still = equilibria(model)
    wave = WaveMoment([wave_nm], [frequency_rad_s], [0.0])
    return CapsizeMap(
        name,
        still,
        tuple(
            _trajectory(model, saddle, side)
            for saddle in still
            if not saddle.stable
            for side in (1 - NEAR, 1 + NEAR)
        ),
        roll_rad,
        roll_rate_rad_s,
        safe_basin(model, *grid),
        safe_basin(model, *grid, wave=wave),
        wave_nm,
        amplitude_nm,
        erosion(
            model,
            amplitude_nm,
            frequency_rad_s,
            roll_rad[::COARSE],
            roll_rate_rad_s[::COARSE],
            duration_s,
        ),
    )


def _trajectory(model: RollModel, saddle: Equilibrium, side: float) -> FloatArray:
    """Roll and roll rate in calm water from near a saddle, until capsizing or for `CYCLES`."""
    limit = model.coefficients.level_limit
    roll = side * saddle.roll_rad
    level = float(np.clip(math.tan(roll) * model.tank.width_m / 2, -limit, limit))
    step_s = 0.02
    steps = round(CYCLES * math.tau / model.ship.natural_frequency_rad_s / step_s)
    run = simulate(model, steps * step_s, (roll, 0.0, level, 0.0), step_s=step_s)
    return run.state[:, :2]
