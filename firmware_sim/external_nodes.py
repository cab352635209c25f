"""Pump and valve of the emulated ship when real hardware takes the place of the emulated nodes.

Each node makes the plant follow the hardware's reports, and sends nothing. A report acts from the
tick after its receipt until the next one, for `STALE_NS` at most. A frame with a wrong CRC or
counter, or whose value is not available, is ignored.
"""

import math
from abc import ABC, abstractmethod
from collections.abc import Iterable
from typing import Any, Final

from firmware_sim.plant import Plant
from utank_hil.base.tick import TICK_NS
from utank_hil.canbus import Catalogue, DriveStatus1, Frame, Receiver, ValveStatus
from utank_hil.dynamics.tank import Tank
from utank_hil.dynamics.valves import Valve

STALE_NS: Final = 60_000_000
"""Three cycles of the reports: the controller's own limit for a silent drive or valve."""


class _ExternalNode(ABC):
    period_ns = TICK_NS

    def __init__(self, plant: Plant, receiver: Receiver[Any], signal: str) -> None:
        self._plant, self._receiver, self._signal = plant, receiver, signal
        self.hears = frozenset([receiver.can_id])  # see `Selective`
        self._value = math.nan
        self._reported_ns = -STALE_NS - 1
        self._ticks = self._fresh_ticks = 0

    @property
    def reported_share(self) -> float:
        """Share of the ticks so far with a report no older than `STALE_NS`."""
        return self._fresh_ticks / max(self._ticks, 1)

    def receive(self, frame: Frame, now_ns: int) -> None:
        """Store the report."""
        if frame.can_id != self._receiver.can_id:
            return
        status = self._receiver.accept(frame)
        if status is not None and math.isfinite(value := getattr(status, self._signal)):
            self._value, self._reported_ns = value, now_ns

    def tick(self, now_ns: int) -> Iterable[Frame]:
        """Advance the plant, and apply the report from now on."""
        self._plant.advance(now_ns)
        fresh = now_ns - self._reported_ns <= STALE_NS
        self._ticks += 1
        self._fresh_ticks += fresh
        self._act(self._value if fresh else None)
        return ()

    @abstractmethod
    def _act(self, value: float | None) -> None:
        """Apply a reported value to the plant; None without a fresh report."""


class ExternalDrive(_ExternalNode):
    """Node that imposes the pressure of DRIVE_STATUS_1, in every state of the drive.

    Without a report the rotor turns freely.
    """

    name = "external drive"

    def __init__(self, plant: Plant, catalogue: Catalogue) -> None:
        super().__init__(plant, catalogue.receiver(DriveStatus1), "pressure_pa")

    def _act(self, value: float | None) -> None:
        if value is None:
            self._plant.drive_pump(0.0, enabled=False)
        else:
            self._plant.impose_pressure(value)


class ExternalValve(_ExternalNode):
    """Node that sets the loss of VALVE_STATUS's opening; without a report the fail position's."""

    name = "external valve"

    def __init__(self, plant: Plant, tank: Tank, valve: Valve, catalogue: Catalogue) -> None:
        super().__init__(plant, catalogue.receiver(ValveStatus), "opening")
        self._tank, self._valve = tank, valve

    def _act(self, value: float | None) -> None:
        opening = self._valve.fail_opening if value is None else value
        self._plant.set_valve_loss(self._valve.loss(self._tank, opening))
