"""Names of serial CAN adapters (slcan)."""

from typing import Final

SLCAN: Final = "slcan:"
"""Begins the name of a serial adapter: ``slcan:/dev/ttyACM0``, or with a bit rate behind it."""
DEFAULT_BIT_RATE: Final = 250_000
SERIAL_REMEDY: Final = (
    f"plug in the adapter and name its port, {SLCAN}/dev/ttyACM0 or with a bit rate "
    f"{SLCAN}/dev/ttyACM0:500000; it needs pip install pyserial"
)


def tty_and_bit_rate(name: str) -> tuple[str, int]:
    """The serial port of an adapter's name, and the bit rate that it is set to, bit/s."""
    tty, _, rate = name.removeprefix(SLCAN).partition(":")
    return tty, int(rate or DEFAULT_BIT_RATE)
