"""One sensor in section ``devices`` of a ship's file, and what the controller hears of it."""

import math
from collections.abc import Iterator, Mapping
from typing import Annotated, Any, Final

from pydantic import Field, model_validator

from utank_hil.base.parameters import Problem, Range
from utank_hil.canbus.frame import BUS_SHIFT, LONGEST_STANDARD_ID, STANDARD, Frame
from utank_hil.canbus.line_names import LINE_REMEDY, LINES, line_of
from utank_hil.canbus.messages import OperatorCommand, SensorMotion, SensorTank, ValveStatus
from utank_hil.canbus.profiles.device_plan import (
    FIELDS,
    SLOPE_S,
    SWITCHES,
    Crc8,
    DevicePlan,
    MessagePlan,
)
from utank_hil.canbus.profiles.drive_plan import Step, identity_steps, pdo_steps
from utank_hil.canbus.profiles.field import ConditionPlan, SignalPlan
from utank_hil.configuration.device_files import NATIVE, place_of, with_profile
from utank_hil.configuration.device_sections import (
    UNITS,
    CanopenSection,
    ConditionSection,
    Cycle,
    FieldSection,
    MessageSection,
    ProtectionSection,
    ScaledSection,
    SignalSection,
    SourceAddress,
    unit_of,
)
from utank_hil.configuration.error_words import nearest

_COARSE: Final = 0.02  #: Greatest step of a value, by its usual size.
LEAST_AGE_CYCLES: Final = 2.0  #: One lost frame must not end the run.
OPTIONAL: Final = (*SWITCHES, "flow_m3_s", "is_open", "is_shut", "reset", "passive")
UNPROTECTED: Final[dict[type[tuple[Any, ...]], str]] = {
    SensorMotion: ". The pressure stays at half until a second motion sensor agrees",
    OperatorCommand: ". Any other sender on that bus may arm",
}
"""What a device without counter and checksum costs, by the message that it stands for."""
PRIORITIES: Final = range(8)
_NAME_PGN: Final = 0xEEFF  #: Address claimed, to all.
_REQUEST_PGN: Final = 0xEA00
_NO_ADDRESS: Final = 0xFE
"""Of one who has claimed none, SAE J1939-81: on another bus the controller's may be somebody's."""
Noise = Annotated[float, Range(above=0, most=1.0)]


class DeviceSection(CanopenSection):
    """One device."""

    profile: str = NATIVE
    """Shipped profile, or `native` for a node of this project's own catalogue."""
    bus: str = ""
    """Interface that it is on; empty for the controller's own. Of a motion sensor it may be a line:
    `udp:OWN_ADDRESS:PORT:SENDER_ADDRESS` or `serial:/dev/ttyUSB0:115200`."""
    device: str = ""  #: Maker and kind, in the shipped profiles.
    documents: str = ""  #: Public documents that the profile was made from.
    canopen_profile: Annotated[int, Range(least=301, most=0xFFFF)] | None = None
    """Device profile by 1000h, as 410. With it a node is configured by SDO, and read back: profile,
    identity, the mapping, type and event timer of its PDOs, and `require`."""
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
    def derived(self) -> bool:
        """Whether the rate is the slope of the roll."""
        return any(each.source == "derived" for each in self.signals.values())

    @property
    def late_ms(self) -> float:
        """Delay of roll and rate: latency, cycle, and half the time of a slope."""
        slope_ms = 1e3 * SLOPE_S if self.derived else 0.0
        return self.latency_ms + (self.cycle_ms or 0.0) + slope_ms / 2

    @property
    def told(self) -> str:
        """Name of the message that the device is commanded with, if it is commanded."""
        return ""

    @property
    def protected(self) -> bool:
        """Whether a counter or a checksum is in each message with a value."""
        counters = {each: self._field(each) for each in self.protection.counters}
        guarded = {each.partition(".")[0] for each, of in counters.items() if of and of.bits > 1}
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
        if self.bus.startswith(LINES):
            try:
                line_of(self.bus)
            except ValueError as error:
                yield "bus", f"{error}: {LINE_REMEDY}"
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
        known = [f"{name}.{each}" for name, said in self.messages.items() for each in said.signals]
        for key, path in self._paths():
            if self._field(path) is None:
                near = {each.lower(): each for each in known}.get(
                    path.lower(), nearest(path, known)
                )
                meant = f"did you mean {near}?" if near else "write MESSAGE.SIGNAL"
                yield key, f"{path!r} is no signal of messages: {meant}"
        conditions = [("valid_when", each, self._field(each.from_)) for each in self.valid_when]
        conditions += [
            (f"messages.{name}.only", said.only, said.signals.get(said.only.from_))
            for name, said in self.messages.items()
            if said.only is not None
        ]
        for key, each, layout in conditions:
            bits = -1 if layout is None else each.mask & (1 << layout.bits) - 1
            if not bits:
                yield key, f"mask {each.mask:#x} has none of the bits of {each.from_}"
            elif odd := [value for value in each.in_ if layout is not None and value & ~bits]:
                reason = f"in has {odd[0]}, and the bits of {each.from_} that count are {bits:#x}"
                yield key, f"{reason}: it never is (values are without sign)"
        for crc in self.protection.crcs:
            said = self.messages.get(crc.message)
            if said is None:
                yield "protection.crcs", f"there is no message {crc.message!r}"
            elif crc.byte >= said.bytes:
                reason = f"byte {crc.byte} is not in {crc.message}, which has {said.bytes}"
                yield "protection.crcs", f"{reason}: the first is byte 0"
        if not self.protected and not self.accept_unprotected:
            reason = (
                "must be set to true: no counter or checksum tells frames of another sender, old "
                f"or spoilt ones{UNPROTECTED.get(kind, '')}"
            )
            yield "accept_unprotected", reason
        yield from self._life_problems(kind)

    def _life_problems(self, kind: type[tuple[Any, ...]]) -> Iterator[Problem]:
        """A device that may hang and send the same for ever."""
        guards = self.protection
        if kind is OperatorCommand:
            said = {path.partition(".")[0] for key, path in self._paths() if key == "valid_when"}
            values = {each.from_.partition(".")[0] for each in self.signals.values()}
            if not (guards.counters or said - values):
                reason = (
                    "is required: nothing says that the panel lives. Name a signal that counts or "
                    "toggles, or put its heartbeat, a message of its own, into valid_when"
                )
                yield "protection.counters", reason
        elif kind is not ValveStatus and not (
            guards.counters or guards.stamps or guards.unchanged_ms
        ):
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
            elif (message.format == "sentence") != self.bus.startswith(LINES):
                reason = f"is for frames of CAN, and {self.bus} a line of sentences"
                if message.format == "sentence":
                    reason = f"comes on a line, and {self.bus or 'the own interface'} is none"
                yield "bus", f"messages.{name} {reason}: {LINE_REMEDY}"
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
        strange = list(self.require_problems())
        if strange:
            yield from strange
            return
        if self.canopen_profile is None and (self.required() or self.identity):
            yield "canopen_profile", "is required but missing: identity and require are read by SDO"
        if self.protection.n2k_name is not None and self.source is None:
            yield "source", "is required but missing: n2k_name claims it"

    def _signal_problems(self, kind: type[tuple[Any, ...]]) -> Iterator[Problem]:
        known = FIELDS[kind]
        counted = dict.fromkeys(self.protection.counters, "protection.counters")
        for name, signal in self.signals.items():
            if kind in (SensorMotion, SensorTank) and signal.source == "measured":
                if signal.from_ in counted and name not in SWITCHES:
                    reason = f"{signal.from_} is that of {counted[signal.from_]}, too: name its own"
                    yield f"signals.{name}", reason
                counted[signal.from_] = f"signals.{name}"
            if name not in known:
                yield f"signals.{name}", f"is no value of it; there are {', '.join(known)}"
                continue
            layout = self._field(signal.from_)
            if layout is None or signal.source == "derived":
                continue
            units = name not in SWITCHES and signal.scale is None
            if units and UNITS.get(layout.unit, ("",))[0] != unit_of(name):
                unit = f"has the unit {layout.unit!r}" if layout.unit else "has no unit"
                reason = f"{signal.from_} {unit}: give scale, from it to {unit_of(name)}"
                yield f"signals.{name}.scale", reason
            elif not layout.scale * self._factor(signal, layout):
                yield f"signals.{name}.scale", f"must not be 0, nor that of {signal.from_}"
        for name in self.noise.keys() - set(known):
            yield f"noise.{name}", f"is no value of it; there are {', '.join(known)}"
        needed = [name for name in known if name not in OPTIONAL]
        if kind is SensorTank and self.high_level_m is None:
            needed += SWITCHES
        if kind is ValveStatus and self.signals.keys() & {"is_open", "is_shut"}:
            needed = ["is_open", "is_shut"]
        for name in needed:
            if name not in self.signals:
                more = ", or else high_level_m" if name in SWITCHES else ""
                more = ", or else is_open and is_shut" if name == "opening" else more
                more = ", or else {source: derived}" if name == "roll_rate_rad_s" else more
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

    def _factor(self, signal: ScaledSection, layout: FieldSection) -> float:
        """Value, in the unit of its name, of one unit of the maker's."""
        return UNITS.get(layout.unit, ("", 1.0))[1] if signal.scale is None else signal.scale

    def step(self, value: str) -> float:
        """The least step of a value, in its own unit; zero for a real number."""
        signal = self.signals[value]
        layout = self._field(signal.from_)
        if layout is None or layout.real:
            return 0.0
        return abs(layout.scale * self._factor(signal, layout))

    def unusual(self, sizes: Mapping[str, float]) -> Iterator[Problem]:
        """Values whose counts are too coarse, or end too soon, for their usual `sizes`."""
        for name, size in sizes.items():
            if name not in self.signals or not (step := self.step(name)):
                continue
            layout = self._field(self.signals[name].from_)
            most = step * 2.0 ** (layout.bits if layout is not None else 64)
            if step > _COARSE * size or most < size:
                unit = unit_of(name)
                why = (
                    f"counts {most:.3g} {unit} in steps of {step:.3g}, where {size:.3g} is usual: "
                    f"the scale is {unit} of one count"
                )
                yield f"signals.{name}.scale", why

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
        """The device as the inbox hears it on an interface; nothing is sent on a `silent` one."""
        assert self.age_ms is not None
        cycle_ms, guards, claim = self.period_ms(), self.protection, None
        steps = () if silent or self.canopen_profile is None else tuple(self._steps())
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
            self.derived,
            claim,
            None if silent or steps else self._wake(bus),
            bus,
            self.node,
            steps,
        )

    def _steps(self) -> Iterator[Step]:
        """What a CANopen node is configured with and read back, in this order."""
        assert self.canopen_profile is not None
        yield from identity_steps(self.canopen_profile, self.identity)
        for place, value in self.required():
            yield Step(place, value, "set require as the device's manual says, or null")
        for name, message in self.messages.items():
            if message.pdo is None:
                continue
            layouts = sorted(message.signals.values(), key=lambda layout: layout.start)
            objects = [each for each in layouts if each.object]
            whole = all(any(each.within(of) for of in objects) for each in layouts)
            mapped = [(place_of(each.object), each.bits) for each in objects]
            can_id = self._can_ids(message)[0]
            cob = can_id if message.format == "29bit" else can_id & LONGEST_STANDARD_ID
            yield from pdo_steps(
                (0x1400 if name == self.told else 0x1800) + message.pdo - 1, cob,
                mapped if whole else (), message.pdo_type,
                round(message.cycle_ms or self.period_ms()),
            )  # fmt: skip

    def read_back(self) -> list[str]:
        """What a CANopen node must be, in words."""
        known = [str(value) for value in self.identity if value is not None]
        pdos = [
            f"{'R' if name == self.told else 'T'}PDO{each.pdo}"
            for name, each in self.messages.items()
            if each.pdo is not None
        ]
        return [
            f"CiA {self.canopen_profile}",
            *(f"identity {' '.join(known)}" for _ in known[:1]),
            *(f"{place} = {value:#x}" for place, value in self.required()),
            *(f"mapping and pace of {pdo}" for pdo in pdos),
        ]

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
            guards.counts == "identifier",
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
