"""The CAN frame of nodes and ports."""

from typing import Final, NamedTuple

STANDARD: Final = 1 << 29  #: Mark of an identifier of 11 bits.
BUS_SHIFT: Final = 30  #: Above it stands the number of the interface; the controller's own is 0.
MOST_BUSES: Final = 4
OTHER_BUS: Final = 1 << BUS_SHIFT  #: Identifiers from here on are of other interfaces.
LONGEST_ID: Final = (1 << 29) - 1
LONGEST_STANDARD_ID: Final = (1 << 11) - 1


class Frame(NamedTuple):
    """One CAN 2.0 data frame of at most 8 bytes.

    `can_id` has 29 bits, or 11 bits with the mark `STANDARD`; above `BUS_SHIFT` stands the number
    of the interface.
    """

    can_id: int
    data: bytes
