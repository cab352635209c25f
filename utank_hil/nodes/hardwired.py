"""Hard-wired high-level switches and stop loop, as the controller hears them.

An open or broken stop loop acts from any intact frame, in or out of sequence and whatever its
quality. Only an accepted frame of a healthy node says that it is shut.
"""

from typing import Final

from utank_hil.canbus import Frame, HardwiredInputs, Receiver, Switch
from utank_hil.nodes.plausibility import NEVER_HEARD_NS, USABLE

# read once: in Python 3.11 a member costs eight times as much from its class as from here
_OFF: Final = Switch.OFF


class HardwiredHeard:
    """HARDWIRED_INPUTS: `stop` loop open or broken, `high_level` switch closed or broken."""

    def __init__(self, receiver: Receiver[HardwiredInputs]) -> None:
        self.receiver = receiver
        self.heard_ns = NEVER_HEARD_NS  #: When the last accepted frame of good quality came.
        self.stop = self._stop_heard = self.high_level = False

    def accept(self, frame: Frame) -> HardwiredInputs | None:
        """Return the message of a frame, None if it is rejected; hear its stop."""
        inputs = self.receiver.accept(frame)
        heard = self.receiver.intact(frame)
        if heard is not None and heard.stop_loop is not _OFF:
            self.stop = self._stop_heard = True
        return inputs

    def take_stop(self) -> bool:
        """Whether the stop loop is open or broken, or was in a frame since the last call."""
        stop = self.stop or self._stop_heard
        self._stop_heard = False
        return stop

    def take(self, inputs: HardwiredInputs, now_ns: int) -> None:
        """Take an accepted message."""
        # a broken switch counts as closed
        self.high_level = not (inputs.port_high is _OFF and inputs.starboard_high is _OFF)
        if inputs.quality in USABLE:
            self.heard_ns = now_ns
            self.stop = inputs.stop_loop is not _OFF
