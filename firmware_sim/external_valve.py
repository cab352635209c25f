"""The emulated ship's valve when a real one takes the place of the emulated one."""

import math
from collections.abc import Iterable

from firmware_sim.external_drive import STALE_NS
from firmware_sim.plant import Plant
from utank_hil.canbus import Catalogue, Frame, ValveStatus
from utank_hil.dynamics.tank import Tank
from utank_hil.dynamics.valves import Valve
from utank_hil.tick import TICK_NS


class ExternalValve:
    """Gives the plant the loss of the opening that a valve on the bus reports; sends nothing.

    Without a valid report for `STALE_NS` the valve counts as at its fail position.

    Parameters
    ----------
    valve : Valve
        Of the ship file: which loss an opening has.

    Attributes
    ----------
    hears : frozenset of int
        VALVE_STATUS, see `Selective`.
    """

    name = "external valve"
    period_ns = TICK_NS

    def __init__(self, plant: Plant, tank: Tank, valve: Valve, catalogue: Catalogue) -> None:
        self._plant = plant
        self._tank = tank
        self._valve = valve
        self._status = catalogue.receiver(ValveStatus)
        self.hears = frozenset([self._status.can_id])
        self._opening = valve.fail_opening
        self._reported_ns: int | None = None

    def receive(self, frame: Frame, now_ns: int) -> None:
        """Take the valve's report."""
        if frame.can_id != self._status.can_id:
            return
        status = self._status.accept(frame)
        if status is not None and math.isfinite(status.opening):
            self._opening, self._reported_ns = status.opening, now_ns

    def tick(self, now_ns: int) -> Iterable[Frame]:
        """Advance the plant, and set the loss from now on."""
        self._plant.advance(now_ns)
        fresh = self._reported_ns is not None and now_ns - self._reported_ns <= STALE_NS
        opening = self._opening if fresh else self._valve.fail_opening
        self._plant.set_valve_loss(self._valve.loss(self._tank, opening))
        return ()
