"""Share of the bus in use, by the number of frames."""

from collections import deque
from typing import Final

from utank_hil.base.periodic import Schedule
from utank_hil.base.tick import TICK_NS

LOAD_LOOK_NS: Final = 10 * TICK_NS
LOAD_LOOKS: Final = 10
"""The load is that of a second, known anew every tenth: a flood may begin between two seconds."""
MEAN_FRAME_BITS: Final = 143
"""An eight-byte frame with a 29-bit identifier has 131 bits with its pause; stuffing adds 10 to the
frames of this bus in the mean and 29 at most."""


class BusLoad:
    """The load over the last second."""

    def __init__(self, bit_rate: int) -> None:
        self._bit_rate = bit_rate
        self._schedule = Schedule(LOAD_LOOK_NS)
        # at the first tick only a backlog was received
        self._counted: deque[tuple[int, int]] = deque(maxlen=LOAD_LOOKS + 1)
        self.share = 0.0  #: Share of the bus in use; zero in the first second.

    def update(self, now_ns: int, frames: int) -> float:
        """Take the frames heard and sent so far, once a tick; return `share`."""
        if self._schedule.due(now_ns):
            counted = self._counted
            counted.append((now_ns, frames))
            if len(counted) > LOAD_LOOKS:
                since_ns, before = counted[0]
                bits = (frames - before) * MEAN_FRAME_BITS
                self.share = bits / (self._bit_rate * (now_ns - since_ns) * 1e-9)
        return self.share
