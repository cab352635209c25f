"""Limits on the pump's command; see `utank_hil.control.limiter`."""

import math
from dataclasses import dataclass
from typing import Annotated

from utank_hil.base.parameters import NotNegative, Range, Share, range_problems, refuse

_Limit = Annotated[float, Range(above=0, infinite=True)]


@dataclass(frozen=True, slots=True)
class PumpLimits:
    """Limits on the pump's command."""

    pressure_pa: _Limit = 50e3  #: Greatest pressure, either way.
    rate_pa_s: _Limit = 100e3  #: Greatest rate of change of the command.
    level_m: _Limit = 3.85  #: Greatest level, either way, that the pump may drive the water to.
    power_w: _Limit = math.inf  #: Greatest hydraulic power P At h' from the pump to the water.
    #: Share of `pressure_pa` that the level barrier counts on for braking, 0 to 1.
    brake_share: Share = 0.7
    #: Sharpness of the level barrier, 1 or more; a greater one acts later and harder.
    sharpness: Annotated[float, Range(least=1, infinite=True)] = 2.2
    #: Time ahead at which the level is judged: delay and lag of the pump.
    lookahead_s: NotNegative = 0.25

    def __post_init__(self) -> None:
        refuse("pump limit", range_problems(self))
