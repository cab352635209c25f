"""The CAN frame of nodes and ports."""

from typing import NamedTuple


class Frame(NamedTuple):
    """One CAN 2.0B data frame with a 29-bit identifier.

    Attributes
    ----------
    can_id : int
        Extended identifier, 0 to 2**29 - 1.
    data : bytes
        Payload, at most 8 bytes.
    """

    can_id: int
    data: bytes
