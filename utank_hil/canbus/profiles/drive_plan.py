"""A pump drive by CiA 402: its objects, its PDOs, what is written and read back at the start."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Final, NamedTuple

from utank_hil.canbus.profiles.canopen import (
    ASYNCHRONOUS,
    DISABLED,
    RECEIVED_1,
    SENT_1,
    SENT_2,
    Place,
    mapped,
)

COMMAND_MS: Final = 20  #: Cycle of the command, as of PUMP_CMD.
PROFILE: Final = 402
CONTROL_WORD: Final = Place(0x6040)
STATUS_WORD: Final = Place(0x6041)
MODE: Final = Place(0x6060)
MODE_SHOWN: Final = Place(0x6061)
MODES_SUPPORTED: Final = Place(0x6502)
SPEED: Final = Place(0x606C)
TORQUE: Final = Place(0x6077)
HEARTBEAT_CONSUMER: Final = Place(0x1016, 1)
HEARTBEAT_PRODUCER: Final = Place(0x1017)
IDENTITY_NAMES: Final = ("vendor", "product", "revision", "serial number")


@dataclass(frozen=True, slots=True)
class DriveMode:
    """A mode of operation: its number in 6060h, its bit in 6502h, its target and demand."""

    number: int
    target: Place
    demand: Place
    bits: int  #: Length of the target.
    torque: bool


MODES: Final = {
    "torque": DriveMode(4, Place(0x6071), Place(0x6074), 16, torque=True),
    "cyclic_torque": DriveMode(10, Place(0x6071), Place(0x6074), 16, torque=True),
    "velocity": DriveMode(3, Place(0x60FF), Place(0x606B), 32, torque=False),
    "cyclic_velocity": DriveMode(9, Place(0x60FF), Place(0x606B), 32, torque=False),
}


class Step(NamedTuple):
    """One entry to be written and read back, or to be compared alone.

    `equal_bits` are those of the value that count; the others stay. A step that is not `needed` may
    fail: the drive need not have the entry. `writes` is False for what can only be compared.
    """

    place: Place
    value: int
    remedy: str
    equal_bits: int = -1
    needed: bool = True
    writes: bool = True
    size: int = 0  #: Bytes that the entry has; 0 for any.


@dataclass(frozen=True, slots=True)
class DrivePlan:
    """All that is needed to configure, command and hear a drive."""

    bus: int  #: Number of the interface.
    node: int
    controller_node: int
    mode: DriveMode
    units_per_si: float  #: Counts of the target a N m, or a rad/s.
    speed_rad_s_per_unit: float
    delay_s: float
    heartbeat_ms: int
    identity: tuple[int | None, ...]
    require: tuple[tuple[Place, int], ...]
    echoes_command: bool  #: Control word and target come back, else the drive's demand.
    synchronous: bool

    @property
    def received(self) -> tuple[tuple[Place, int], ...]:
        """Entries of the PDO that commands, with their bits."""
        return (CONTROL_WORD, 16), (self.mode.target, self.mode.bits)

    @property
    def sent(self) -> tuple[tuple[Place, int], ...]:
        """Entries of the PDO that comes back at each command."""
        if self.echoes_command:
            return (STATUS_WORD, 16), *self.received
        return (STATUS_WORD, 16), (self.mode.demand, self.mode.bits)

    @property
    def measured(self) -> tuple[tuple[Place, int], ...]:
        """Entries of the PDO with speed, torque and mode."""
        return (SPEED, 32), (TORQUE, 16), (MODE_SHOWN, 8)

    def steps(self) -> Iterator[Step]:
        """What is compared, written and read back, in this order."""
        yield Step(
            Place(0x1000), PROFILE, "this is no drive by CiA 402: look at node and wiring",
            equal_bits=0xFFFF, writes=False,
        )  # fmt: skip
        for subindex, (name, value) in enumerate(
            zip(IDENTITY_NAMES, self.identity, strict=False), start=1
        ):
            if value is not None:
                remedy = f"another {name}: if the drive was replaced, change identity"
                yield Step(Place(0x1018, subindex), value, remedy, writes=False)
        bit = 1 << self.mode.number - 1
        yield Step(
            MODES_SUPPORTED, bit, f"mode {self.mode.number} is not supported: choose another mode",
            equal_bits=bit, writes=False,
        )  # fmt: skip
        for number in (1, 2, 3):
            yield Step(Place(0x1801 + number, 1), DISABLED, "", DISABLED, needed=False)
        yield from self._pdo(0x1400, RECEIVED_1, self.received, ASYNCHRONOUS)
        cyclic = 1 if self.synchronous else ASYNCHRONOUS
        yield from self._pdo(0x1800, SENT_1, self.sent, cyclic)
        yield from self._pdo(0x1801, SENT_2, self.measured, cyclic)
        consumed = self.controller_node << 16 | self.heartbeat_ms
        yield Step(
            HEARTBEAT_CONSUMER, consumed,
            "a drive that does not watch the controller's heartbeat (guarding by 100Ch and 100Dh "
            "is none) runs on when that dies: take another drive or its newer firmware",
        )  # fmt: skip
        yield Step(HEARTBEAT_PRODUCER, self.heartbeat_ms, "the drive must send a heartbeat")
        for place, value in self.require:
            yield Step(
                place, value, "set require as the drive's manual says, or null where the measured "
                "stop decides",
            )  # fmt: skip
        # it may be write-only
        yield Step(MODE, self.mode.number, "", needed=False, size=1)
        yield Step(MODE_SHOWN, self.mode.number, "the drive does not enter the mode", writes=False)

    def _pdo(
        self, index: int, cob: int, entries: tuple[tuple[Place, int], ...], kind: int
    ) -> Iterator[Step]:
        """Steps that map a PDO; one whose mapping is fixed passes if it is the same."""
        free = "the drive's mapping is fixed, or it can't map this: choose another echo or mode"
        for place, bits in entries:
            remedy = f"{bits} bits of it are to be mapped: choose another mode or echo"
            yield Step(place, 0, remedy, equal_bits=0, writes=False, size=bits // 8)
        own, mapping = cob + self.node, index + 0x200
        which = DISABLED | 0x7FF
        yield Step(Place(index, 1), own | DISABLED, "", which, needed=False)
        yield Step(Place(mapping), 0, "", needed=False)
        for subindex, (place, bits) in enumerate(entries, start=1):
            yield Step(Place(mapping, subindex), mapped(place, bits), free)
        yield Step(Place(mapping), len(entries), free)
        yield Step(Place(index, 2), kind, "this type of transmission is needed: see synchronous")
        if index >= 0x1800:
            held = "the drive may hold its PDO back"
            yield Step(Place(index, 3), 0, held, needed=False)
            timer_ms = 0 if self.synchronous else COMMAND_MS
            yield Step(Place(index, 5), timer_ms, held, needed=not self.synchronous)
        yield Step(Place(index, 1), own, free, which)
