"""Joint law of a tank's pump and valve: the valve takes what a throttle can, the pump the rest.

Where a pump law's pressure P takes power from the water, P h' < 0, a throttle can replace the pump.
So the valve's loss zeta is that of `ClippedValve`, and the pump provides the rest::

    P + zeta abs(h') h'  where P h' < 0,  P elsewhere

In slow water the valve has hardly any effect, and the pump provides all of P: slope at rest and
margins are those of the pump law.
"""

from dataclasses import dataclass, replace
from functools import partial
from typing import Literal

import numpy as np

from utank_hil.base.arrays import FloatArray, plausible
from utank_hil.base.parameters import ParameterError
from utank_hil.control.design_plant import DesignPlant
from utank_hil.control.interface import PRESSURE, VALVE, BuiltLaw, LawDesign
from utank_hil.control.semi_active import (
    FLOW,
    ClippedValve,
    built_pump_law,
    on_pump_law,
    throttled,
    valve_range,
)


class PumpWithValve(ClippedValve):
    """A pump law whose pressure is provided by pump and valve together."""

    def step(self, y: FloatArray, reference: FloatArray | None = None) -> FloatArray:
        """Pressure and loss, shape (2,), for the pump law's measurements and the level rate."""
        y = plausible(y)
        flow = float(y[-1])
        pressure = float(self._pump.step(y[: self._measured], reference)[0])
        loss = throttled(self._valve, pressure, flow)
        self._flow = abs(flow) * flow
        if pressure * flow < 0:
            pressure += loss * self._flow
        return np.array([pressure, loss])

    def applied(self, u: FloatArray) -> None:
        """Pass the joint pressure of pump and valve to the pump law."""
        self._pump.applied(np.array([float(u[0]) - float(u[1]) * self._flow]))


@dataclass(frozen=True, slots=True)
class PumpWithValveDesign:
    """Pump and valve together, as a law of a configuration."""

    #: The law whose pressure they provide; it must have a linear form, by which it is judged.
    pump: LawDesign
    kind: Literal["pump_with_valve"] = "pump_with_valve"

    def build(self, plant: DesignPlant) -> BuiltLaw:
        """Design the pump law for a plant."""
        valve, pump = valve_range(plant), built_pump_law(self.pump, plant)
        if pump.linear is None:
            raise ParameterError("", [("pump.kind", "must be of a linear law, as lqg or gpc")])
        return replace(
            pump,
            controller=partial(on_pump_law, PumpWithValve, valve, pump),
            measured=(*pump.measured, FLOW),
            commands=(PRESSURE, VALVE),
            at_rest=True,
        )
