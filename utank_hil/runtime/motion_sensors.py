"""Two motion sensors, of which one is used at a time."""

from typing import Final

from utank_hil.canbus import Receiver, SensorMotion
from utank_hil.runtime.orders import NEVER_HEARD_NS

SILENT_NS: Final = 25_000_000
"""Two of its samples are missing: the other sensor is used, before the first one counts as
silent."""


class MotionSensor:
    """One of the two.

    Attributes
    ----------
    receiver : Receiver of SensorMotion
        As given.
    roll_rad, roll_rate_rad_s : float
        Of the last good sample, received at `heard_ns`.
    """

    __slots__ = ("heard_ns", "receiver", "roll_rad", "roll_rate_rad_s")

    def __init__(self, receiver: Receiver[SensorMotion]) -> None:
        self.receiver = receiver
        self.roll_rad = self.roll_rate_rad_s = 0.0
        self.heard_ns = NEVER_HEARD_NS


class MotionSensors:
    """Both sensors; the first one is used until it is silent or found wrong, then the other.

    Attributes
    ----------
    first, second : MotionSensor
    used, spare : MotionSensor
        The same two.
    """

    def __init__(self, first: Receiver[SensorMotion], second: Receiver[SensorMotion]) -> None:
        self.first = self.used = MotionSensor(first)
        self.second = self.spare = MotionSensor(second)

    def exchange(self) -> None:
        """Use the other sensor from now on."""
        self.used, self.spare = self.spare, self.used

    def silent(self, now_ns: int) -> bool:
        """Whether the sensor in use is silent, and the other one is not."""
        oldest_ns = now_ns - SILENT_NS
        return self.used.heard_ns < oldest_ns <= self.spare.heard_ns
