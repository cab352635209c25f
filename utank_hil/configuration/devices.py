"""Section ``devices`` of a ship's file: what is on the bus in the place of the native nodes."""

import math
from collections.abc import Iterator
from dataclasses import replace
from typing import Annotated, Any, Final

from pydantic import Field, model_validator

from utank_hil.base.parameters import Problem, Range, refuse
from utank_hil.canbus import messages
from utank_hil.canbus.catalogue import load_catalogue
from utank_hil.canbus.enumerations import Address
from utank_hil.canbus.frame import BUS_SHIFT, MOST_BUSES, STANDARD, Frame
from utank_hil.canbus.line_names import LINES
from utank_hil.canbus.profiles import drive_plan as cia
from utank_hil.canbus.profiles.acting import PROOF
from utank_hil.canbus.profiles.device_plan import (
    COMMANDS,
    Authentication,
    DevicePlan,
    ForeignDevices,
)
from utank_hil.canbus.profiles.field import SignalPlan
from utank_hil.configuration.device_section import NATIVE_NODE, DeviceSection
from utank_hil.configuration.device_sections import (
    LEAST_GAIN,
    LEAST_PHASE_DEG,
    NATIVE_DRIVE,
    AuthenticationSection,
    CommandSection,
    DriveSection,
    Id11,
    Id29,
    NodeNumber,
    Pgn,
)
from utank_hil.configuration.files import Section
from utank_hil.control.pressure_loop import LoopMargins
from utank_hil.dynamics.pump import Pump
from utank_hil.dynamics.valves import Valve
from utank_hil.nodes.redundancy import Redundancy
from utank_hil.safety.safety_limits import SafetyLimits

_OF_DRIVE: Final = (cia.SENT_1, cia.SENT_2, cia.SDO_ANSWER)
"""What the controller itself has the drive send, by function (CiA 301)."""
MOST_CYCLE_MS: Final = 50.0
"""The monitors look at motion and levels every 50 ms and take a gap of 100 ms as a loss: below 20
Hz they see nothing."""
NATIVE_PUMP_MS: Final = 20.0  #: Cycle of SENSOR_PUMP.


class ValveSection(DeviceSection):
    """Valve of the tank."""

    commands: Annotated[dict[str, CommandSection], Field(default_factory=dict)]
    """What it is told, each 20 ms: `opening`; `follow`, without which it goes to its fail position;
    `reset` of a fault."""
    controller_node: NodeNumber = 127  #: CANopen node that the controller's heartbeat is from.
    heartbeat_ms: Annotated[int, Range(least=20, most=100)] = 50
    """Time without the controller's heartbeat after which a CANopen valve goes to what `require`
    says of its outputs."""

    @property
    def told(self) -> str:
        """Name of the message that the valve is commanded with."""
        return next((each.to.partition(".")[0] for each in self.commands.values()), "")

    @property
    def of_one_bit(self) -> bool:
        """Whether it can only be told to open or to shut."""
        layout = self._field(self.commands["opening"].to) if "opening" in self.commands else None
        return layout is not None and layout.bits == 1

    def problems(self, kind: type[tuple[Any, ...]]) -> Iterator[Problem]:
        """What is wrong with the valve; a native one is right."""
        yield from super().problems(kind)
        if self.native:
            return
        if "opening" not in self.commands:
            yield "commands.opening", "is required but missing"
        for name, each in self.commands.items():
            message, key = each.to.partition(".")[0], f"commands.{name}"
            layout = self._field(each.to)
            if name not in COMMANDS:
                yield key, f"is no command; there are {', '.join(COMMANDS)}"
            elif layout is None:
                yield f"{key}.to", f"{each.to!r} is no signal of messages: write MESSAGE.SIGNAL"
            elif message != self.told:
                yield f"{key}.to", f"is not in {self.told}: all commands go in one message"
            elif each.scale is None and layout.unit not in ("", "%"):
                yield f"{key}.scale", f"is required: {each.to} has the unit {layout.unit!r}"
            elif not layout.scale or each.scale == 0:
                yield f"{key}.scale", f"must not be 0, nor that of {each.to}"
        if any(each.from_.partition(".")[0] == self.told for each in self.signals.values()):
            yield "commands", f"{self.told} is what the valve sends: it is told by another message"

    def valve_problems(self, valve: Valve | None) -> Iterator[Problem]:
        """What does not fit to the ship's valve."""
        if self.native:
            return
        if valve is None:
            yield "devices.valve", "is a valve, but the ship has none: add it, or leave this out"
        elif "is_open" in self.signals and (self.age_ms or 0) < 1.2e3 * valve.opening_time_s:
            least_ms = 1.2e3 * valve.opening_time_s
            reason = (
                f"must be {least_ms:g} or more, its way and a fifth: between its switches nobody "
                "knows where it stands"
            )
            yield "devices.valve.age_ms", reason

    def plan(
        self, kind: type[tuple[Any, ...]], name: str, bus: int, *, silent: bool = False
    ) -> DevicePlan[Any]:
        """The valve as it is commanded and heard."""
        plan = super().plan(kind, name, bus, silent=silent)
        section = self.messages[self.told]
        signals = []
        for command, each in self.commands.items():
            layout = section.signals[each.to.partition(".")[2]]
            factor, field = self._factor(each, layout), layout.field(section.bytes)
            place = COMMANDS.index(command)
            signals.append(SignalPlan(place, field, factor, each.offset, each.sign, -1e300, 1e300))
        told = next(each for each in plan.messages if each.name == self.told)
        tag = bus << BUS_SHIFT | STANDARD
        beat = Frame(
            tag | cia.HEARTBEAT + self.controller_node, bytes((cia.NetworkState.OPERATIONAL,))
        )
        return replace(
            plan,
            messages=tuple(each for each in plan.messages if each is not told),
            command=replace(told, signals=tuple(signals)),
            beat=beat if plan.steps else None,
        )

    def _steps(self) -> Iterator[cia.Step]:
        yield from super()._steps()
        consumed = self.controller_node << 16 | self.heartbeat_ms
        remedy = "a valve that does not watch the controller's heartbeat stays where it is"
        yield cia.Step(cia.HEARTBEAT_CONSUMER, consumed, f"{remedy}: take another one")


class PanelSection(DeviceSection):
    """The first operator station."""

    authentication: AuthenticationSection | None = None
    """A key that the panel must have to arm; stop never asks for it."""

    def problems(self, kind: type[tuple[Any, ...]]) -> Iterator[Problem]:
        """What is wrong with the panel; a native one is right."""
        yield from super().problems(kind)
        of = self.authentication
        used = {path.partition(".")[0] for _, path in self._paths()}
        for name in () if of is None else ("challenge", "proof"):
            message = self.messages.get(getattr(of, name))
            if message is None or message.bytes != PROOF or getattr(of, name) in used:
                yield f"authentication.{name}", f"must be a message of its own with {PROOF} bytes"
        orders = {each.from_.partition(".")[0] for each in self.signals.values()}
        if of is not None and len(orders) > 1:
            yield "authentication", f"needs one message with all buttons, not {len(orders)}"

    def plan(
        self, kind: type[tuple[Any, ...]], name: str, bus: int, *, silent: bool = False
    ) -> DevicePlan[Any]:
        """The panel as it is heard."""
        plan, of = super().plan(kind, name, bus, silent=silent), self.authentication
        if of is None:
            return plan
        by_name = {each.name: each for each in plan.messages}
        challenge, proof = by_name.pop(of.challenge), by_name.pop(of.proof)
        found = Authentication(challenge.can_ids[-1], proof.can_ids, of.key)
        return replace(plan, messages=tuple(by_name.values()), authentication=found)


NATIVE_PANEL: Final = PanelSection.model_validate({})
NATIVE_VALVE: Final = ValveSection.model_validate({})


class OthersSection(Section):
    """Devices on the controller's own bus that it has nothing to do with."""

    ids_11bit: tuple[Id11, ...] = ()  #: Identifiers of 11 bits.
    ids_29bit: tuple[Id29, ...] = ()  #: Identifiers of 29 bits.
    pgns: tuple[Pgn, ...] = ()  #: Groups by SAE J1939-21, of any source and priority.


KINDS: Final[dict[str, type[tuple[Any, ...]]]] = {
    "motion": messages.SensorMotion,
    "motion_2": messages.SensorMotion,
    "levels": messages.SensorTank,
    "pump_sensor": messages.SensorPump,
}
ROLES: Final = {**KINDS, "valve": messages.ValveStatus, "panel": messages.OperatorCommand}


class DevicesSection(Section):
    """Section ``devices`` of a ship's file."""

    motion: DeviceSection = NATIVE_NODE  #: Motion sensor.
    motion_2: DeviceSection = NATIVE_NODE  #: Second motion sensor.
    levels: DeviceSection = NATIVE_NODE  #: Level gauges.
    pump_sensor: DeviceSection = NATIVE_NODE  #: Sensor of the pump's pressure.
    pump: DriveSection = NATIVE_DRIVE  #: Drive of the pump.
    valve: ValveSection = NATIVE_VALVE  #: Valve of the tank.
    panel: PanelSection = NATIVE_PANEL  #: The first operator station.
    receive_only: tuple[str, ...] = ()  #: Interfaces on which the controller sends nothing.
    others: OthersSection = OthersSection()  #: Devices that the controller has nothing to do with.

    @model_validator(mode="after")
    def _usable(self) -> "DevicesSection":
        problems = [
            (f"{role}.{name}", reason)
            for role, device in self.devices().items()
            for name, reason in device.problems(ROLES[role])
        ]
        for role, sensor in self.sensors().items():
            cycle_ms = sensor.cycle_ms
            if cycle_ms is not None and cycle_ms > MOST_CYCLE_MS:
                reason = (
                    f"is {cycle_ms:g}, {1e3 / cycle_ms:.3g} Hz: too slow for any law and for the "
                    f"monitors, which need {1e3 / MOST_CYCLE_MS:g} Hz or more"
                )
                problems.append((f"{role}.cycle_ms", reason))
        problems += [(f"pump.{name}", reason) for name, reason in self.pump.problems()]
        if not self.pump.native:
            problems += self._loop_problems()
        told = {"pump": self.pump.bus, "valve": self.valve.bus}
        if self.panel.authentication is not None:
            told["panel"] = self.panel.bus
        for role, bus in told.items():
            if bus in self.receive_only or bus.startswith(LINES):
                problems.append((f"{role}.bus", f"{bus} is receive-only: it can't be commanded"))
        buses = self.buses()
        if len(buses) > MOST_BUSES:
            problems.append(("", f"are on {len(buses)} interfaces, {MOST_BUSES} is the most"))
        for role, device in self.devices().items():
            if device.protection.n2k_name is not None and device.bus in self.receive_only:
                reason = f"has to be asked for, but {device.bus} is receive-only: leave one out"
                problems.append((f"{role}.protection.n2k_name", reason))
        problems += self._clashes()
        strange = [name for name in self.receive_only if name not in buses]
        problems += [("receive_only", f"no device is on {name}") for name in strange]
        refuse("devices", problems)
        return self

    def _clashes(self) -> Iterator[Problem]:
        """What two devices, or a device and a native node, both are by their identifiers."""
        ids = {role: each.can_ids() for role, each in self.devices().items() if not each.native}
        native = load_catalogue().can_ids
        for role, own in ids.items():
            device = self.devices()[role]
            if not device.bus and (taken := own & native):
                reason = f"{min(taken):#x} is a native node's on this bus: change it in the device"
                yield f"{role}.messages", reason
            if not device.bus and device.source in set(Address):
                reason = f"is the address of {Address(device.source).name.lower()}: change it there"
                yield f"{role}.source", reason
            drive = self.pump.node
            if self.pump.native or device.bus != self.pump.bus or drive is None:
                continue
            if device.node in (drive, self.pump.controller_node):
                yield f"{role}.node", "is the drive's or the controller's: give it another number"
            elif taken := own & {STANDARD | each + drive for each in _OF_DRIVE}:
                reason = f"{min(taken) - STANDARD:#x} is the drive's on this bus: change it there"
                yield f"{role}.messages", reason
        both = [ids.get(role, frozenset()) for role in ("motion", "motion_2")]
        if self.motion.bus == self.motion_2.bus and (same := both[0] & both[1]):
            reason = f"has {min(same):#x} of motion: a sensor is no second source for itself"
            yield "motion_2.messages", reason

    def pressure_margins(self) -> LoopMargins:
        """Margins of the pressure loop around the drive, with the pump sensor's own delay."""
        sensor = self.pump_sensor
        cycle_ms = NATIVE_PUMP_MS if sensor.cycle_ms is None else sensor.cycle_ms
        return self.pump.margins((cycle_ms + sensor.latency_ms) * 1e-3)

    def _loop_problems(self) -> Iterator[Problem]:
        margins = self.pressure_margins()
        phase_deg = math.degrees(margins.phase_rad)
        if phase_deg < LEAST_PHASE_DEG or margins.gain < LEAST_GAIN:
            reason = (
                f"is {self.pump.delay_ms:g}, and the pressure loop's margins are {phase_deg:.0f} "
                f"degrees and {margins.gain:.2g}, less than {LEAST_PHASE_DEG:g} and "
                f"{LEAST_GAIN:g}: raise it, or take a faster pump sensor"
            )
            yield "pump.delay_ms", reason

    def sensors(self) -> dict[str, DeviceSection]:
        """The sensors by their roles."""
        return {role: getattr(self, role) for role in KINDS}

    def devices(self) -> dict[str, DeviceSection]:
        """Sensors, valve and panel by their roles."""
        return {role: getattr(self, role) for role in ROLES}

    def redundancy_problems(self, redundancy: Redundancy) -> Iterator[Problem]:
        """What a second motion sensor must be there for, or is there without need."""
        if redundancy.second_motion_sensor:
            return
        if not self.motion_2.native:
            yield "motion_2", "needs redundancy: {second_motion_sensor: true} in the ship's file"
        rate = self.motion.signals.get("roll_rate_rad_s")
        if rate is not None and rate.source == "derived":
            reason = (
                "is derived of the roll: nothing would tell a wrong one. Give a measured rate, or "
                "a second motion sensor (redundancy: {second_motion_sensor: true})"
            )
            yield "motion.signals.roll_rate_rad_s.source", reason

    def default_ages(self) -> dict[str, float]:
        """Limits of age where the controller's file says nothing, by `SafetyLimits`' names."""
        native_ms = SafetyLimits().motion_age_ms
        first_ms, second_ms = (each.age_ms or native_ms for each in (self.motion, self.motion_2))
        ages = {
            "motion_age_ms": self.motion.age_ms,
            # where they are equal one key of the controller's file is for both
            "motion_2_age_ms": second_ms if second_ms != first_ms else None,
            "tank_degraded_age_ms": self.levels.age_ms,
            "pump_degraded_age_ms": self.pump_sensor.age_ms,
            "valve_age_ms": self.valve.age_ms,
        }
        return {name: age_ms for name, age_ms in ages.items() if age_ms is not None}

    def noise(self, role: str, value: str) -> float:
        """Noise of a value: as given, or that of its least step."""
        device = self.sensors()[role]
        if device.native:
            return 0.0
        return max(device.noise.get(value, 0.0), device.step(value) / math.sqrt(12))

    @property
    def unprotected(self) -> bool:
        """Whether nothing tells a spoilt or foreign frame of a motion sensor."""
        return any(not (each.native or each.protected) for each in (self.motion, self.motion_2))

    def buses(self) -> tuple[str, ...]:
        """Interfaces, the controller's own first, which has no name."""
        names = {each.bus for each in self.devices().values()} | {self.pump.bus}
        named = sorted(names - {""})
        return ("", *named)

    def foreign(self, pump: Pump | None = None) -> ForeignDevices:
        """The devices as the controller node hears them, with the drive of the pump."""
        buses, others = self.buses(), self.others
        bus_of_pump = buses.index(self.pump.bus)
        own = [each for each in self.devices().values() if not each.bus]
        nodes = {self.pump.node if not self.pump.bus else None, *(each.node for each in own)}
        plans: dict[str, DevicePlan[Any] | None] = dict.fromkeys(ROLES)
        for role, device in self.devices().items():
            if not device.native:
                bus = buses.index(device.bus)
                silent = device.bus in self.receive_only or device.bus.startswith(LINES)
                plans[role] = device.plan(ROLES[role], role, bus, silent=silent)
        valve, pump_plan = plans["valve"], None
        if not self.pump.native and pump is not None:
            pump_plan = self.pump.plan(bus_of_pump, pump)
        told_together = pump_plan is not None and self.valve.bus == self.pump.bus
        same_node = self.valve.controller_node == self.pump.controller_node
        if valve is not None and told_together and same_node:
            # one node has one heartbeat, and the drive's command brings it
            valve = replace(valve, beat=None)
        return ForeignDevices(
            (plans["motion"], plans["motion_2"]),
            plans["levels"],
            plans["pump_sensor"],
            buses,
            frozenset(self.receive_only),
            frozenset((*others.ids_29bit, *(STANDARD | each for each in others.ids_11bit))),
            frozenset(others.pgns),
            pump_plan,
            valve,
            plans["panel"],
            frozenset(node for node in nodes if node is not None),
            frozenset(each.source for each in own if each.source is not None),
        )
