"""Errors of the sensors, as a scenario states them."""

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
