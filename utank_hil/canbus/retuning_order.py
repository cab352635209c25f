"""What the operator orders of retuning."""

from typing import NamedTuple


class RetuningOrder(NamedTuple):
    """What the operator ordered since the last sample.

    Attributes
    ----------
    retune, undo : bool
        The button was pressed.
    forbidden : bool
        Retuning is forbidden, or was for a moment.
    """

    retune: bool = False
    undo: bool = False
    forbidden: bool = False
