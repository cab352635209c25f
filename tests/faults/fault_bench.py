"""The whole bench in lockstep, with nodes that fail between two times, and a listener."""

from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path

from firmware_sim.scenario import Scenario
from firmware_sim.ship_side import ShipSide, build_ship_side
from utank_hil.assembly import build_controller_node
from utank_hil.canbus import (
    DriveState,
    DriveStatus1,
    Frame,
    OperatorCommand,
    PumpCommand,
    load_catalogue,
)
from utank_hil.configuration import load_config
from utank_hil.nodes.controller import ControllerNode
from utank_hil.nodes.panel import Action, TimedAction
from utank_hil.runners import Lockstep, Node

CATALOGUE = load_catalogue()
SECOND = 1_000_000_000
MS = 1_000_000
ARMED = (TimedAction(1.0, Action.ARM),)

Fault = Callable[[Frame], Iterable[Frame]]
"""Frames that reach the bus instead of one that its node sent."""


@cache
def storm():
    """The shipped storm."""
    return load_config(Path("configs/scenarios/storm.yaml"), Scenario)


def controller_config(name="gpc"):
    """One of its controllers."""
    return storm().controllers[name]


@dataclass
class Failing:
    """A node whose frames are spoiled, or that hangs or restarts, between two times.

    `restarted` builds the node that takes its place when the fault ends; `delay_ticks` holds from
    `begin_ns` on.
    """

    node: Node
    begin_ns: int = 1 << 62
    end_ns: int = 1 << 62
    spoil: Fault | None = None
    hangs: bool = False
    restarted: Callable[[], Node] | None = None
    delay_ticks: int = 0
    _held: list[list[Frame]] = field(default_factory=list)

    @property
    def name(self):
        return self.node.name

    @property
    def period_ns(self):
        return self.node.period_ns

    def receive(self, frame, now_ns):
        if not (self.hangs and self.begin_ns <= now_ns < self.end_ns):
            self.node.receive(frame, now_ns)

    def tick(self, now_ns):
        if now_ns >= self.end_ns and self.restarted is not None:
            self.node, self.restarted = self.restarted(), None
        active = self.begin_ns <= now_ns < self.end_ns
        if active and self.hangs:
            return ()
        frames = list(self.node.tick(now_ns))
        if active and self.spoil is not None:
            frames = [out for frame in frames for out in self.spoil(frame)]
        if now_ns >= self.begin_ns and self.delay_ticks:
            self._held.append(frames)
            frames = self._held.pop(0) if len(self._held) > self.delay_ticks else []
        return frames


def dropped(*messages):
    """Loses messages; all of the node's if none is named."""
    ids = {CATALOGUE.receiver(message).can_id for message in messages}
    return lambda frame: () if not ids or frame.can_id in ids else (frame,)


def corrupted(*messages, byte=3):
    """Flips bits of messages."""
    ids = {CATALOGUE.receiver(message).can_id for message in messages}

    def corrupt(frame):
        if ids and frame.can_id not in ids:
            return (frame,)
        data = bytearray(frame.data)
        data[byte] ^= 0x24
        return (Frame(frame.can_id, bytes(data)),)

    return corrupt


def frozen(*messages):
    """Sends the first frame of the fault over and over."""
    ids = {CATALOGUE.receiver(message).can_id for message in messages}
    first: dict[int, Frame] = {}

    def freeze(frame):
        if ids and frame.can_id not in ids:
            return (frame,)
        return (first.setdefault(frame.can_id, frame),)

    return freeze


def doubled(frame):
    """Sends every frame twice."""
    return (frame, frame)


def altered(kind, change, counter_step=1):
    """Changes what messages of a kind say, rightly protected; their counter runs in steps."""
    receiver, transmitter = CATALOGUE.receiver(kind), CATALOGUE.transmitter(kind)

    def alter(frame):
        if frame.can_id != receiver.can_id:
            return (frame,)
        message = receiver.accept(frame)
        transmitter.counter = counter_step * frame.data[1] - 1
        return (transmitter.frame(change(message)),)

    return alter


@dataclass
class Babbler:
    """Sends frames of one identifier as fast as it is asked to, between two times."""

    can_id: int
    per_tick: int
    begin_ns: int
    end_ns: int = 1 << 62
    name: str = "babbler"
    period_ns: int = MS

    def receive(self, frame, now_ns):
        pass

    def tick(self, now_ns):
        if self.begin_ns <= now_ns < self.end_ns:
            return [Frame(self.can_id, bytes(8))] * self.per_tick
        return ()


class Listener:
    """Every frame on the bus with its time; what it meant, decoded apart from the nodes."""

    def __init__(self):
        self.commands: list[tuple[int, PumpCommand]] = []
        self.states: list[tuple[int, DriveState | None]] = []
        self.orders: list[tuple[int, OperatorCommand]] = []
        self._decode = {
            CATALOGUE.receiver(message).can_id: CATALOGUE.receiver(message)
            for message in (PumpCommand, DriveStatus1, OperatorCommand)
        }

    def __call__(self, time_ns, sender, frame):
        receiver = self._decode.get(frame.can_id)
        message = None if receiver is None else receiver.accept(frame)
        if isinstance(message, PumpCommand) and sender == "controller":
            self.commands.append((time_ns, message))
        elif isinstance(message, DriveStatus1):
            self.states.append((time_ns, message.state))
        elif isinstance(message, OperatorCommand):
            self.orders.append((time_ns, message))


class FaultBench:
    """Ship's side and controller on one simulated bus, each behind a `Failing`.

    The controller is one of the scenario, by default the storm; `extra` nodes are on the bus, too.
    """

    def __init__(self, seed=1, script=ARMED, controller="gpc", extra=(), scenario=None):
        scenario = storm() if scenario is None else scenario
        self.config = scenario.controllers[controller]
        self.ship: ShipSide = build_ship_side(scenario, seed, script)
        nodes = {id(node): Failing(node) for node in self.ship.nodes}
        self.sensors, self.drive, self.panel = (
            nodes[id(node)] for node in (self.ship.sensors, self.ship.drive, self.ship.panel)
        )
        self.controller = Failing(build_controller_node(self.config, commissioned=True))
        self.heard = Listener()
        self.lockstep = Lockstep([*nodes.values(), self.controller, *extra], trace=self.heard)

    def run(self, until_s):
        """Run to a time."""
        self.lockstep.run_until(round(until_s * SECOND))

    def restarted_controller(self):
        """A new controller, as after a restart of its process."""
        return build_controller_node(self.config, commissioned=True)

    @property
    def node(self):
        """The controller that runs at present."""
        assert isinstance(self.controller.node, ControllerNode)
        return self.controller.node

    @property
    def mode(self):
        return self.node.mode

    def commands(self, begin_ns, end_ns=1 << 62):
        """Pump commands of the controller seen on the bus in a time."""
        return [item for item in self.heard.commands if begin_ns <= item[0] < end_ns]

    def zero_ns(self, after_ns):
        """When the commanded pressure reached zero for good, the last command with pressure."""
        nonzero = [t for t, command in self.heard.commands if command.pressure_pa != 0.0]
        return max([after_ns, *nonzero])

    def pressure_at_zero_since(self, begin_ns):
        """Whether commands came since a time, and all of them asked for nothing."""
        pressures = {command.pressure_pa for _, command in self.commands(begin_ns)}
        return pressures == {0.0}

    def left_enabled_ns(self, after_ns):
        """When the drive first said that it is no longer in operation enabled."""
        return next(
            time_ns
            for time_ns, state in self.heard.states
            if time_ns >= after_ns and state is not DriveState.OPERATION_ENABLED
        )
