"""What the operator orders of retuning."""

from typing import NamedTuple


class RetuningOrder(NamedTuple):
    """What the operator ordered since the last sample."""

    #: retune, undo: the button was pressed.
    retune: bool = False
    undo: bool = False
    forbidden: bool = False  #: Retuning is forbidden, or was for a moment.
