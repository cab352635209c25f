"""High-level switches and stop loop that a ship may have on separate wires."""

from collections.abc import Iterable
from typing import TYPE_CHECKING

from utank_hil.base.tick import TICK_NS
from utank_hil.canbus import (
    Address,
    Catalogue,
    Frame,
    HardwiredInputs,
    Quality,
    Switch,
)
from utank_hil.nodes.housekeeping import Housekeeping

if TYPE_CHECKING:
    from firmware_sim.plant import Plant  # compiled: a scenario is read without it


class HardwiredNode:
    """Node that sends the state of the wires.

    A reservoir's switch closes at `high_level_m` above still water. The stop cuts the drive.
    """

    name = "hardwired"
    period_ns = TICK_NS
    hears: frozenset[int] = frozenset()

    def __init__(
        self,
        plant: "Plant",
        high_level_m: float,
        catalogue: Catalogue,
        *,
        configuration_version: int,
    ) -> None:
        self._plant = plant
        self._high_level_m = high_level_m
        self._transmitter = catalogue.transmitter(HardwiredInputs)
        self._cycle_ticks = self._transmitter.cycle_ns // self.period_ns
        self._housekeeping = Housekeeping(Address.HARDWIRED, catalogue, configuration_version)
        self._ticks = 0
        self._was_open = False
        self.stop_pressed = False  #: Whether the hard-wired stop is pressed, which opens its loop.

    def receive(self, frame: Frame, now_ns: int) -> None:
        """Ignore the frame."""

    def tick(self, now_ns: int) -> Iterable[Frame]:
        """Read the inputs, and send them when due."""
        self._plant.advance(now_ns)
        self._plant.cut_power(self.name, cut=self.stop_pressed)
        frames: list[Frame] = []
        is_open = self.stop_pressed
        if self._ticks % self._cycle_ticks == 0 or is_open is not self._was_open:
            self._was_open = is_open
            level_m, limit_m = self._plant.level_m, self._high_level_m
            inputs = HardwiredInputs(
                _switch(-level_m > limit_m),
                _switch(level_m > limit_m),
                _switch(is_open),
                Quality.GOOD,
            )
            frames.append(self._transmitter.frame(inputs))
        frames.extend(self._housekeeping.frames(now_ns))
        self._ticks += 1
        return frames


def _switch(on: bool) -> Switch:
    return Switch.ON if on else Switch.OFF
