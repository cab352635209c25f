"""What the pump drive takes from a command: a section of a scenario."""

from dataclasses import dataclass
from typing import Annotated

from utank_hil.base.parameters import Positive, Range, range_problems, refuse


@dataclass(frozen=True, slots=True)
class DriveLimits:
    """What the drive takes from a command, set in the drive and not by the controller.

    Attributes
    ----------
    pressure_pa : float
        Largest set-point to either side.
    pressure_rate_pa_s : float
        Largest change of the set-point away from zero.
    longest_timeout_ms : float
        Longest command timeout the drive agrees to, 100 at most: so long after the last command
        the safety manual has a dead controller's pressure on its way to zero.
    bus_voltage_v : float
        Direct-current bus the drive feeds from; 4 to 1000, the range of DRIVE_STATUS_2.
    """

    pressure_pa: Positive = 50e3
    pressure_rate_pa_s: Positive = 250e3
    longest_timeout_ms: Annotated[float, Range(above=0, most=100)] = 100.0
    bus_voltage_v: Annotated[float, Range(least=4, most=1000)] = 1000.0

    def __post_init__(self) -> None:
        refuse("drive", range_problems(self))
