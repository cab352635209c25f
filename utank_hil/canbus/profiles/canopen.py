"""CANopen as controller and emulated drive speak it: CiA 301 network management, SDO and PDO."""

from enum import IntEnum
from typing import Final, NamedTuple

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


def read_request(place: Place) -> bytes:
    """Request of an entry's value."""
    return _sdo(0x40, place, 0)


def write_request(place: Place, value: int, size: int) -> bytes:
    """Request to write an entry of one to four bytes, expedited."""
    return _sdo(0x23 | (4 - size) << 2, place, value & (1 << 8 * size) - 1)


def value_answer(place: Place, value: int, size: int) -> bytes:
    """A server's answer to `read_request`, expedited."""
    return _sdo(0x43 | (4 - size) << 2, place, value)


def written_answer(place: Place) -> bytes:
    """A server's answer to `write_request`."""
    return _sdo(0x60, place, 0)


def refusal(place: Place, abort: int) -> bytes:
    """A server's abort."""
    return _sdo(0x80, place, abort)


def _sdo(command: int, place: Place, value: int) -> bytes:
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
    if command == 0x80:
        return Answer(place, abort=int.from_bytes(data[4:8], "little"))
    if command == 0x60:
        return Answer(place)
    # an entry longer than four bytes (no expedited bit) is none that is asked for
    return Answer(place, value, size) if command & 0xE2 == 0x42 else None


def mapped(place: Place, bits: int) -> int:
    """An entry of a PDO's mapping."""
    return place.number << 16 | place.subindex << 8 | bits
