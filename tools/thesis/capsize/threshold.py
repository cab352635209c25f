"""Capsizing of the nonlinear coupled model: equilibria, threshold, safe basin.

All functions use `simulate_batch`, which runs on all cores. A ship counts as capsized when its roll
passes a given angle beyond the saddle.
"""

import math
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from tools.thesis.batch import simulate_batch
from utank_hil.base.arrays import FloatArray
from utank_hil.dynamics import RollModel, WaveMoment
from utank_hil.dynamics.simulate import WaveComponents
from utank_hil.dynamics.tank import negligible

LIMIT_RAD = math.radians(89)  # of the search for equilibria
BLOCK = 256  # amplitudes tried at once in the search for a threshold


class Equilibrium(NamedTuple):
    """An equilibrium of ship and water."""

    roll_rad: float
    level_m: float
    stable: bool  #: True for a minimum of the potential energy; otherwise a saddle.


class Threshold(NamedTuple):
    """Bracket of the smallest amplitude of a regular wave moment that capsizes a ship."""

    #: safe_nm, capsizing_nm: ends of the bracket; the upper one is infinite if no amplitude
    #: capsizes the ship.
    safe_nm: float
    capsizing_nm: float


def without_tank(model: RollModel) -> RollModel:
    """The same ship with a negligible tank: 1e-9 of the water, strongly damped."""
    return RollModel(model.ship, negligible(model.tank))


def equilibria(model: RollModel) -> tuple[Equilibrium, ...]:
    """Equilibria without pressure and waves, up to 89 degrees, from port to starboard.

    The level may be at its limit.
    """
    from scipy.optimize import brentq

    half, limit = model.tank.width_m / 2, model.coefficients.level_limit

    def level(roll: float) -> float:  # the water lies flat, tan(roll) half, as far as it can
        return float(np.clip(math.tan(roll) * half, -limit, limit))

    def moment(roll: float) -> float:
        state = np.array([roll, 0.0, level(roll), 0.0])
        return float(model.derivative(state, stopped=True)[1])

    grid = np.linspace(-LIMIT_RAD, LIMIT_RAD, 2001)
    values = np.array([moment(roll) for roll in grid])
    found = []
    for i in np.flatnonzero(np.sign(values[:-1]) * np.sign(values[1:]) < 0):
        roll = brentq(moment, grid[i], grid[i + 1], xtol=1e-14)
        found.append(Equilibrium(roll, level(roll), bool(values[i] > 0)))
    found += [
        Equilibrium(float(grid[i]), level(grid[i]), bool(values[i - 1] > values[i + 1]))
        for i in np.flatnonzero(values == 0)
    ]
    return tuple(sorted(found))


def capsize_threshold(
    model: RollModel,
    frequency_rad_s: float,
    highest_nm: float,
    *,
    duration_s: float = 300.0,
    phase_rad: float = 0.0,
    cells: int = 4000,
    tolerance: float = 1e-3,
) -> Threshold:
    """Smallest amplitude of a regular wave moment that capsizes a ship initially at rest.

    The safe amplitudes need not form one interval: their boundary is fractal beyond a certain
    forcing, and windows in which it capsizes lie far below the amplitudes that always capsize
    it. So the whole range is searched upwards in steps of 1 / `cells` of it, and finer steps
    refine the first capsize. A window narrower than a step may be missed.

    Parameters
    ----------
    highest_nm : float
        Largest amplitude of the scan.
    phase_rad : float
        Phase in ``amplitude cos(frequency t + phase)``.
    cells : int
        Steps of the search up to `highest_nm`.
    tolerance : float
        Relative width of the bracket.
    """

    def first_capsize(amplitude: FloatArray) -> Threshold | None:
        """The first of rising amplitudes that capsizes it, and the one before."""
        wave = WaveMoment(amplitude[1:, None], [[frequency_rad_s]], [[phase_rad]])
        result = simulate_batch(model, duration_s, wave=wave)
        over = np.flatnonzero(np.isfinite(result.capsized_s))
        return Threshold(*amplitude[over[0] : over[0] + 2].tolist()) if over.size else None

    steps = np.linspace(0, highest_nm, cells + 1)
    blocks = (steps[start : start + BLOCK + 1] for start in range(0, cells, BLOCK))
    found = next(filter(None, map(first_capsize, blocks)), None)
    if found is None:
        return Threshold(highest_nm, math.inf)
    while found.capsizing_nm - found.safe_nm > tolerance * found.capsizing_nm:
        found = first_capsize(np.linspace(found.safe_nm, found.capsizing_nm, BLOCK + 1)) or found
    return found


def safe_basin(
    model: RollModel,
    roll_rad: FloatArray,
    roll_rate_rad_s: FloatArray,
    duration_s: float,
    *,
    wave: WaveComponents | None = None,
) -> npt.NDArray[np.bool_]:
    """Safe basin: the starts that survive, with the water flat and at rest relative to the ship.

    The result has shape (b, a) for rolls of shape (a,) and rates of shape (b,); the sea is calm
    unless a wave is given.
    """
    limit = model.coefficients.level_limit
    roll, rate = np.meshgrid(roll_rad, roll_rate_rad_s)
    level = np.clip(np.tan(roll) * model.tank.width_m / 2, -limit, limit)
    initial = np.stack([roll, rate, level, np.zeros_like(roll)], axis=-1).reshape(-1, 4)
    result = simulate_batch(
        model, duration_s, initial, wave=WaveMoment([], [], []) if wave is None else wave
    )
    return np.asarray(np.isinf(result.capsized_s).reshape(roll.shape))
