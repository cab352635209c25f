"""Two motion sensors, of which one is used at a time."""

from typing import Final

from utank_hil.canbus import Receiver, SensorMotion
from utank_hil.nodes.orders import NEVER_HEARD_NS

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
    accused : bool
        Whether anything has spoken against it since both agreed; the monitors' to set.
    """

    __slots__ = ("accused", "heard_ns", "receiver", "roll_rad", "roll_rate_rad_s")

    def __init__(self, receiver: Receiver[SensorMotion]) -> None:
        self.receiver = receiver
        self.roll_rad = self.roll_rate_rad_s = 0.0
        self.heard_ns = NEVER_HEARD_NS
        self.accused = False


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
        """Whether the sensor in use is silent, and the other one is neither that nor accused."""
        oldest_ns, spare = now_ns - SILENT_NS, self.spare
        return self.used.heard_ns < oldest_ns <= spare.heard_ns and not spare.accused
