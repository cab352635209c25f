"""A pump drive by CiA 402: its objects, its PDOs, what is written and read back at the start."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from enum import IntEnum
from typing import Final, NamedTuple

from utank_hil.canbus.frame import LONGEST_ID

NMT: Final = 0x000  #: Identifier of network management.
SYNC: Final = 0x080
EMERGENCY: Final = 0x080  #: This and all below: the node's number is added.
SENT_1: Final = 0x180
SENT_2: Final = 0x280
RECEIVED_1: Final = 0x200
SDO_ANSWER: Final = 0x580
SDO_REQUEST: Final = 0x600
HEARTBEAT: Final = 0x700
DISABLED: Final = 1 << 31  #: In the identifier of a PDO: it is not in use.
ASYNCHRONOUS: Final = 255  #: Type of a PDO that acts, or is sent, by itself.


class NodeCommand(IntEnum):
    """What network management orders a node to do."""

    START = 0x01
    STOP = 0x02
    PRE_OPERATIONAL = 0x80


class NetworkState(IntEnum):
    """What a heartbeat says."""

    BOOT_UP = 0x00
    STOPPED = 0x04
    OPERATIONAL = 0x05
    PRE_OPERATIONAL = 0x7F


class Abort(IntEnum):
    """Why an SDO server refuses, CiA 301 7.2.4.3.17, as far as a drive is expected to say it."""

    NO_ANSWER_IN_TIME = 0x05040000
    COMMAND_UNKNOWN = 0x05040001
    WRITE_ONLY = 0x06010001
    READ_ONLY = 0x06010002
    NO_OBJECT = 0x06020000
    NOT_TO_BE_MAPPED = 0x06040041
    TOO_LONG_A_PDO = 0x06040042
    WRONG_LENGTH = 0x06070010
    NO_SUBINDEX = 0x06090011
    VALUE_OUT_OF_RANGE = 0x06090030
    NOT_IN_THIS_STATE = 0x08000022


def abort_words(code: int) -> str:
    """An abort code, and what it means if it is one of `Abort`."""
    known = {int(each): each.name.lower().replace("_", " ") for each in Abort}
    return f"abort code {code:#010x}" + (f", {known[code]}" if code in known else "")


_EMERGENCIES: Final = {
    1: "generic", 2: "current", 3: "voltage", 4: "temperature", 5: "hardware", 6: "software",
    7: "additional modules", 8: "monitoring", 9: "external", 0xF: "of the device or its functions",
}  # fmt: skip
"""Kinds of errors by the first digit of their code."""


def emergency_words(data: bytes) -> str | None:
    """What an emergency message (CiA 301 7.2.7) says; empty: all is over; None: it is none.

    Code 0000h ends one error; others that are left stand in the error register.
    """
    if len(data) != 8:
        return None
    code, register = int.from_bytes(data[:2], "little"), data[2]
    if not code | register:
        return ""
    kind = _EMERGENCIES.get(code >> 12, "")
    return f"emergency {code:04X}h{kind and f' ({kind})'}, register {register:#04x}"


class Place(NamedTuple):
    """An entry of the object dictionary."""

    number: int  #: Its index.
    subindex: int = 0

    def __str__(self) -> str:
        return f"{self.number:04X}h:{self.subindex}"


class Answer(NamedTuple):
    """What an SDO server says: a value of so many bytes, a written entry, or an abort code."""

    place: Place
    value: int | None = None
    size: int = 0
    abort: int = 0


READ, WRITTEN, ABORT = 0x40, 0x60, 0x80
"""Commands of SDO frames: a client's request of a value, a server's answers to a write request."""


def read_request(place: Place) -> bytes:
    """Request of an entry's value."""
    return sdo(READ, place, 0)


def write_request(place: Place, value: int, size: int) -> bytes:
    """Request to write an entry of one to four bytes, expedited."""
    return sdo(0x23 | (4 - size) << 2, place, value & (1 << 8 * size) - 1)


def sdo(command: int, place: Place, value: int) -> bytes:
    """An SDO frame, CiA 301 7.2.4.3, expedited."""
    head = bytes((command, place.number & 0xFF, place.number >> 8, place.subindex))
    return head + value.to_bytes(4, "little")


def parts(data: bytes) -> tuple[int, Place, int, int]:
    """Command, entry, value and its size of an SDO frame of eight bytes, expedited or not."""
    command, value = data[0], int.from_bytes(data[4:8], "little")
    size = 4 - (command >> 2 & 3) if command & 3 == 3 else 4
    return command, Place(data[1] | data[2] << 8, data[3]), value & (1 << 8 * size) - 1, size


def answer(data: bytes) -> Answer | None:
    """What a server's frame says; None if it is no expedited answer."""
    if len(data) != 8:
        return None
    command, place, value, size = parts(data)
    if command == ABORT:
        return Answer(place, abort=int.from_bytes(data[4:8], "little"))
    if command == WRITTEN:
        return Answer(place)
    # an entry longer than four bytes (no expedited bit) is none that is asked for
    return Answer(place, value, size) if command & 0xE2 == 0x42 else None


def mapped(place: Place, bits: int) -> int:
    """An entry of a PDO's mapping."""
    return place.number << 16 | place.subindex << 8 | bits


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


def identity_steps(profile: int, identity: Sequence[int | None]) -> Iterator[Step]:
    """Steps that compare the profile in 1000h, and what is known of 1018h."""
    yield Step(
        Place(0x1000), profile, f"this is no device by CiA {profile}: look at node and wiring",
        equal_bits=0xFFFF, writes=False,
    )  # fmt: skip
    for subindex, (name, value) in enumerate(zip(IDENTITY_NAMES, identity, strict=False), start=1):
        if value is not None:
            remedy = f"another {name}: if the device was replaced, change identity"
            yield Step(Place(0x1018, subindex), value, remedy, writes=False)


def pdo_steps(
    index: int, cob: int, entries: Sequence[tuple[Place, int]], kind: int, timer_ms: int = 0
) -> Iterator[Step]:
    """Steps that map a PDO and set its pace; a mapping that is fixed passes if it is the same.

    Without `entries` it is left as it is.
    """
    free = "the device's mapping is fixed, or it can't map this: choose another echo or signal"
    for place, bits in entries:
        remedy = f"{bits} bits of it are to be mapped: choose another mode, echo or signal"
        if place.number >= 0x1000:  # below it is a type, and fills a gap
            yield Step(place, 0, remedy, equal_bits=0, writes=False, size=bits // 8)
    mapping, which = index + 0x200, DISABLED | LONGEST_ID
    yield Step(Place(index, 1), cob | DISABLED, "", which, needed=False)
    if entries:
        yield Step(Place(mapping), 0, "", needed=False)
        for subindex, (place, bits) in enumerate(entries, start=1):
            yield Step(Place(mapping, subindex), mapped(place, bits), free)
        yield Step(Place(mapping), len(entries), free)
    yield Step(Place(index, 2), kind, "this type of transmission is needed, see synchronous")
    if index >= 0x1800:
        held = "the device may hold its PDO back, or sends it on a change only"
        yield Step(Place(index, 3), 0, held, needed=False)
        yield Step(Place(index, 5), timer_ms, held, needed=timer_ms != 0)
    yield Step(Place(index, 1), cob, free, which)


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
    stop_within_ms: float

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
        """Entries of the PDO with speed, torque in a torque mode, and mode."""
        return (SPEED, 32), *[(TORQUE, 16)] * self.mode.torque, (MODE_SHOWN, 8)

    def steps(self) -> Iterator[Step]:
        """What is compared, written and read back, in this order."""
        yield from identity_steps(PROFILE, self.identity)
        bit = 1 << self.mode.number - 1
        yield Step(
            MODES_SUPPORTED, bit, f"mode {self.mode.number} is not supported: choose another mode",
            equal_bits=bit, writes=False,
        )  # fmt: skip
        for number in (1, 2, 3):
            yield Step(Place(0x1801 + number, 1), DISABLED, "", DISABLED, needed=False)
        yield from pdo_steps(0x1400, RECEIVED_1 + self.node, self.received, ASYNCHRONOUS)
        cyclic = 1 if self.synchronous else ASYNCHRONOUS
        timer_ms = 0 if self.synchronous else COMMAND_MS
        yield from pdo_steps(0x1800, SENT_1 + self.node, self.sent, cyclic, timer_ms)
        yield from pdo_steps(0x1801, SENT_2 + self.node, self.measured, cyclic, timer_ms)
        consumed = self.controller_node << 16 | self.heartbeat_ms
        yield Step(
            HEARTBEAT_CONSUMER, consumed,
            "a drive that does not watch the controller's heartbeat (guarding by 100Ch and 100Dh "
            "is none) runs on when that dies: take another drive or its newer firmware",
        )  # fmt: skip
        yield Step(HEARTBEAT_PRODUCER, self.heartbeat_ms, "the drive must send a heartbeat")
        for place, value in self.require:
            remedy = (
                "set require as the drive's manual says, or null where the measured stop decides"
            )
            yield Step(place, value, remedy)
        # it may be write-only
        yield Step(MODE, self.mode.number, "", needed=False, size=1)
        yield Step(MODE_SHOWN, self.mode.number, "the drive does not enter the mode", writes=False)
