"""The runs whose frame logs are kept in ``tests/replay``: each mode, several faults, a retuning.

All are in simulated time and follow from this file, the shipped configurations and their seeds.
"""

from collections.abc import Callable, Iterable
from dataclasses import dataclass, field, fields, replace
from pathlib import Path
from typing import Any, Final

from firmware_sim.scenario import Scenario
from firmware_sim.ship_side import build_ship_side
from utank_hil.assembly import build_controller_node, build_law, works_of
from utank_hil.canbus import (
    DriveFault,
    DriveStatus2,
    Frame,
    OperatorCommand,
    PumpCommand,
    SensorMotion,
    SensorTank,
    Switch,
    load_catalogue,
)
from utank_hil.configuration import ControllerConfig, load_config
from utank_hil.retuning import SimulatedRetuner
from utank_hil.runtime import Lockstep, Node
from utank_hil.runtime.node import Selective
from utank_hil.runtime.panel import Action, TimedAction
from utank_hil.telemetry.frame_log import BlockSink, FrameLogWriter
from utank_hil.telemetry.node_tap import NodeTap, Tapped
from utank_hil.telemetry.replay_head import replay_head

SCENARIOS: Final = Path("configs/scenarios")
CONTROLLERS: Final = Path("configs/controllers")
_WHOLE_NS: Final = 1 << 62
_CATALOGUE: Final = load_catalogue()

Spoil = Callable[[Frame], Iterable[Frame]]
"""Frames that reach the bus instead of one that its node sent."""
Script = tuple[tuple[float, Action], ...]

ARM: Final[Script] = ((0.3, Action.ARM),)
AGAIN: Final[Script] = ((6.0, Action.RESET), (6.5, Action.DISARM), (7.0, Action.ARM))


@dataclass(frozen=True)
class Trouble:
    """What happens to one node between two times.

    Attributes
    ----------
    node : str
        Its name; the controller's is "controller".
    begin_s, end_s : float
    spoil : callable, optional
        What becomes of its frames; without it, the node does not tick.
    """

    node: str
    begin_s: float
    end_s: float = 1e6
    spoil: Spoil | None = None


@dataclass(frozen=True)
class Case:
    """One run.

    Attributes
    ----------
    name : str
        Also of the file.
    controller : str
        Name of a shipped controller.
    seconds : float
    script : tuple
        Times and buttons of the operator.
    troubles : tuple of Trouble
    scenario : str
        Name of a shipped scenario: ship and sea.
    link_errors_s : tuple of float
        When the bus can't be read or written.
    retuning : mapping
        Settings of the controller's retuning that differ, if it retunes itself.
    quiet : bool
        Sensors without noise, which makes a long log small.
    by_tick : bool
        Frames reach the controller with its next tick, as in real time, and not when they end on
        the bus: the times of a long log take no room then.
    intruder_s : float, optional
        When a second node begins to send with the controller's address.
    """

    name: str
    controller: str
    seconds: float
    script: Script = ARM
    troubles: tuple[Trouble, ...] = ()
    scenario: str = "storm"
    link_errors_s: tuple[float, ...] = ()
    retuning: dict[str, Any] = field(default_factory=dict)
    quiet: bool = False
    by_tick: bool = False
    intruder_s: float | None = None

    def has_troubles(self, node: str) -> bool:
        """Whether anything happens to a node."""
        return any(trouble.node == node for trouble in self.troubles)


class Troubled:
    """A node with its troubles.

    Frames that arrive while it does not tick wait for its next tick, as in a socket.
    """

    def __init__(self, node: Node, case: Case) -> None:
        self.name, self.period_ns = node.name, node.period_ns
        if isinstance(node, Selective):
            self.hears = node.hears
        self._node = node
        self._troubles = [each for each in case.troubles if each.node == node.name]
        self._link_errors_ns = [round(time_s * 1e9) for time_s in case.link_errors_s]
        self._by_tick = case.by_tick and isinstance(node, NodeTap)
        self._waiting: list[Frame] = []

    def receive(self, frame: Frame, now_ns: int) -> None:
        """Take one frame from the bus."""
        trouble = self._now(now_ns)
        if self._by_tick or (trouble is not None and trouble.spoil is None):
            self._waiting.append(frame)
        else:
            self._node.receive(frame, now_ns)

    def tick(self, now_ns: int) -> Iterable[Frame]:
        """Run one period."""
        trouble = self._now(now_ns)
        if trouble is not None and trouble.spoil is None:
            return ()
        for frame in self._waiting:
            self._node.receive(frame, now_ns)
        self._waiting.clear()
        if isinstance(self._node, NodeTap) and now_ns in self._link_errors_ns:
            self._node.link_error(now_ns, "no such device")
        frames = self._node.tick(now_ns)
        if trouble is None or trouble.spoil is None:
            return frames
        return [left for frame in frames for left in trouble.spoil(frame)]

    def _now(self, now_ns: int) -> Trouble | None:
        for trouble in self._troubles:
            if trouble.begin_s * 1e9 <= now_ns < trouble.end_s * 1e9:
                return trouble
        return None


class Intruder:
    """A second node that sends with the controller's address, from a time on."""

    name, period_ns = "intruder", 20_000_000

    def __init__(self, begin_s: float) -> None:
        self._begin_ns = round(begin_s * 1e9)
        self._sender = _CATALOGUE.transmitter(PumpCommand)

    def receive(self, frame: Frame, now_ns: int) -> None:
        """Hear nothing."""

    def tick(self, now_ns: int) -> Iterable[Frame]:
        """Send commands."""
        frame = self._sender.frame(PumpCommand(5e3, None, 0.05))
        return (frame,) if now_ns >= self._begin_ns else ()


def dropped(*kinds: type[Any]) -> Spoil:
    """Loses messages of some kinds, all if none is named."""
    ids = {_CATALOGUE.codec(kind).can_id for kind in kinds}
    return lambda frame: () if not ids or frame.can_id in ids else (frame,)


def damaged(frame: Frame) -> Iterable[Frame]:
    """Flips bits of the motion sensor's frames."""
    if frame.can_id != _CATALOGUE.codec(SensorMotion).can_id:
        return (frame,)
    data = bytearray(frame.data)
    data[3] ^= 0x24
    return (Frame(frame.can_id, bytes(data)),)


def altered(kind: type[Any], change: Callable[[Any], Any]) -> Spoil:
    """Changes what messages of a kind say, rightly protected and counted."""
    codec = _CATALOGUE.codec(kind)

    def alter(frame: Frame) -> Iterable[Frame]:
        if frame.can_id != codec.can_id:
            return (frame,)
        data = codec.encode(change(codec.decode(frame.data)), frame.data[1] & 15)
        return (Frame(frame.can_id, data),)

    return alter


_FLIPPED = altered(
    SensorMotion, lambda m: m._replace(roll_rad=-m.roll_rad, roll_rate_rad_s=-m.roll_rate_rad_s)
)
_HIGH = altered(SensorTank, lambda m: m._replace(port_high=Switch.ON))
_OVERCURRENT = altered(DriveStatus2, lambda m: m._replace(fault=DriveFault.OVERCURRENT))
_SPIKE = altered(SensorMotion, lambda m: m._replace(roll_rad=m.roll_rad + 0.5))

CASES: Final = (
    Case("every-mode", "gpc", 14, (
        (0.3, Action.PASSIVE), (1.5, Action.ARM), (8.0, Action.DISARM), (10.0, Action.STANDBY),
        (11.0, Action.ARM), (13.0, Action.STOP),
    )),
    Case("planned", "constrained_gpc", 12),
    Case("fuzzy", "fuzzy_robust", 12),
    Case("valve-and-pump", "pump_with_valve", 12, scenario="semi_active"),
    Case("motion-silent", "dpc", 12, (*ARM, *AGAIN), (
        Trouble("sensors", 3.0, 3.5, dropped(SensorMotion)),
    )),
    Case("frames-lost-and-damaged", "lqg", 12, ARM, (
        Trouble("sensors", 3.0, 3.02, dropped()),
        Trouble("sensors", 5.0, 5.02, damaged),
        Trouble("sensors", 7.0, 8.5, dropped(SensorTank)),
    )),
    Case("roll-sensor-reversed", "gpc", 25, ARM, (Trouble("sensors", 0.0, spoil=_FLIPPED),)),
    Case("spike-then-high-level", "dpc", 9, ARM, (
        Trouble("sensors", 3.0, 3.01, _SPIKE), Trouble("sensors", 5.0, 6.0, _HIGH),
    )),
    Case("drive-fault", "pd", 9, (*ARM, (4.0, Action.ACCEPT), (6.5, Action.RESET)), (
        Trouble("drive", 3.0, 6.0, _OVERCURRENT),
    )),
    Case("late-ticks-and-bus-errors", "gpc", 12, (*ARM, *AGAIN), (
        Trouble("controller", 3.0, 3.02), Trouble("controller", 5.0, 5.04),
    ), link_errors_s=(9.5, 9.51, 9.52, 9.53)),
    Case("operator-silent-then-intruder", "gpc", 12, ARM, (
        Trouble("panel", 3.0, 9.5, dropped(OperatorCommand)),
    ), intruder_s=10.5),
    Case("retuned-and-undone", "adaptive_dpc", 213,
         (*ARM, (35.0, Action.RETUNE), (208.0, Action.UNDO)),
         scenario="adaptive", quiet=True, by_tick=True,
         retuning={"order": 30, "identification_s": 131.0, "trial_s": 31.0,
                   "roll_factor": 20.0, "effort_factor": 20.0}),
)  # fmt: skip
"""All cases; between them every mode is met, and each way in which a controller can be stopped."""


def record(case: Case, folder: Path, home: Path | None = None) -> Path:
    """Run a case and write its frame log; the same bytes every time.

    Parameters
    ----------
    case : Case
    folder : Path
        Where it is written.
    home : Path, optional
        Where it is to be kept, if that is elsewhere: data files are named from there.

    Returns
    -------
    Path
        The log.
    """
    scenario, config = _scenario(case), _config(case)
    seed = scenario.seed
    law = build_law(config)
    retuning, estimating = works_of(config)
    head = replay_head(
        "reference",
        config,
        law,
        home or folder,
        options={},
        retuner=retuning is not None,
        estimating=estimating is not None,
        seed=seed,
    )
    # what differs from one machine and day to another is not what is compared
    about = {name: head["about"][name] for name in ("command", "configuration", "data")}
    head |= {"about": about, "packages": {}}
    file = folder / f"{case.name}.frames"
    with FrameLogWriter(file, head, small=True) as writer:
        sink = BlockSink(writer, block_ns=_WHOLE_NS)
        desks = Tapped(
            *(work and SimulatedRetuner(work[0], scenario.retuner_latency_s)
              for work in (retuning, estimating)),
            wanted=True,
        )  # fmt: skip
        controller = build_controller_node(
            config,
            law,
            commissioned=True,
            retuner=desks.retuner,
            estimating=desks.estimating,
        )
        node = NodeTap(controller, sink.write, desks.taps)
        script = tuple(TimedAction(*timed) for timed in case.script)
        nodes: list[Node] = [*build_ship_side(scenario, seed, script).nodes, node]
        if case.intruder_s is not None:
            nodes.append(Intruder(case.intruder_s))
        troubled = [
            Troubled(each, case) if each is node or case.has_troubles(each.name) else each
            for each in nodes
        ]
        Lockstep(troubled).run_until(round(case.seconds * 1e9))
        node.stop(round(case.seconds * 1e9))
        sink.flush()
    return file


def _config(case: Case) -> ControllerConfig:
    config = load_config(CONTROLLERS / f"{case.controller}.yaml", ControllerConfig)
    if not case.retuning:
        return config
    assert config.retuning is not None
    return config.model_copy(update={"retuning": replace(config.retuning, **case.retuning)})


def _scenario(case: Case) -> Scenario:
    scenario = load_config(SCENARIOS / f"{case.scenario}.yaml", Scenario)
    if not case.quiet:
        return scenario
    names = (each.name for each in fields(scenario.sensors) if "noise" in each.name)
    quiet = replace(scenario.sensors, **dict.fromkeys(names, 0.0))
    return scenario.model_copy(update={"sensors": quiet})
