"""Faults of nodes, pump, drive, valve and law."""

from collections.abc import Sequence
from functools import partial
from typing import Annotated, Literal

from firmware_sim.canopen_node import CanopenNode
from firmware_sim.fault_injection.bench_parts import Bench, LawFailure, Span, Spoiled
from firmware_sim.fault_injection.fault import Fault, NodeName, one_of
from utank_hil.base.elementary import exp
from utank_hil.base.parameters import Finite, NotNegative, Range
from utank_hil.base.tick import TICK_S
from utank_hil.canbus import DriveFault, Frame
from utank_hil.canbus.frame import OTHER_BUS, STANDARD
from utank_hil.configuration.device_sections import EmergencyCode, Id11


class NodeFault(Fault):
    """Fault of a node."""

    node: NodeName

    def _canopen(self, bench: Bench) -> Sequence[CanopenNode]:
        devices: Sequence[CanopenNode] = getattr(bench.nodes[self.node].node, "canopen", ())
        if not devices:
            raise ValueError(f"{self.node} is no CANopen device, as this fault needs")
        return devices


class Silenced(NodeFault):
    """The node neither receives nor sends (hangs), sends nothing (mute), or hears nothing (deaf).

    One that hung goes on where it was.
    """

    kind: Literal["hangs", "mute", "deaf"]

    @property
    def beyond_commands(self) -> bool:
        """Whether the node is the drive, which keeps its last pressure while it hangs."""
        return self.kind == "hangs" and self.node == "drive"

    def _place(self, bench: Bench, span: Span, seed: int) -> None:  # noqa: ARG002
        node = bench.nodes[self.node]
        if self.kind == "mute":
            node.spoiled.append(Spoiled(span, lambda *_: ()))
        else:
            (node.hangs if self.kind == "hangs" else node.deaf).append(span)


class Killed(Fault):
    """The controller's process dies; a restarted one replaces it at the end of the fault."""

    replayable = False
    needs = ("controller",)
    kind: Literal["killed"]

    def _place(self, bench: Bench, span: Span, seed: int) -> None:  # noqa: ARG002
        node = bench.nodes["controller"]
        node.hangs.append(span)
        assert bench.restart is not None
        node.at(span.end_ns, bench.restart)


class LostIdentifier(NodeFault):
    """Frames of one 11-bit identifier do not leave the node, as PDOs and heartbeats of CANopen."""

    kind: Literal["lost_identifier"]
    id_11bit: Id11  #: Identifier of the frames.
    #: The last of so many frames leaves; none without it.
    keeps_one_of: Annotated[int, Range(least=2, most=1000)] | None = None

    def _place(self, bench: Bench, span: Span, seed: int) -> None:  # noqa: ARG002
        count = [0]

        def lose(frame: Frame, _: float) -> tuple[Frame, ...]:
            if frame.can_id & (OTHER_BUS - 1) != STANDARD | self.id_11bit:
                return (frame,)
            count[0] += 1
            kept = self.keeps_one_of is not None and count[0] % self.keeps_one_of == 0
            return (frame,) if kept else ()

        bench.nodes[self.node].spoiled.append(Spoiled(span, lose))


class Replaced(NodeFault):
    """Another device of the same kind, with another serial number, starts in the node's place."""

    kind: Literal["replaced"]

    def _place(self, bench: Bench, span: Span, seed: int) -> None:  # noqa: ARG002
        for each in self._canopen(bench):
            bench.nodes[self.node].at(span.begin_ns, each.swap)


class Emergency(NodeFault):
    """A CANopen device sends an emergency message (EMCY), and one without error at the end."""

    kind: Literal["emergency"]
    code: EmergencyCode  #: Its emergency error code, CiA 301.

    def _place(self, bench: Bench, span: Span, seed: int) -> None:  # noqa: ARG002
        node = bench.nodes[self.node]
        for each in self._canopen(bench):
            node.at(span.begin_ns, partial(each.emergency, self.code))
            node.at(span.end_ns, partial(each.emergency, 0))


class Link(NodeFault):
    """The node's interface reports an error during the whole fault.

    It carries no frames meanwhile, unless the error is only a warning.
    """

    kind: Literal["link"]
    reason: str  #: Text of the error that the interface reports.
    warns: bool = False  #: Whether the error is a warning and frames are still carried.

    def _place(self, bench: Bench, span: Span, seed: int) -> None:  # noqa: ARG002
        node = bench.nodes[self.node]
        node.reported.append((span, self.reason))
        if not self.warns:
            node.deaf.append(span)
            node.spoiled.insert(0, Spoiled(span, lambda *_: ()))


class Pump(Fault):
    """While enabled, the pump gives `times` its set-point plus `plus_pa`, with a lag of `lag_s`.

    With `off_too`, no command removes `plus_pa`. Of several such faults the latest one applies.
    """

    needs = ("drive",)
    kind: Literal["pump"]
    times: Finite = 1.0  #: Factor on the set-point; negative for reversed pressure.
    plus_pa: Finite = 0.0  #: Pressure added to it.
    lag_s: NotNegative = 0.0  #: Time constant of the faulty pressure.
    off_too: bool = False  #: Whether the pressure is present while the pump is off.

    @property
    def beyond_commands(self) -> bool:
        """Whether the pressure is present while the pump is off."""
        return self.off_too

    def _place(self, bench: Bench, span: Span, seed: int) -> None:  # noqa: ARG002
        share = 1.0 - exp(-TICK_S / self.lag_s) if self.lag_s else 1.0
        pressure_pa = [0.0]

        def broken(setpoint_pa: float) -> float:
            wrong_pa = self.times * setpoint_pa + self.plus_pa
            pressure_pa[0] += share * (wrong_pa - pressure_pa[0])
            return pressure_pa[0]

        drive, plant = bench.nodes["drive"], bench.plant

        def begin() -> None:
            plant.broken_pump, plant.presses_off = broken, self.off_too

        def end() -> None:
            if plant.broken_pump is broken:  # otherwise another fault has begun since
                plant.broken_pump, plant.presses_off = None, False

        drive.at(span.begin_ns, begin)
        drive.at(span.end_ns, end)


class Drive(Fault):
    """The drive fails at the start of the fault; NONE switches it off."""

    needs = ("drive",)
    kind: Literal["drive"]
    #: Name of the fault in DRIVE_STATUS_2.
    fault: Annotated[str, one_of("fault of a drive", lambda: list(DriveFault.__members__))]

    def _place(self, bench: Bench, span: Span, seed: int) -> None:  # noqa: ARG002
        drive = bench.drive
        assert drive is not None
        bench.nodes["drive"].at(span.begin_ns, lambda: drive.fail(DriveFault[self.fault]))


class Valve(Fault):
    """The valve sticks or loses its power."""

    needs = ("valve",)
    kind: Literal["valve"]
    fails: Literal["stuck", "powerless"]  #: Kind of failure.

    def _place(self, bench: Bench, span: Span, seed: int) -> None:  # noqa: ARG002
        name, broken = ("stuck", True) if self.fails == "stuck" else ("powered", False)
        for time_ns, value in zip(span, (broken, not broken), strict=True):
            bench.nodes["valve"].at(time_ns, partial(setattr, bench.valve, name, value))


class Law(Fault):
    """The control law raises an error, or returns NaN, the negated or a one-sided answer.

    The law of a controller that is restarted meanwhile fails in the same way.
    """

    replayable = False
    needs = ("controller",)
    kind: Literal["law"]
    fails: LawFailure  #: Kind of failure.

    def _place(self, bench: Bench, span: Span, seed: int) -> None:  # noqa: ARG002
        node = bench.nodes["controller"]
        node.at(span.begin_ns, partial(bench.law.add, self.fails))
        node.at(span.end_ns, partial(bench.law.discard, self.fails))
