"""What a device of another maker sends, worked out beforehand from its profile."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, Final, Generic, TypeVar

from utank_hil.canbus.e2e import crc_table
from utank_hil.canbus.frame import BUS_SHIFT, STANDARD, Frame
from utank_hil.canbus.messages import (
    OperatorCommand,
    SensorMotion,
    SensorPump,
    SensorTank,
    ValveStatus,
)
from utank_hil.canbus.profiles.drive_plan import RECEIVED_1, SENT_1, SENT_2, DrivePlan, Step
from utank_hil.canbus.profiles.field import ConditionPlan, Field, SignalPlan

T = TypeVar("T", bound=tuple[Any, ...])

FIELDS: Final[dict[type[tuple[Any, ...]], tuple[str, ...]]] = {
    SensorMotion: ("roll_rad", "roll_rate_rad_s"),
    SensorTank: ("port_level_m", "starboard_level_m", "port_high", "starboard_high"),
    SensorPump: ("pressure_pa", "flow_m3_s"),
    ValveStatus: ("opening", "is_open", "is_shut"),
    OperatorCommand: ("arm", "stop", "acknowledge", "reset", "passive"),
}
"""What a device may say: of a sensor in the order of the message's fields before the quality, of a
valve its position, of a panel what is pressed."""
SLOPE_S: Final = 0.1
"""Time over which a rate is derived of the roll: half of it later, with a tenth of the noise that
two rolls 10 ms apart would give. The waves turn it by three degrees (period 6 s)."""
SWITCHES: Final = ("port_high", "starboard_high")
COMMANDS: Final = ("opening", "follow", "reset")
"""What a valve may be told: its opening; whether it is to follow, or go to its fail position; to
forget a fault."""


@dataclass(frozen=True, slots=True)
class Crc8:
    """A checksum of eight bits over all other bytes of a frame, in their order.

    The numbers are those of the Rocksoft model, without reflection; SAE J1850 is the default.
    """

    byte: int  #: Place of the checksum in the frame.
    polynomial: int = 0x1D
    start: int = 0xFF
    final: int = 0xFF

    def of(self, data: bytes) -> int:
        """The checksum that belongs into the frame."""
        register, table = self.start, crc_table(self.polynomial)
        for place, byte in enumerate(data):
            if place != self.byte:
                register = table[register ^ byte]
        return register ^ self.final


@dataclass(frozen=True, slots=True)
class MessagePlan:
    """One message: the identifiers that it may have, what it says, and its protection."""

    name: str
    can_ids: tuple[int, ...]
    length: int
    cycle_ns: int
    signals: tuple[SignalPlan, ...] = ()
    conditions: tuple[ConditionPlan, ...] = ()
    counter: Field | None = None
    crc: Crc8 | None = None
    stamp: Field | None = None
    stamp_us: float = 1.0
    only: ConditionPlan | None = None  #: Other frames of the identifier are none of this message.
    counts_all: bool = False  #: Whether the counter counts those, too.


class MessageEncoder:
    """Encodes one message by its plan: values, status, counter, stamp and checksum."""

    def __init__(self, plan: MessagePlan) -> None:
        self.plan = plan
        self.sent = [0]  #: Frames so far; shared by contents that are counted together.

    def frame(self, values: Sequence[float], now_ns: int, *, missing: bool = False) -> Frame:
        """The next frame, of values by their places; the status says whether any is `missing`."""
        plan, word = self.plan, 0
        for signal in plan.signals:
            value = signal.sign * values[signal.place] - signal.offset
            word = signal.field.put(word, value / signal.factor, plan.length)
        for condition in plan.conditions:
            # a device without a code for it says so by its status
            good = min(condition.allowed)
            status = condition.mask & ~good if missing else good
            word = condition.field.put_counts(word, status, plan.length, condition.mask)
        if plan.only is not None:
            only = plan.only
            word = only.field.put_counts(word, min(only.allowed), plan.length, only.mask)
        if plan.stamp is not None:
            stamp = round(now_ns / (1e3 * plan.stamp_us))
            word = plan.stamp.put_counts(word, stamp, plan.length)
        if plan.counter is not None:
            self.sent[0] += 1
            word = plan.counter.put_counts(word, self.sent[0], plan.length)
        data = word.to_bytes(plan.length, "little")
        if plan.crc is not None:
            at = plan.crc.byte
            data = data[:at] + bytes([plan.crc.of(data)]) + data[at + 1 :]
        return Frame(plan.can_ids[-1], data)

    def held(self, place: int, value: float) -> float:
        """What is left of a value in the bits that it has."""
        for signal in self.plan.signals:
            if signal.place == place:
                counts = (signal.sign * value - signal.offset) / signal.factor
                word = signal.field.put(0, counts, self.plan.length)
                return signal.value(word.to_bytes(self.plan.length, "little"))
        return value


@dataclass(frozen=True, slots=True)
class Authentication:
    """How a panel shows that it has the key: it answers a challenge that is used once."""

    challenge_id: int  #: What the controller sends each second.
    proof_ids: tuple[int, ...]  #: AES-CMAC of challenge and order, its first 8 bytes.
    key: str  #: File of the key.


@dataclass(frozen=True, slots=True)
class DevicePlan(Generic[T]):
    """All that is needed to hear a device."""

    name: str
    kind: type[T]  #: Message that it stands for.
    messages: tuple[MessagePlan, ...]
    cycle_ns: int  #: Cycle of the measurement.
    same_instant_ns: int  #: Frames that belong to one measurement come within this time.
    age_ms: float  #: A stamp that is later than others by more is too late.
    #: Content that has been the same for longer is none; 0 where stamp or counter say more.
    unchanged_ns: int = 0
    #: Level above which a reservoir counts as high where there are no switches.
    high_level_m: float = math.inf
    derived: bool = False  #: Whether the rate is the slope of the roll over `SLOPE_S`.
    #: Identifier (priority 6) of the device's address claim, and the NAME it must carry.
    name_id: tuple[int, int] | None = None
    #: Sent each second to a device that is silent, or has not said its name: start of a CANopen
    #: node, request of an address claim.
    wake: Frame | None = None
    #: bus, node: of a CANopen node that is configured by `steps` before it counts.
    bus: int = 0
    node: int | None = None
    steps: tuple[Step, ...] = ()
    command: MessagePlan | None = None  #: What a valve is told, by `COMMANDS`.
    authentication: Authentication | None = None  #: Of a panel.
    beat: Frame | None = None  #: The controller's heartbeat, sent with each command.


@dataclass(frozen=True, slots=True)
class ForeignDevices:
    """What the controller node needs to hear the devices of a ship."""

    #: Of the one or two motion sensors; None for a native one.
    motions: tuple[DevicePlan[SensorMotion] | None, ...] = (None, None)
    levels: DevicePlan[SensorTank] | None = None
    pump_sensor: DevicePlan[SensorPump] | None = None
    #: Names of the interfaces by their numbers; the controller's own, the first, has none.
    buses: tuple[str, ...] = ("",)
    receive_only: frozenset[str] = frozenset()  #: Interfaces on which nothing is sent.
    other_ids: frozenset[int] = frozenset()  #: Identifiers that are nobody's fault.
    other_pgns: frozenset[int] = frozenset()
    pump: DrivePlan | None = None  #: Drive of the pump.
    valve: DevicePlan[ValveStatus] | None = None
    panel: DevicePlan[OperatorCommand] | None = None  #: The first operator station.
    #: nodes, sources: CANopen nodes and source addresses of devices on the controller's own bus.
    nodes: frozenset[int] = frozenset()
    sources: frozenset[int] = frozenset()
    preview: int | None = None  #: Bus of the preview station; None if there is none.

    @property
    def any(self) -> bool:
        """Whether there are any, or more interfaces than the controller's own."""
        return replace(self, preview=None) != NO_FOREIGN_DEVICES

    def with_preview(self, bus: str) -> "ForeignDevices":
        """Return these with a preview station on an interface."""
        buses = self.buses if bus in self.buses else (*self.buses, bus)
        return replace(self, buses=buses, preview=buses.index(bus))

    def said(self) -> dict[int, tuple[str, str, bool]]:
        """Identifiers: device, message, and whether its node is silent until it is configured."""
        found: dict[int, tuple[str, str, bool]] = {}
        for plan in (*self.motions, self.levels, self.pump_sensor, self.valve, self.panel):
            if plan is not None:
                for each in filter(None, (*plan.messages, plan.command)):
                    device, others, _ = found.get(each.can_ids[0], ("", "", False))
                    name = f"{others}, {each.name}" if device == plan.name else each.name
                    found |= dict.fromkeys(each.can_ids, (plan.name, name, bool(plan.steps)))
        if self.pump is not None:
            own = self.pump.bus << BUS_SHIFT | STANDARD | self.pump.node
            for name, cob in (("RPDO1", RECEIVED_1), ("TPDO1", SENT_1), ("TPDO2", SENT_2)):
                found[own + cob] = "pump", name, True
        return found

    def knows(self, can_id: int) -> bool:
        """Whether a frame on the controller's own bus is of a declared device.

        What a device of the ship's file says besides, as its heartbeat, is no stranger's.
        """
        if can_id & STANDARD:
            said = can_id & 0x780 in SAID and can_id & 0x7F in self.nodes
        else:
            said = can_id & 0xFF in self.sources
        group = can_id >> 8 & 0x3FFFF
        if group & 0xFF00 < 0xF000:  # the low byte is its destination
            group &= 0x3FF00
        return said or can_id in self.other_ids or group in self.other_pgns


SAID: Final = frozenset((0x080, 0x180, 0x280, 0x380, 0x480, 0x580, 0x700))
"""What a CANopen node sends by the predefined connections of CiA 301, less its number."""

NO_FOREIGN_DEVICES: Final = ForeignDevices()
