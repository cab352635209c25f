"""The heel at which a ship comes to rest under steady moments and pressure, at any angle."""

from typing import Final, NamedTuple

import numpy as np

from utank_hil.dynamics.nonlinear import RollModel

_HEELS_RAD: Final = np.radians(np.linspace(0.0, 89.9, 2000))


class SteadyHeel(NamedTuple):
    """A ship at rest.

    Attributes
    ----------
    at_the_end : bool
        A reservoir is full or empty.
    """

    roll_rad: float
    at_the_end: bool


def steady_heel(model: RollModel, pressure_pa: float = 0.0) -> SteadyHeel | None:
    """Where a ship comes to rest to the side to which she is pushed; None if she capsizes.

    Parameters
    ----------
    model : RollModel
        With the steady moments of its ship.
    pressure_pa : float
        Of the pump, held.
    """
    c = model.coefficients

    def pushed(roll_rad: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Roll acceleration, and the level that the water would have if there were room."""
        flat_m = c.weight_h * np.tan(roll_rad) / (2 * c.weight_h2)
        flat_m = flat_m + c.area * pressure_pa / (2 * c.weight_h2 * np.cos(roll_rad))
        level_m = np.clip(flat_m, -c.level_limit, c.level_limit)
        at_rest = np.zeros_like(roll_rad)
        states = np.stack([roll_rad, at_rest, level_m, at_rest], axis=-1)
        return model.derivative(states, pressure_pa, stopped=True)[:, 1], flat_m

    side = float(np.sign(pushed(np.zeros(1))[0][0]))
    if side == 0:
        return SteadyHeel(0.0, False)
    heels = side * _HEELS_RAD
    push, flat_m = pushed(heels)
    back = np.flatnonzero(push * side < 0)
    if not back.size:
        return None
    after = int(back[0])
    share = push[after - 1] / (push[after - 1] - push[after])
    roll_rad = heels[after - 1] + share * (heels[after] - heels[after - 1])
    return SteadyHeel(float(roll_rad), bool(abs(flat_m[after]) > c.level_limit))
