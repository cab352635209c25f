"""Places on board where motion comfort is judged."""

from dataclasses import dataclass

from utank_hil.base.parameters import Finite, range_problems, refuse
from utank_hil.dynamics.tank import Tank


@dataclass(frozen=True, slots=True)
class Place:
    """Place on board, relative to the ship's centre of gravity."""

    height_m: Finite  #: Height above the centre of gravity.
    starboard_m: Finite = 0.0  #: Distance to starboard of the centre of gravity.

    def __post_init__(self) -> None:
        refuse("place", range_problems(self))

    @classmethod
    def over_reservoir(cls, tank: Tank) -> "Place":
        """Place on the deck over the starboard reservoir, the default of a scenario."""
        return cls(tank.height_m + tank.level_limit_m - tank.lz_m, tank.width_m / 2)
