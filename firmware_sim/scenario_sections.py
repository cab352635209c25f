"""Sections of a scenario: errors of the sensors, limits of the drive."""

from dataclasses import dataclass
from typing import Annotated

from utank_hil.base.parameters import NotNegative, Positive, Range, range_problems, refuse
from utank_hil.base.tick import TICK_NS


@dataclass(frozen=True, slots=True)
class SensorErrors:
    """Errors of the sensors; noise is white and Gaussian, given as standard deviation.

    Raises `ValueError` if a value is out of its range, or the delay is not a multiple of the cycle.
    """

    roll_noise_rad: NotNegative = 2e-4  #: Noise of the motion sensor.
    roll_rate_noise_rad_s: NotNegative = 5e-4  #: Noise of the motion sensor.
    #: Age of the motion sensor's sample when sent, a multiple of its 10 ms cycle; at most 1000, the
    #: longest delay that a law can be designed for.
    motion_delay_ms: Annotated[float, Range(least=0, most=1000)] = 20.0
    level_noise_m: NotNegative = 0.005  #: Noise of each level gauge.
    pressure_noise_pa: NotNegative = 100.0  #: Noise of the pressure sensor.
    #: Level above still water at which a reservoir's high-level switch closes.
    high_level_m: Positive = 4.6
    #: Constant error of the roll, such as that of a misaligned sensor; 0.2 at most.
    roll_bias_rad: Annotated[float, Range(least=-0.2, most=0.2)] = 0.0

    def __post_init__(self) -> None:
        problems = range_problems(self)
        if not problems and self.motion_delay_ms * 1_000_000 % TICK_NS:
            reason = f"must be a multiple of {TICK_NS / 1e6:g}, got {self.motion_delay_ms}"
            problems.append(("motion_delay_ms", reason))
        refuse("sensors", problems)


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
