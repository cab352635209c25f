"""Limits on the pump's command; see `utank_hil.control.limiter`."""

import math
from dataclasses import dataclass
from typing import Annotated

from utank_hil.base.parameters import NotNegative, Range, Share, range_problems, refuse

_Limit = Annotated[float, Range(above=0, infinite=True)]


@dataclass(frozen=True, slots=True)
class PumpLimits:
    """Limits on the pump's command.

    Parameters
    ----------
    pressure_pa : float
        Greatest pressure, either way.
    rate_pa_s : float
        Greatest rate of change of the command.
    level_m : float
        Greatest level, either way, that the pump may drive the water to.
    power_w : float
        Greatest hydraulic power P At h' from the pump to the water.
    brake_share : float
        Share of `pressure_pa` that the level barrier counts on for braking, 0 to 1.
    sharpness : float
        Sharpness of the level barrier, 1 or more; a greater one acts later and harder.
    lookahead_s : float
        Time ahead at which the level is judged: delay and lag of the pump.

    Raises
    ------
    ValueError
        If a limit is out of its range.
    """

    pressure_pa: _Limit = 50e3
    rate_pa_s: _Limit = 100e3
    level_m: _Limit = 3.85
    power_w: _Limit = math.inf
    brake_share: Share = 0.7
    sharpness: Annotated[float, Range(least=1, infinite=True)] = 2.2
    lookahead_s: NotNegative = 0.25

    def __post_init__(self) -> None:
        refuse("pump limit", range_problems(self))
