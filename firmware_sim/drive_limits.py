"""Limits of the pump drive: a section of a scenario."""

from dataclasses import dataclass
from typing import Annotated

from utank_hil.base.parameters import Positive, Range, range_problems, refuse


@dataclass(frozen=True, slots=True)
class DriveLimits:
    """Limits on commands, set in the drive and independent of the controller."""

    pressure_pa: Positive = 50e3  #: Largest set-point to either side.
    pressure_rate_pa_s: Positive = 250e3  #: Largest rate of the set-point away from zero.
    #: Longest command timeout that the drive accepts, at most 100: by then, according to the safety
    #: manual, the pressure of a dead controller is on its way to zero.
    longest_timeout_ms: Annotated[float, Range(above=0, most=100)] = 100.0
    #: Voltage of the direct-current bus that feeds the drive; 4 to 1000, the range of
    #: DRIVE_STATUS_2.
    bus_voltage_v: Annotated[float, Range(least=4, most=1000)] = 1000.0

    def __post_init__(self) -> None:
        refuse("drive", range_problems(self))
