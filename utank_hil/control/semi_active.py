"""Semi-active tank: a valve that throttles the water, and no pump (thesis 5.2).

A valve can only take energy out of the water: its pressure -zeta abs(h') h' opposes the flow. Where
a pump pressure P would take power from the water too, P h' < 0, the valve can do in its stead; else
it is best open. So any pump law has its valve law (clipped optimal control)::

    zeta = -P / (abs(h') h')  where P h' < 0, within the valve's range;  open elsewhere

The plain energy law needs no design. In the energy of roll the pump's power is proportional to
P phi' (g_phi > 0, see `feedback_linearization`), so P = -kappa phi' takes the most: the valve shuts
while phi' h' > 0, when the water flows to where it will push the roll on, and opens while it flows
to where it will push back. A large kappa is the on-off law. Holding the water back makes the tank
slower: the law gains in waves slower than the tank and loses in faster ones (docs/controllers.md).

The command is a loss in Pa per (m/s)^2 of dh/dt, as `utank_hil.dynamics.valves` gives it for an
opening. No valve shuts in no time: between two samples it stays where it is.
"""

import math
from dataclasses import dataclass, field

import numpy as np

from utank_hil.arrays import FloatArray
from utank_hil.control.interface import Controller
from utank_hil.parameters import NotNegative, SampleTime, range_problems, refuse


@dataclass(frozen=True, slots=True)
class ValveRange:
    """What the valve can do.

    Parameters
    ----------
    open_loss, shut_loss : float
        Least and greatest loss in Pa per (m/s)^2 of dh/dt.

    Raises
    ------
    ValueError
        If the losses are negative or not in order.
    """

    open_loss: float
    shut_loss: float

    def __post_init__(self) -> None:
        if not 0 <= self.open_loss < self.shut_loss < math.inf:
            raise ValueError(
                f"a valve needs 0 <= open_loss < shut_loss, got {self.open_loss}, {self.shut_loss}"
            )


@dataclass(slots=True, eq=False)
class OnOffValve:
    """Energy law with a valve that is open or shut.

    Parameters
    ----------
    valve : ValveRange
    threshold_rad_m_s2 : float
        The valve moves when the product of roll rate and level rate is beyond this, so that it does
        not chatter on noise.
    sample_time_s : float

    Raises
    ------
    ValueError
        If the threshold is negative or not finite, or the sample time out of its range.
    """

    valve: ValveRange
    threshold_rad_m_s2: NotNegative = 0.0
    sample_time_s: SampleTime = 0.1
    _shut: bool = field(default=False, init=False, repr=False)

    def __post_init__(self) -> None:
        refuse("on-off valve", range_problems(self))

    def step(self, y: FloatArray, reference: FloatArray | None = None) -> FloatArray:  # noqa: ARG002
        """Loss, shape (1,), for `y` = (roll, roll rate, level, level rate)."""
        power = float(y[1]) * float(y[3])
        if abs(power) > self.threshold_rad_m_s2:
            self._shut = power > 0
        return np.array([self.valve.shut_loss if self._shut else self.valve.open_loss])

    def applied(self, u: FloatArray) -> None:
        """Nothing to remember."""

    def reset(self) -> None:
        """Open the valve."""
        self._shut = False


class ClippedValve:
    """Valve in the stead of a pump: what it can do of another law's pressure.

    Parameters
    ----------
    valve : ValveRange
    pump : Controller
        One input; on measurements whose last is the level rate. Its `applied` gets the pressure
        that the valve really made.
    """

    def __init__(self, valve: ValveRange, pump: Controller) -> None:
        self.sample_time_s = pump.sample_time_s
        self._valve = valve
        self._pump = pump
        self._flow = 0.0

    def step(self, y: FloatArray, reference: FloatArray | None = None) -> FloatArray:
        """Loss, shape (1,), for the pump law's measurements `y`."""
        flow = float(y[-1])
        pressure = float(self._pump.step(y, reference)[0])
        self._flow = abs(flow) * flow
        least, greatest = self._valve.open_loss, self._valve.shut_loss
        if pressure * flow >= 0:
            return np.array([least])
        if abs(pressure) >= greatest * abs(self._flow):  # also where the water stands still
            return np.array([greatest])
        return np.array([max(abs(pressure / self._flow), least)])

    def applied(self, u: FloatArray) -> None:
        """Tell the pump's law the pressure of the valve that was really set."""
        self._pump.applied(np.array([-float(u[0]) * self._flow]))

    def reset(self) -> None:
        """Forget the past."""
        self._flow = 0.0
        self._pump.reset()
