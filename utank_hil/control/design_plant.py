"""The plant of a law's design: ship and tank, and the path from sensor to pump."""

from dataclasses import dataclass
from typing import Final

from utank_hil.base.parameters import NotNegative, range_problems, refuse
from utank_hil.control.limits import PumpLimits
from utank_hil.dynamics.linear import pump_model
from utank_hil.dynamics.sampling import LinearModel, sample
from utank_hil.dynamics.ship import RollShip
from utank_hil.dynamics.tank import Tank
from utank_hil.dynamics.valves import ValveRange

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
