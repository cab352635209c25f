"""The guard on the bench: a node that hears the controller's frames and cuts the drive's power."""

from collections.abc import Iterable
from typing import TYPE_CHECKING

from firmware_sim.guard.parameters import GuardParameters
from firmware_sim.guard.reference import Guard
from utank_hil.base.tick import TICK_NS
from utank_hil.canbus import Frame

if TYPE_CHECKING:
    from firmware_sim.plant import Plant  # compiled: a scenario is read without it


class GuardNode:
    """The guard, on the safe torque off of the emulated drive."""

    name = "guard"
    period_ns = TICK_NS

    def __init__(self, parameters: GuardParameters, plant: "Plant | None" = None) -> None:
        self.guard = Guard(parameters)
        self.hears = frozenset(each.can_id for each in parameters.messages)
        self._plant = plant  # without one it only judges

    def receive(self, frame: Frame, now_ns: int) -> None:  # noqa: ARG002
        """Take one frame from the bus."""
        self.guard.receive(frame)

    def tick(self, now_ns: int) -> Iterable[Frame]:  # noqa: ARG002
        """Judge; cut the drive's power, or let it on. Nothing is sent."""
        reasons = self.guard.tick()
        if self._plant is not None:
            self._plant.cut_power("guard", cut=reasons != 0)
        return ()
