"""Faults of whole nodes, of pump, drive, valve and law."""

import math
from typing import Literal

from pydantic import field_validator

from firmware_sim.fault_injection.fault import Fault, NodeName
from firmware_sim.fault_injection.faulty_node import Span, Spoiled
from firmware_sim.fault_injection.place import Bench
from utank_hil.base.parameters import Finite, NotNegative
from utank_hil.base.tick import TICK_S
from utank_hil.canbus import DriveFault


class NodeFault(Fault):
    """A fault of a node."""

    node: NodeName

    def node_names(self) -> tuple[str, ...]:
        """The node."""
        return (self.node,)


class Hangs(NodeFault):
    """The node neither hears nor sends; then it goes on where it was."""

    kind: Literal["hangs"]

    @property
    def beyond_commands(self) -> bool:
        """A drive that hangs keeps its last pressure."""
        return self.node == "drive"

    def place(self, bench: Bench, span: Span, seed: int) -> None:  # noqa: ARG002
        """Hold the node."""
        bench.nodes[self.node].hangs.append(span)


class Killed(Fault):
    """The controller's process dies; one that is started anew takes its place in the end."""

    replayable = False
    needs = ("controller",)
    kind: Literal["killed"]

    def place(self, bench: Bench, span: Span, seed: int) -> None:  # noqa: ARG002
        """Hold the controller, then build another."""
        node = bench.nodes["controller"]
        node.hangs.append(span)
        assert bench.restart is not None
        node.at(span.end_ns, bench.restart)


class Mute(NodeFault):
    """The node sends nothing."""

    kind: Literal["mute"]

    def place(self, bench: Bench, span: Span, seed: int) -> None:  # noqa: ARG002
        """Lose all that it sends."""
        bench.nodes[self.node].spoiled.append(Spoiled(span, lambda *_: ()))


class Deaf(NodeFault):
    """The node hears nothing."""

    kind: Literal["deaf"]

    def place(self, bench: Bench, span: Span, seed: int) -> None:  # noqa: ARG002
        """Keep all frames away."""
        bench.nodes[self.node].deaf.append(span)


class Link(NodeFault):
    """The node's interface reports an error all the while.

    Meanwhile it carries nothing, unless it only warns.
    """

    kind: Literal["link"]
    reason: str
    """What the interface reports."""
    warns: bool = False
    """Frames are carried all the same."""

    def place(self, bench: Bench, span: Span, seed: int) -> None:  # noqa: ARG002
        """Cut the node off."""
        node = bench.nodes[self.node]
        (node.warned if self.warns else node.cut_off).append((span, self.reason))


class Pump(Fault):
    """While enabled, the pump presses with `times` its set-point and `plus_pa`, after `lag_s`.

    With `off_too`, no command takes `plus_pa` away. Of several the one that began last is there.
    """

    needs = ("drive",)
    kind: Literal["pump"]
    times: Finite = 1.0
    """Share of the set-point that it gives; negative for the wrong way."""
    plus_pa: Finite = 0.0
    """Pressure that it gives besides."""
    lag_s: NotNegative = 0.0
    """Time constant with which it does."""
    off_too: bool = False
    """It presses while it is off, too."""

    @property
    def beyond_commands(self) -> bool:
        """As `off_too` says."""
        return self.off_too

    def place(self, bench: Bench, span: Span, seed: int) -> None:  # noqa: ARG002
        """Break the pump, and mend it in the end."""
        share = 1.0 - math.exp(-TICK_S / self.lag_s) if self.lag_s else 1.0
        pressure_pa = [0.0]

        def broken(setpoint_pa: float) -> float:
            wrong_pa = self.times * setpoint_pa + self.plus_pa
            pressure_pa[0] += share * (wrong_pa - pressure_pa[0])
            return pressure_pa[0]

        drive, plant = bench.nodes["drive"], bench.plant

        def begin() -> None:
            plant.broken_pump, plant.presses_off = broken, self.off_too

        def end() -> None:
            if plant.broken_pump is broken:  # else another fault has begun since
                plant.broken_pump, plant.presses_off = None, False

        drive.at(span.begin_ns, begin)
        drive.at(span.end_ns, end)


class Drive(Fault):
    """The drive fails when the fault begins, as DRIVE_STATUS_2 names it; NONE switches it off."""

    needs = ("drive",)
    kind: Literal["drive"]
    fault: str
    """As DRIVE_STATUS_2 names it."""

    @field_validator("fault")
    @classmethod
    def _known(cls, name: str) -> str:
        if name not in DriveFault.__members__:
            raise ValueError(f"must be one of {', '.join(DriveFault.__members__)}")
        return name

    def place(self, bench: Bench, span: Span, seed: int) -> None:  # noqa: ARG002
        """Trip it."""
        drive = bench.drive
        assert drive is not None
        bench.nodes["drive"].at(span.begin_ns, lambda: drive.fail(DriveFault[self.fault]))


class Valve(Fault):
    """The valve does not move, or has no power."""

    needs = ("valve",)
    kind: Literal["valve"]
    fails: Literal["stuck", "powerless"]
    """What it does."""

    def place(self, bench: Bench, span: Span, seed: int) -> None:  # noqa: ARG002
        """Break the valve, and mend it in the end."""
        name, broken = ("stuck", True) if self.fails == "stuck" else ("powered", False)
        node = bench.nodes["valve"]
        node.at(span.begin_ns, lambda: setattr(bench.valve, name, broken))
        node.at(span.end_ns, lambda: setattr(bench.valve, name, not broken))


class Law(Fault):
    """The control law raises an error, or answers no number, the opposite or one side.

    That of a controller that is started anew meanwhile does so, too.
    """

    replayable = False
    needs = ("controller",)
    kind: Literal["law"]
    fails: Literal["raises", "answers_nan", "opposite", "leans"]
    """What it does."""

    def place(self, bench: Bench, span: Span, seed: int) -> None:  # noqa: ARG002
        """Break the law, and mend it in the end."""
        node = bench.nodes["controller"]
        node.at(span.begin_ns, lambda: setattr(bench.law, self.fails, True))
        node.at(span.end_ns, lambda: setattr(bench.law, self.fails, False))
