"""Where on board people are, for the judgement of what they feel."""

from dataclasses import dataclass

from utank_hil.base.parameters import Finite, range_problems, refuse
from utank_hil.dynamics.tank import Tank


@dataclass(frozen=True, slots=True)
class Place:
    """A place on board, seen from the ship's centre of gravity.

    Parameters
    ----------
    height_m : float
        Above it.
    starboard_m : float
        To starboard of it.
    """

    height_m: Finite
    starboard_m: Finite = 0.0

    def __post_init__(self) -> None:
        refuse("place", range_problems(self))

    @classmethod
    def over_reservoir(cls, tank: Tank) -> "Place":
        """The deck over the starboard reservoir, where a scenario names no place."""
        return cls(tank.height_m + tank.level_limit_m - tank.lz_m, tank.width_m / 2)
