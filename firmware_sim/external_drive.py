"""The emulated ship's pump when a real drive takes the place of the emulated one."""

import math
from collections.abc import Iterable
from typing import Final

from firmware_sim.plant import Plant
from utank_hil.canbus import Catalogue, DriveStatus1, Frame
from utank_hil.tick import TICK_NS

STALE_NS: Final = 60_000_000
"""Three cycles of DRIVE_STATUS_1, after which the controller too calls a drive silent."""


class ExternalDrive:
    """Imposes on the plant the pressure that a drive on the bus reports; sends nothing.

    The pressure of a DRIVE_STATUS_1 acts from the tick after its receipt until the next one, in
    every state of the drive. Without a valid report for `STALE_NS` the rotor turns freely. A frame
    that fails CRC or counter is no report, nor is one whose pressure is not available.

    Attributes
    ----------
    hears : frozenset of int
        DRIVE_STATUS_1, see `Selective`.
    """

    name = "external drive"
    period_ns = TICK_NS

    def __init__(self, plant: Plant, catalogue: Catalogue) -> None:
        self._plant = plant
        self._status = catalogue.receiver(DriveStatus1)
        self.hears = frozenset([self._status.can_id])
        self._pressure_pa = 0.0
        self._reported_ns: int | None = None
        self._ticks = self._fresh_ticks = 0

    @property
    def reported_share(self) -> float:
        """Share of the ticks so far that had a report no older than `STALE_NS`."""
        return self._fresh_ticks / max(self._ticks, 1)

    def receive(self, frame: Frame, now_ns: int) -> None:
        """Take the drive's report."""
        if frame.can_id != self._status.can_id:
            return
        status = self._status.accept(frame)
        if status is not None and math.isfinite(status.pressure_pa):
            self._pressure_pa = status.pressure_pa
            self._reported_ns = now_ns

    def tick(self, now_ns: int) -> Iterable[Frame]:
        """Advance the plant, and set the pressure from now on."""
        self._plant.advance(now_ns)
        self._ticks += 1
        if self._reported_ns is not None and now_ns - self._reported_ns <= STALE_NS:
            self._fresh_ticks += 1
            self._plant.impose_pressure(self._pressure_pa)
        else:
            self._plant.drive_pump(0.0, enabled=False)
        return ()
