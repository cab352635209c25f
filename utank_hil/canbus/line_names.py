"""Names of buses that are no CAN interface: serial CAN adapters, lines of motion sentences."""

import termios
from ipaddress import AddressValueError, IPv4Address
from typing import Final, NamedTuple

SLCAN: Final = "slcan:"
"""Begins the name of a serial adapter: ``slcan:/dev/ttyACM0``, or with a bit rate behind it."""
UDP: Final = "udp:"
SERIAL: Final = "serial:"
LINES: Final = (UDP, SERIAL)
"""Begin the names of lines that bring the sentences of a motion sensor."""
DEFAULT_BIT_RATE: Final = 250_000
SERIAL_REMEDY: Final = (
    f"plug in the adapter and name its port, {SLCAN}/dev/ttyACM0 or with a bit rate "
    f"{SLCAN}/dev/ttyACM0:500000; it needs pip install pyserial"
)
LINE_REMEDY: Final = (
    f"write {UDP}OWN_ADDRESS:PORT:SENDER_ADDRESS or {SERIAL}/dev/ttyUSB0:115200; only one program "
    "can listen there"
)


def tty_and_bit_rate(name: str) -> tuple[str, int]:
    """The serial port of an adapter's name, and the bit rate that it is set to, bit/s."""
    tty, _, rate = name.removeprefix(SLCAN).partition(":")
    return tty, int(rate or DEFAULT_BIT_RATE)


class Line(NamedTuple):
    """Where sentences come in."""

    here: str  #: The machine's own address, or the serial port.
    number: int  #: UDP port, or bit/s.
    sender: str  #: Address that may send; empty for a serial port.


def line_of(name: str) -> Line:
    """What a line's name says; ValueError is raised if it says no line."""
    udp = name.startswith(UDP)
    here, _, rest = name.partition(":")[2].partition(":")
    number, _, sender = rest.partition(":")
    try:
        addresses = [IPv4Address(each) for each in (here, sender) if udp]
    except AddressValueError as error:
        raise ValueError(f"{name}: {error}") from error
    for each in addresses:
        if each.is_multicast or each.is_unspecified or each.is_reserved:
            raise ValueError(f"{name}: {each} is no one's own address")
    known = 0 < int(number) < 1 << 16 if number.isascii() and number.isdecimal() else False
    if not udp:
        known = hasattr(termios, f"B{number}") and number != "0" and here[:1] == "/" and not sender
    if not known:
        raise ValueError(f"{name}: is no line")
    return Line(here, int(number), sender)
