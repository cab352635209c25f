"""The ship of a starter project."""

from dataclasses import dataclass
from typing import Annotated

from utank_hil.configuration.ship_keys import weather_criterion_period_s
from utank_hil.parameters import Positive, Range, range_problems, refuse


@dataclass(frozen=True, slots=True)
class StarterShip:
    """A ship as a naval architect knows her, without the tank's water.

    Parameters
    ----------
    name : str
    length_m, beam_m : float
    displacement_t : float
    gm_m : float
    roll_period_s : float, optional
        By the weather criterion's formula if not given; then the draught is needed.
    draught_m : float, optional
    roll_damping_ratio : float

    Raises
    ------
    ValueError
        If a value is out of its range, or neither period nor draught is given.
    """

    name: str
    length_m: Positive
    beam_m: Positive
    displacement_t: Positive
    gm_m: Positive
    roll_period_s: Positive | None = None
    draught_m: Positive | None = None
    roll_damping_ratio: Annotated[float, Range(above=0, below=1)] = 0.05

    def __post_init__(self) -> None:
        problems = range_problems(self)
        if self.roll_period_s is None and self.draught_m is None:
            reason = "is needed, or else the draught for the weather criterion's period"
            problems.append(("roll_period_s", reason))
        refuse("ship", problems)

    @property
    def period_s(self) -> float:
        """Roll period, given or by formula."""
        if self.roll_period_s is not None:
            return self.roll_period_s
        assert self.draught_m is not None
        return weather_criterion_period_s(self.beam_m, self.draught_m, self.length_m, self.gm_m)
