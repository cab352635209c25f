"""The plant of a law's design: ship and tank, and the path from sensor to pump."""

import math
from dataclasses import dataclass
from typing import Annotated, Final

from utank_hil.base.parameters import NotNegative, Range, Share, range_problems, refuse
from utank_hil.dynamics import LinearModel, RollShip, Tank
from utank_hil.dynamics.linear import pump_model
from utank_hil.dynamics.sampling import sample
from utank_hil.dynamics.valves import ValveRange

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


_LIMITS: Final = PumpLimits()


@dataclass(frozen=True, slots=True)
class DesignPlant:
    """A ship with its tank, delay, lag and limits."""

    ship: RollShip
    tank: Tank
    #: From the sampling of a measurement to the drive's response to the resulting command.
    delay_s: NotNegative = 0.05
    lag_s: NotNegative = 0.1  #: Time constant of the pump's pressure.
    limits: PumpLimits = _LIMITS  #: On the command, for the laws that plan within them.
    valve: ValveRange | None = None  #: Range of the tank's valve, if any.

    def __post_init__(self) -> None:
        refuse("design plant", range_problems(self))

    def model(self, measured: tuple[str, ...]) -> LinearModel:
        """Continuous model from pump pressure to the outputs `measured`, names of `STATES`."""
        return pump_model(self.ship, self.tank, measured)

    def sampled(self, measured: tuple[str, ...], sample_time_s: float) -> LinearModel:
        """Discrete model from command to `measured`, with lag and delay (`dynamics.sampling`)."""
        return sample(self.model(measured), sample_time_s, self.delay_s, self.lag_s)
