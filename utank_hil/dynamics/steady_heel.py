"""Steady heel of a ship under steady moments and pressure, and its righting range."""

import math
from dataclasses import replace
from functools import lru_cache
from typing import Final, NamedTuple

import numpy as np

from utank_hil.base.arrays import FloatArray
from utank_hil.base.elementary import sines_cosines
from utank_hil.dynamics.nonlinear import RollModel

_HEELS_RAD: Final = np.radians(np.linspace(0.0, 89.9, 2000))  # The step is 0.05 degrees.
_HALVINGS: Final = 12  # The result is accurate to a four-thousandth of the pressure.


class SteadyHeel(NamedTuple):
    """A ship at rest; `at_the_end` means that a reservoir is full or empty."""

    roll_rad: float
    at_the_end: bool


class RightingRange(NamedTuple):
    """Range of heel in which a ship rights itself with the water at rest in its tank."""

    greatest_rad: float  #: Heel of the greatest righting moment.
    #: Heel from which it capsizes; infinite if there is none up to 90 degrees.
    vanishing_rad: float


@lru_cache(maxsize=16)  # a vessel's checks ask for it several times
def righting_range(model: RollModel) -> RightingRange:
    """Return the righting range of a ship, without its steady moments."""
    push, _ = _at_rest(upright(model), _HEELS_RAD, 0.0)
    over = np.flatnonzero(push[1:] > 0)
    vanishing_rad = float(_HEELS_RAD[1 + over[0]]) if over.size else math.inf
    before = push[: 1 + over[0]] if over.size else push
    return RightingRange(float(_HEELS_RAD[np.argmin(before)]), vanishing_rad)


def greatest_held_pa(model: RollModel, most_pa: float, within_rad: float) -> float:
    """Return the greatest held pressure, up to `most_pa`, with a heel of `within_rad` at most.

    Steady moments are left out, and the pressure must be raised slowly.
    """
    model = upright(model)

    def is_held(pressure_pa: float) -> bool:
        heel = steady_heel(model, pressure_pa)
        return heel is not None and abs(heel.roll_rad) <= within_rad

    if is_held(most_pa):
        return most_pa
    low_pa, high_pa = 0.0, most_pa
    for _ in range(_HALVINGS):
        middle_pa = (low_pa + high_pa) / 2
        if is_held(middle_pa):
            low_pa = middle_pa
        else:
            high_pa = middle_pa
    return low_pa


def steady_heel(model: RollModel, pressure_pa: float = 0.0) -> SteadyHeel | None:
    """Return the rest position on the side of the steady moment; None if the ship capsizes."""
    side = float(np.sign(_at_rest(model, np.zeros(1), pressure_pa)[0][0]))
    if side == 0:
        return SteadyHeel(0.0, False)
    heels = side * _HEELS_RAD
    push, flat_m = _at_rest(model, heels, pressure_pa)
    back = np.flatnonzero(push * side < 0)
    if not back.size:
        return None
    after = int(back[0])
    share = push[after - 1] / (push[after - 1] - push[after])
    roll_rad = heels[after - 1] + share * (heels[after] - heels[after - 1])
    return SteadyHeel(float(roll_rad), bool(abs(flat_m[after]) > model.coefficients.level_limit))


def upright(model: RollModel) -> RollModel:
    """Return a ship without its steady moments."""
    ship = replace(model.ship, offset_moment_nm=0.0, wind_moment_nm=0.0)
    return RollModel(ship, model.tank)


def _at_rest(
    model: RollModel, roll_rad: FloatArray, pressure_pa: float
) -> tuple[FloatArray, FloatArray]:
    """Return the roll acceleration, and the level of the water without limits."""
    c = model.coefficients
    sine, cosine = sines_cosines(roll_rad)
    flat_m = (c.weight_h * sine + c.area * pressure_pa) / (2 * c.weight_h2 * cosine)
    level_m = np.clip(flat_m, -c.level_limit, c.level_limit)
    still = np.zeros_like(roll_rad)
    states = np.stack([roll_rad, still, level_m, still], axis=-1)
    with np.errstate(all="ignore"):  # Levers may overflow.
        return model.derivative(states, pressure_pa, stopped=True)[:, 1], flat_m
