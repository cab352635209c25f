"""Section ``devices`` of a ship's file: what is on the bus in the place of the native nodes."""

import math
from collections.abc import Iterator
from typing import Annotated, Any, Final

from pydantic import Field, model_validator

from utank_hil.base.parameters import Problem, Range, refuse
from utank_hil.canbus.catalogue import load_catalogue
from utank_hil.canbus.enumerations import Address
from utank_hil.canbus.frame import BUS_SHIFT, LONGEST_STANDARD_ID, MOST_BUSES, STANDARD, Frame
from utank_hil.canbus.messages import SensorMotion, SensorPump, SensorTank
from utank_hil.canbus.profiles.device_plan import (
    FIELDS,
    SWITCHES,
    Crc8,
    DevicePlan,
    ForeignDevices,
    MessagePlan,
)
from utank_hil.canbus.profiles.field import ConditionPlan, SignalPlan
from utank_hil.configuration.device_files import NATIVE, with_profile
from utank_hil.configuration.device_sections import (
    LEAST_GAIN,
    LEAST_PHASE_DEG,
    NATIVE_DRIVE,
    UNITS,
    ConditionSection,
    Cycle,
    DriveSection,
    FieldSection,
    Id11,
    Id29,
    MessageSection,
    NodeNumber,
    Pgn,
    ProtectionSection,
    SignalSection,
    SourceAddress,
    unit_of,
)
from utank_hil.configuration.files import Section
from utank_hil.control.pressure_loop import LoopMargins
from utank_hil.dynamics.pump import Pump
from utank_hil.nodes.redundancy import Redundancy
from utank_hil.safety.safety_limits import SafetyLimits

MOST_MOTION_CYCLE_MS: Final = 50.0
"""The monitors look at motion every 50 ms and take a gap of 100 ms as a loss: below 20 Hz they see
nothing."""
LEAST_AGE_CYCLES: Final = 2.0  #: One lost frame must not end the run.
PRIORITIES: Final = range(8)
NATIVE_PUMP_MS: Final = 20.0  #: Cycle of SENSOR_PUMP.
_NAME_PGN: Final = 0xEEFF  #: Address claimed, to all.
_REQUEST_PGN: Final = 0xEA00
_NO_ADDRESS: Final = 0xFE
"""Of one who has claimed none, SAE J1939-81: on another bus the controller's may be somebody's."""
Noise = Annotated[float, Range(above=0, most=1.0)]


class DeviceSection(Section):
    """One device."""

    profile: str = NATIVE
    """Shipped profile, or `native` for a node of this project's own catalogue."""
    bus: str = ""  #: Interface that it is on; empty for the controller's own.
    device: str = ""  #: Maker and kind, in the shipped profiles.
    documents: str = ""  #: Public documents that the profile was made from.
    node: NodeNumber | None = None  #: CANopen node.
    source: SourceAddress | None = None  #: Source address, SAE J1939 and NMEA 2000.
    messages: Annotated[dict[str, MessageSection], Field(default_factory=dict)]
    """Layouts and identifiers by names of your own; with `dbc: FILE` the names in that file, with
    `eds: FILE` TPDO1 and on."""
    signals: Annotated[dict[str, SignalSection], Field(default_factory=dict)]
    """What each value is made of."""
    valid_when: tuple[ConditionSection, ...] = ()  #: Conditions on status words that must all hold.
    protection: ProtectionSection = ProtectionSection()
    """What tells frames that are wrong, old or not the device's."""
    accept_unprotected: bool = False
    """Whether a device without counter and checksum is used all the same."""
    cycle_ms: Cycle | None = None  #: Time between two measurements.
    age_ms: Cycle | None = None  #: Longest age of the last measurement.
    latency_ms: Annotated[float, Range(least=0, most=1000)] = 0.0
    """From the motion to the first bit on the bus."""
    same_instant_ms: Cycle | None = None
    """Frames of one measurement come within this time; half a cycle without it."""
    noise: Annotated[dict[str, Noise], Field(default_factory=dict)]
    """Standard deviation of a value, where it is more than `sensors` of the controller's file."""
    high_level_m: Annotated[float, Range(above=0, most=100)] | None = None
    """Level that counts as too high, where the levels come without switches."""

    @model_validator(mode="before")
    @classmethod
    def _complete(cls, content: Any) -> Any:
        return with_profile(content) if isinstance(content, dict) else content

    @property
    def native(self) -> bool:
        """Whether it is the node of this project's own catalogue."""
        return self.profile == NATIVE

    @property
    def protected(self) -> bool:
        """Whether a counter or a checksum is in each message with a value."""
        guarded = {each.partition(".")[0] for each in self.protection.counters}
        guarded |= {each.message for each in self.protection.crcs}
        return all(
            each.from_.partition(".")[0] in guarded
            for each in self.signals.values()
            if each.source == "measured"
        )

    def period_ms(self) -> float:
        """Time between two measurements."""
        assert self.cycle_ms is not None
        return self.cycle_ms

    def problems(self, kind: type[tuple[Any, ...]]) -> Iterator[Problem]:
        """What is wrong with the device as a source of this message; native ones are right."""
        if self.native:
            if self.bus:
                reason = "is for a device with a profile: native nodes are on the controller's bus"
                yield "bus", reason
            return
        for name in ("cycle_ms", "age_ms"):
            if getattr(self, name) is None:
                yield name, "is required but missing"
        if self.cycle_ms is not None and self.age_ms is not None:
            least_ms = LEAST_AGE_CYCLES * self.cycle_ms
            if self.age_ms < least_ms:
                yield "age_ms", f"must be {least_ms:g} or more, two cycles, got {self.age_ms:g}"
        yield from self._message_problems()
        yield from self._cycle_problems()
        yield from self._signal_problems(kind)
        for place, (key, path) in enumerate(self._paths()):
            if path.partition(".")[0] not in self.messages or self._field(path) is None:
                yield key, f"{path!r} is no signal of messages: write MESSAGE.SIGNAL (no. {place})"
        for crc in self.protection.crcs:
            said = self.messages.get(crc.message)
            if said is None:
                yield "protection.crcs", f"there is no message {crc.message!r}"
            elif crc.byte >= said.bytes:
                reason = f"byte {crc.byte} is not in {crc.message}, which has {said.bytes}"
                yield "protection.crcs", f"{reason}: the first is byte 0"
        guards = self.protection
        if not self.protected and not self.accept_unprotected:
            reason = (
                "must be set to true: no counter or checksum tells frames of another sender, old "
                "or spoilt ones. The pressure stays at half until a second motion sensor agrees"
            )
            yield "accept_unprotected", reason
        if not (guards.counters or guards.stamps or guards.unchanged_ms):
            reason = "is required where nothing counts: a device that hangs sends the same for ever"
            yield "protection.unchanged_ms", reason

    def _message_problems(self) -> Iterator[Problem]:
        for name, message in self.messages.items():
            ways = [getattr(message, way) is not None for way in ("id", "pgn", "cob")]
            if sum(ways) != 1:
                yield f"messages.{name}", "needs one of id, pgn and cob"
            elif message.pgn is not None and self.source is None:
                yield "source", f"is required but missing: it sends PGN {message.pgn}"
            elif message.cob is not None and self.node is None:
                yield "node", "is required but missing: its identifiers follow from it"
            elif message.format == "11bit" and (message.id or 0) > LONGEST_STANDARD_ID:
                reason = f"must be 29bit: {message.id:#x} has more than 11 bits"
                yield f"messages.{name}.format", reason
            if message.only is not None and message.only.from_ not in message.signals:
                yield f"messages.{name}.only", f"{message.only.from_!r} is no signal of {name}"
            for signal, layout in message.signals.items():
                try:
                    layout.field(message.bytes)
                except ValueError as error:
                    yield f"messages.{name}.signals.{signal}", str(error)
        if self.protection.n2k_name is not None and self.source is None:
            yield "source", "is required but missing: n2k_name claims it"

    def _signal_problems(self, kind: type[tuple[Any, ...]]) -> Iterator[Problem]:
        known = FIELDS[kind]
        for name, signal in self.signals.items():
            if name not in known:
                yield f"signals.{name}", f"is no value of it; there are {', '.join(known)}"
                continue
            layout = self._field(signal.from_)
            if layout is None or signal.source == "derived" or name in SWITCHES:
                continue
            if signal.scale is None and UNITS.get(layout.unit, ("",))[0] != unit_of(name):
                unit = f"has the unit {layout.unit!r}" if layout.unit else "has no unit"
                reason = f"{signal.from_} {unit}: give scale, from it to {unit_of(name)}"
                yield f"signals.{name}.scale", reason
        for name in self.noise.keys() - set(known):
            yield f"noise.{name}", f"is no value of it; there are {', '.join(known)}"
        needed = [name for name in known if name not in SWITCHES and name != "flow_m3_s"]
        if kind is SensorTank and self.high_level_m is None:
            needed += SWITCHES
        for name in needed:
            if name not in self.signals:
                more = ", or else high_level_m" if name in SWITCHES else ""
                yield f"signals.{name}", f"is required but missing{more}"

    def _paths(self) -> Iterator[tuple[str, str]]:
        for name, signal in self.signals.items():
            if signal.source == "measured":
                yield f"signals.{name}", signal.from_
        yield from (("valid_when", each.from_) for each in self.valid_when)
        yield from (("protection.counters", each) for each in self.protection.counters)
        yield from (("protection.stamps", each.from_) for each in self.protection.stamps)

    def _cycle_problems(self) -> Iterator[Problem]:
        """Messages with a value or a stamp that come at another pace than the measurement."""
        paths = [path for key, path in self._paths() if key.startswith(("signals", "protection.s"))]
        for name in {path.partition(".")[0] for path in paths} & set(self.messages):
            own_ms = self.messages[name].cycle_ms
            if own_ms is not None and own_ms != self.cycle_ms:
                reason = (
                    f"is {own_ms:g}, and cycle_ms {self.cycle_ms:g}: what has a value or a stamp"
                )
                yield f"messages.{name}.cycle_ms", f"{reason} comes once in each measurement"

    def _field(self, path: str) -> FieldSection | None:
        message, _, signal = path.partition(".")
        section = self.messages.get(message)
        return None if section is None else section.signals.get(signal)

    def _factor(self, signal: SignalSection, layout: FieldSection) -> float:
        """Value, in the unit of its name, of one unit of the maker's."""
        return UNITS.get(layout.unit, ("", 1.0))[1] if signal.scale is None else signal.scale

    def step(self, value: str) -> float:
        """The least step of a value, in its own unit; zero for a real number."""
        signal = self.signals[value]
        layout = self._field(signal.from_)
        if layout is None or layout.real:
            return 0.0
        return abs(layout.scale * self._factor(signal, layout))

    def _wake(self, bus: int) -> Frame | None:
        """What starts a CANopen node (CiA 301), or has an address claimed anew (J1939-81)."""
        if self.node is not None:
            return Frame(bus << BUS_SHIFT | STANDARD, bytes((1, self.node)))
        if self.protection.n2k_name is not None:
            assert self.source is not None
            can_id = 6 << 26 | _REQUEST_PGN << 8 | self.source << 8 | _NO_ADDRESS
            return Frame(bus << BUS_SHIFT | can_id, (_NAME_PGN & 0xFF00).to_bytes(3, "little"))
        return None

    def plan(
        self, kind: type[tuple[Any, ...]], name: str, bus: int, *, silent: bool = False
    ) -> DevicePlan[Any]:
        """The device as the inbox hears it, on the interface of this number.

        Nothing is sent to it on a `silent` interface.
        """
        assert self.age_ms is not None
        cycle_ms, guards, claim = self.period_ms(), self.protection, None
        if guards.n2k_name is not None:
            assert self.source is not None
            claim = (bus << BUS_SHIFT) | 6 << 26 | _NAME_PGN << 8 | self.source, guards.n2k_name
        return DevicePlan(
            name,
            kind,
            tuple(self._message_plan(each, kind, bus) for each in self.messages),
            round(cycle_ms * 1e6),
            round((cycle_ms / 2 if self.same_instant_ms is None else self.same_instant_ms) * 1e6),
            self.age_ms,
            round((guards.unchanged_ms or 0.0) * 1e6),
            math.inf if self.high_level_m is None else self.high_level_m,
            any(each.source == "derived" for each in self.signals.values()),
            claim,
            None if silent else self._wake(bus),
        )

    def _message_plan(self, name: str, kind: type[tuple[Any, ...]], bus: int) -> MessagePlan:
        section, guards = self.messages[name], self.protection
        only = section.only
        layouts = {f"{name}.{key}": layout for key, layout in section.signals.items()}
        fields = {key: layout.field(section.bytes) for key, layout in layouts.items()}
        signals = tuple(
            SignalPlan(
                FIELDS[kind].index(value), fields[each.from_],
                self._factor(each, layouts[each.from_]), each.offset, each.sign, each.least,
                each.most,
            )
            for value, each in self.signals.items()
            if each.source == "measured" and each.from_ in fields
        )  # fmt: skip
        conditions = tuple(
            ConditionPlan(fields[each.from_], each.mask, frozenset(each.in_))
            for each in self.valid_when
            if each.from_ in fields
        )
        counter = next((fields[each] for each in guards.counters if each in fields), None)
        crc = next((each for each in guards.crcs if each.message == name), None)
        stamp = next((each for each in guards.stamps if each.from_ in fields), None)
        cycle_ms = self.period_ms() if section.cycle_ms is None else section.cycle_ms
        return MessagePlan(
            name,
            tuple(each | bus << BUS_SHIFT for each in self._can_ids(section)),
            section.bytes,
            round(cycle_ms * 1e6),
            signals,
            conditions,
            counter,
            None if crc is None else Crc8(**crc.model_dump(exclude={"message"})),
            None if stamp is None else fields[stamp.from_],
            1.0 if stamp is None else stamp.us,
            None if only is None else ConditionPlan(
                fields[f"{name}.{only.from_}"], only.mask, frozenset(only.in_)
            ),
        )  # fmt: skip

    def can_ids(self) -> frozenset[int]:
        """Identifiers of all its messages."""
        return frozenset(
            can_id for message in self.messages.values() for can_id in self._can_ids(message)
        )

    def _can_ids(self, section: MessageSection) -> tuple[int, ...]:
        if section.pgn is not None and self.source is not None:  # of any priority
            return tuple(each << 26 | section.pgn << 8 | self.source for each in PRIORITIES)
        if section.cob is not None and self.node is not None:
            return (STANDARD | section.cob + self.node,)
        if section.id is None:
            return ()
        return (section.id if section.format == "29bit" else STANDARD | section.id,)


NATIVE_NODE: Final = DeviceSection.model_validate({})


class OthersSection(Section):
    """Devices on the controller's own bus that it has nothing to do with."""

    ids_11bit: tuple[Id11, ...] = ()  #: Identifiers of 11 bits.
    ids_29bit: tuple[Id29, ...] = ()  #: Identifiers of 29 bits.
    pgns: tuple[Pgn, ...] = ()  #: Groups by SAE J1939-21, of any source and priority.


KINDS: Final[dict[str, type[tuple[Any, ...]]]] = {
    "motion": SensorMotion,
    "motion_2": SensorMotion,
    "levels": SensorTank,
    "pump_sensor": SensorPump,
}


class DevicesSection(Section):
    """Section ``devices`` of a ship's file."""

    motion: DeviceSection = NATIVE_NODE  #: Motion sensor.
    motion_2: DeviceSection = NATIVE_NODE  #: Second motion sensor.
    levels: DeviceSection = NATIVE_NODE  #: Level gauges.
    pump_sensor: DeviceSection = NATIVE_NODE  #: Sensor of the pump's pressure.
    pump: DriveSection = NATIVE_DRIVE  #: Drive of the pump.
    receive_only: tuple[str, ...] = ()  #: Interfaces on which the controller sends nothing.
    others: OthersSection = OthersSection()  #: Devices that the controller has nothing to do with.

    @model_validator(mode="after")
    def _usable(self) -> "DevicesSection":
        problems = [
            (f"{role}.{name}", reason)
            for role, device in self.sensors().items()
            for name, reason in device.problems(KINDS[role])
        ]
        for role in ("motion", "motion_2"):
            cycle_ms = self.sensors()[role].cycle_ms
            if cycle_ms is not None and cycle_ms > MOST_MOTION_CYCLE_MS:
                reason = (
                    f"is {cycle_ms:g}, {1e3 / cycle_ms:.3g} Hz: too slow for any law and for the "
                    f"monitors, which need {1e3 / MOST_MOTION_CYCLE_MS:g} Hz or more"
                )
                problems.append((f"{role}.cycle_ms", reason))
        problems += [(f"pump.{name}", reason) for name, reason in self.pump.problems()]
        if not self.pump.native:
            problems += self._loop_problems()
        if self.pump.bus in self.receive_only:
            problems.append(("pump.bus", f"{self.pump.bus} is receive-only: it can't be commanded"))
        buses = self.buses()
        if len(buses) > MOST_BUSES:
            problems.append(("", f"are on {len(buses)} interfaces, {MOST_BUSES} is the most"))
        for role, device in self.sensors().items():
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
        ids = {role: each.can_ids() for role, each in self.sensors().items() if not each.native}
        native = load_catalogue().can_ids
        for role, own in ids.items():
            device = self.sensors()[role]
            if not device.bus and (taken := own & native):
                reason = f"{min(taken):#x} is a native node's on this bus: change it in the device"
                yield f"{role}.messages", reason
            if not device.bus and device.source in set(Address):
                reason = f"is the address of {Address(device.source).name.lower()}: change it there"
                yield f"{role}.source", reason
            if self.pump.native or device.node is None or device.bus != self.pump.bus:
                continue
            if device.node in (self.pump.node, self.pump.controller_node):
                yield f"{role}.node", "is the drive's or the controller's: give it another number"
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
        ages = {
            "motion_age_ms": self.motion.age_ms,
            "tank_degraded_age_ms": self.levels.age_ms,
            "pump_degraded_age_ms": self.pump_sensor.age_ms,
        }
        both = [each.age_ms for each in (self.motion, self.motion_2) if each.age_ms is not None]
        if both:
            ages["motion_spare_age_ms"] = max(SafetyLimits().motion_spare_age_ms, 2 * max(both))
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
        names = {each.bus for each in self.sensors().values()} | {self.pump.bus}
        named = sorted(names - {""})
        return ("", *named)

    def foreign(self, pump: Pump | None = None) -> ForeignDevices:
        """The devices as the controller node hears them, with the drive of the pump."""
        buses, others = self.buses(), self.others
        bus_of_pump = buses.index(self.pump.bus)
        own = [each for each in self.sensors().values() if not each.bus]
        nodes = {self.pump.node if not self.pump.bus else None, *(each.node for each in own)}
        plans: dict[str, DevicePlan[Any] | None] = dict.fromkeys(KINDS)
        for role, device in self.sensors().items():
            if not device.native:
                bus, silent = buses.index(device.bus), device.bus in self.receive_only
                plans[role] = device.plan(KINDS[role], role, bus, silent=silent)
        return ForeignDevices(
            (plans["motion"], plans["motion_2"]),
            plans["levels"],
            plans["pump_sensor"],
            buses,
            frozenset(self.receive_only),
            frozenset((*others.ids_29bit, *(STANDARD | each for each in others.ids_11bit))),
            frozenset(others.pgns),
            None if self.pump.native or pump is None else self.pump.plan(bus_of_pump, pump),
            frozenset(node for node in nodes if node is not None),
            frozenset(each.source for each in self.sensors().values()
                      if not each.bus and each.source is not None),
        )  # fmt: skip
