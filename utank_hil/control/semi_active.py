"""Semi-active tank: a valve that throttles the water, alone (thesis 5.2) or beside a pump.

A valve can only take energy from the water: its pressure -zeta abs(h') h' opposes the flow. Where
a pump pressure P would take power from the water too, P h' < 0, the valve can replace it; elsewhere
it is best open. So any pump law has its valve law (clipped optimal control)::

    zeta = -P / (abs(h') h')  where P h' < 0, within the valve's range;  open elsewhere

The energy law needs no design. The pump's power in the energy of roll is proportional to P phi'
(g_phi > 0, see `feedback_linearization`), so P = -kappa phi' takes the most: the valve shuts while
phi' h' > 0, when the flow leads to a level that drives the roll, and opens while it leads to one
that opposes it. A large kappa is the on-off law. Holding the water back makes the tank slower: the
law gains in waves slower than the tank and loses in faster ones (docs/control.md).

The command is a loss in Pa per (m/s)^2 of dh/dt, as `utank_hil.dynamics.valves` gives it for an
opening. Between two samples the valve is constant.
"""

from dataclasses import dataclass, field, replace
from functools import partial
from typing import Final, Literal

import numpy as np

from utank_hil.base.arrays import FloatArray, plausible
from utank_hil.base.parameters import Checked, NotNegative, ParameterError, SampleTime
from utank_hil.control.interface import (
    PRESSURE,
    VALVE,
    BuiltLaw,
    Controller,
    DesignPlant,
    LawDesign,
)
from utank_hil.dynamics.linear import STATES
from utank_hil.dynamics.valves import ValveRange

FLOW: Final = "level_rate_m_s"


def throttled(valve: ValveRange, pressure_pa: float, flow_m_s: float) -> float:
    """Loss of a valve, in Pa per (m/s)^2 of dh/dt, that replaces a pump's pressure where it can.

    `flow_m_s` is the level rate dh/dt. The loss is the least where the pressure would drive the
    flow.
    """
    if pressure_pa * flow_m_s >= 0:
        return valve.open_loss
    if abs(pressure_pa) >= valve.shut_loss * flow_m_s * flow_m_s:  # also at vanishing flow
        return valve.shut_loss
    return max(abs(pressure_pa) / (flow_m_s * flow_m_s), valve.open_loss)


@dataclass(slots=True, eq=False)
class OnOffValve(Checked, owner="on-off valve"):
    """Energy law with a valve that is open or shut."""

    valve: ValveRange
    #: The valve moves when the product of roll rate and level rate exceeds this, so that noise does
    #: not make it chatter.
    threshold_rad_m_s2: NotNegative = 0.0
    sample_time_s: SampleTime = 0.1
    _shut: bool = field(default=False, init=False, repr=False)

    def step(self, y: FloatArray, reference: FloatArray | None = None) -> FloatArray:  # noqa: ARG002
        """Loss, shape (1,), for `y` = (roll, roll rate, level, level rate)."""
        power = float(y[1]) * float(y[3])
        if abs(power) > self.threshold_rad_m_s2:
            self._shut = power > 0
        return np.array([self.valve.shut_loss if self._shut else self.valve.open_loss])

    def applied(self, u: FloatArray) -> None:
        """Ignore the command; the law keeps only its valve's position."""

    def reset(self) -> None:
        """Open the valve."""
        self._shut = False


class ClippedValve:
    """A valve that replaces a pump as far as it can provide another law's pressure.

    `pump` has one input; its `applied` receives the actual pressure of the valve. The first
    `measured` of the measurements belong to it, by default all; the last one is the level rate.
    """

    def __init__(self, valve: ValveRange, pump: Controller, measured: int | None = None) -> None:
        self.sample_time_s = pump.sample_time_s
        self._valve = valve
        self._pump = pump
        self._measured = measured
        self._flow = 0.0

    def step(self, y: FloatArray, reference: FloatArray | None = None) -> FloatArray:
        """Loss, shape (1,), for the pump law's measurements `y`."""
        return self._wanted(y, reference)[1:]

    def _wanted(self, y: FloatArray, reference: FloatArray | None) -> FloatArray:
        """The pump law's pressure, and the loss that replaces it."""
        y = plausible(y)
        flow = float(y[-1])
        pressure = float(self._pump.step(y[: self._measured], reference)[0])
        self._flow = abs(flow) * flow
        return np.array([pressure, throttled(self._valve, pressure, flow)])

    def applied(self, u: FloatArray) -> None:
        """Pass the actual pressure of the valve to the pump law."""
        self._pump.applied(np.array([-float(u[0]) * self._flow]))

    def reset(self) -> None:
        """Return to the initial state."""
        self._flow = 0.0
        self._pump.reset()


@dataclass(frozen=True, slots=True)
class OnOffValveDesign(Checked, owner="on-off valve"):
    """The on-off valve as a law of a configuration; parameters as in `OnOffValve`."""

    threshold_rad_m_s2: NotNegative = 0.0
    sample_time_s: SampleTime = 0.1
    kind: Literal["valve_on_off"] = "valve_on_off"

    def build(self, plant: DesignPlant) -> BuiltLaw:
        """Design the law for a plant."""
        make = partial(OnOffValve, valve_range(plant), self.threshold_rad_m_s2, self.sample_time_s)
        return BuiltLaw(make, STATES, commands=(VALVE,))


@dataclass(frozen=True, slots=True)
class ClippedValveDesign:
    """A valve in place of a pump, as a law of a configuration."""

    pump: LawDesign  #: The law whose pressure the valve provides as far as a throttle can.
    kind: Literal["valve_clipped"] = "valve_clipped"

    def build(self, plant: DesignPlant) -> BuiltLaw:
        """Design both laws for a plant."""
        valve, pump = valve_range(plant), built_pump_law(self.pump, plant)
        if not pump.closes_loop:  # no throttle rolls a ship
            raise ParameterError("", [("pump.kind", "must be of a law that takes roll, as lqg")])
        make = partial(on_pump_law, ClippedValve, valve, pump)
        return BuiltLaw(make, (*pump.measured, FLOW), commands=(VALVE,))


def on_pump_law(kind: type[ClippedValve], valve: ValveRange, pump: BuiltLaw) -> Controller:
    """Return a new controller; a module-level function, so that it can be pickled."""
    return kind(valve, pump.controller(), len(pump.measured))


def built_pump_law(design: LawDesign, plant: DesignPlant) -> BuiltLaw:
    """Design the pump law under the key `pump` of another law."""
    try:
        pump = design.build(plant)
    except ParameterError as error:
        problems = [(f"pump.{name}".rstrip("."), reason) for name, reason in error.problems]
        raise ParameterError("", problems) from error
    if pump.commands != (PRESSURE,):
        raise ParameterError("", [("pump", "must be a law that drives a pump")])
    return pump


def valve_range(plant: DesignPlant) -> ValveRange:
    """Range of the plant's valve."""
    if plant.valve is None:
        raise ParameterError("", [("kind", "throttles a valve, but the vessel has none")])
    return plant.valve


class PumpWithValve(ClippedValve):
    """A pump law whose pressure is provided by pump and valve together.

    Where the pump law's pressure P takes power from the water, P h' < 0, a throttle can replace the
    pump. So the valve's loss zeta is that of `ClippedValve`, and the pump provides the rest::

        P + zeta abs(h') h'  where P h' < 0,  P elsewhere

    In slow water the valve has hardly any effect, and the pump provides all of P: slope at rest and
    margins are those of the pump law.
    """

    def step(self, y: FloatArray, reference: FloatArray | None = None) -> FloatArray:
        """Pressure and loss, shape (2,), for the pump law's measurements and the level rate."""
        wanted = self._wanted(y, reference)
        if wanted[0] * self._flow < 0:
            wanted[0] += wanted[1] * self._flow
        return wanted

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
