"""The devices of a ship that are not nodes of the catalogue."""

from dataclasses import dataclass
from typing import Final

from utank_hil.canbus.messages import SensorMotion, SensorPump, SensorTank
from utank_hil.canbus.profiles.device_plan import DevicePlan
from utank_hil.canbus.profiles.drive_plan import DrivePlan


@dataclass(frozen=True, slots=True)
class ForeignDevices:
    """What the controller node needs to hear the devices of a ship."""

    #: Of the one or two motion sensors; None for a native one.
    motions: tuple[DevicePlan[SensorMotion] | None, ...] = (None, None)
    levels: DevicePlan[SensorTank] | None = None
    pump_sensor: DevicePlan[SensorPump] | None = None
    #: Names of the interfaces by their numbers; the controller's own, the first, has none.
    buses: tuple[str, ...] = ("",)
    receive_only: frozenset[str] = frozenset()  #: Interfaces on which nothing is sent.
    other_ids: frozenset[int] = frozenset()  #: Identifiers that are nobody's fault.
    other_pgns: frozenset[int] = frozenset()
    pump: DrivePlan | None = None  #: Drive of the pump.

    @property
    def any(self) -> bool:
        """Whether there are any."""
        return self != NO_FOREIGN_DEVICES

    def knows(self, can_id: int) -> bool:
        """Whether a frame on the controller's own bus is of a declared device."""
        group = can_id >> 8 & 0x3FFFF
        if group & 0xFF00 < 0xF000:  # the low byte is its destination
            group &= 0x3FF00
        return can_id in self.other_ids or group in self.other_pgns


NO_FOREIGN_DEVICES: Final = ForeignDevices()
