"""The runs whose frame logs are kept in ``tests/replay``: each mode, several faults, a retuning.

All are in simulated time and follow from this file, the shipped configurations and their seeds.
"""

from collections.abc import Iterable
from dataclasses import dataclass, field, fields, replace
from pathlib import Path
from typing import Any, Final

from pydantic import TypeAdapter

from firmware_sim.fault_injection.bench_parts import Bench, FaultyNode, Span
from firmware_sim.fault_injection.kinds import AnyFault, place_all
from firmware_sim.scenario import Scenario
from firmware_sim.ship_side import build_ship_side
from utank_hil.assembly import build_controller_node, build_law, works_of
from utank_hil.canbus import Frame
from utank_hil.configuration import ControllerConfig, load_config
from utank_hil.nodes.panel import Action, TimedAction
from utank_hil.retuning import SimulatedRetuner
from utank_hil.runners import Lockstep, Node
from utank_hil.telemetry.frame_log import BlockSink, FrameLog, FrameLogError, FrameLogWriter
from utank_hil.telemetry.node_tap import NodeTap, Tapped
from utank_hil.telemetry.replay import replay_log
from utank_hil.telemetry.replay_head import ReplayHeadError, recorded_config, replay_head

SCENARIOS: Final = Path("configs/scenarios")
CONTROLLERS: Final = Path("configs/controllers")
_WHOLE_NS: Final = 1 << 62
FAULTS: Final = TypeAdapter(tuple[AnyFault, ...])

Script = tuple[tuple[float, Action], ...]

ARM: Final[Script] = ((0.3, Action.ARM),)
AGAIN: Final[Script] = ((6.0, Action.RESET), (6.5, Action.DISARM), (7.0, Action.ARM))


@dataclass(frozen=True)
class Case:
    """One run."""

    name: str  #: Also of the file.
    controller: str  #: Name of a shipped controller.
    seconds: float
    script: Script = ARM  #: Times and buttons of the operator.
    faults: tuple[dict[str, Any], ...] = ()  #: As a scenario lists them; not of the controller.
    late_s: tuple[tuple[float, float], ...] = ()  #: From when to when the controller does not tick.
    scenario: str = "storm"  #: Name of a shipped scenario: ship and sea.
    link_errors_s: tuple[float, ...] = ()  #: When the bus can't be read or written.
    #: Settings of the controller's retuning that differ, if it retunes itself.
    retuning: dict[str, Any] = field(default_factory=dict)
    quiet: bool = False  #: Sensors without noise, which makes a long log small.
    #: Frames reach the controller with its next tick, as in real time, and not when they end on the
    #: bus: the times of a long log take no room then.
    by_tick: bool = False


class LateNode:
    """The controller, which may be late: frames then wait for its next tick, as in a socket."""

    def __init__(self, node: NodeTap, case: Case) -> None:
        self.name, self.period_ns = node.name, node.period_ns
        self._node = node
        self._late = [Span(round(begin * 1e9), round(end * 1e9)) for begin, end in case.late_s]
        self._link_errors_ns = [round(time_s * 1e9) for time_s in case.link_errors_s]
        self._by_tick = case.by_tick
        self._waiting: list[Frame] = []

    def receive(self, frame: Frame, now_ns: int) -> None:
        """Take one frame from the bus."""
        if self._by_tick or self._is_late(now_ns):
            self._waiting.append(frame)
        else:
            self._node.receive(frame, now_ns)

    def tick(self, now_ns: int) -> Iterable[Frame]:
        """Run one period."""
        if self._is_late(now_ns):
            return ()
        for frame in self._waiting:
            self._node.receive(frame, now_ns)
        self._waiting.clear()
        if now_ns in self._link_errors_ns:
            self._node.link_error(now_ns, "no such device")
        return self._node.tick(now_ns)

    def _is_late(self, now_ns: int) -> bool:
        return any(span.holds(now_ns) for span in self._late)


def _motion(kind: str, at_s: float, for_s: float | None, **keys: Any) -> dict[str, Any]:
    return {"kind": kind, "message": "SENSOR_MOTION", "at_s": at_s, "for_s": for_s, **keys}


CASES: Final = (
    Case("every-mode", "gpc", 14, (
        (0.3, Action.PASSIVE), (1.5, Action.ARM), (8.0, Action.DISARM), (10.0, Action.STANDBY),
        (11.0, Action.ARM), (13.0, Action.STOP),
    )),
    Case("planned", "constrained_gpc", 12),
    Case("fuzzy", "fuzzy_robust", 12),
    Case("valve-and-pump", "pump_with_valve", 12, scenario="semi_active"),
    Case("motion-silent", "dpc", 12, (*ARM, *AGAIN), (_motion("lost", 3.0, 0.5),)),
    Case("frames-lost-and-damaged", "lqg", 12, ARM, (
        {"kind": "mute", "node": "sensors", "at_s": 3.0, "for_s": 0.02},
        _motion("corrupted", 5.0, 0.02),
        {"kind": "lost", "message": "SENSOR_TANK", "at_s": 7.0, "for_s": 1.5},
    )),
    Case("roll-sensor-reversed", "gpc", 25, ARM, (
        _motion("sign", 0.0, None, signals=("roll_rad", "roll_rate_rad_s")),
    )),
    Case("spike-then-high-level", "dpc", 9, ARM, (
        _motion("offset", 3.0, 0.01, signals=("roll_rad",), by=0.5),
        {"kind": "value", "message": "SENSOR_TANK", "values": {"port_high": "ON"},
         "at_s": 5.0, "for_s": 1.0},
    )),
    Case("drive-fault", "pd", 9, (*ARM, (4.0, Action.ACCEPT), (6.5, Action.RESET)), (
        {"kind": "value", "message": "DRIVE_STATUS_2", "values": {"fault": "OVERCURRENT"},
         "at_s": 3.0, "for_s": 3.0},
    )),
    Case("late-ticks-and-bus-errors", "gpc", 12, (*ARM, *AGAIN),
         late_s=((3.0, 3.02), (5.0, 5.04)), link_errors_s=(9.5, 9.51, 9.52, 9.53)),
    Case("operator-silent-then-intruder", "gpc", 12, ARM, (
        {"kind": "lost", "message": "OPERATOR_CMD", "at_s": 3.0, "for_s": 6.5},
        {"kind": "impostor", "message": "PUMP_CMD", "at_s": 10.5, "ahead": 14,
         "values": {"pressure_pa": 5e3, "control_word": None, "timeout_s": 0.05}},
    )),
    Case("retuned-and-undone", "adaptive_dpc", 213,
         (*ARM, (35.0, Action.RETUNE), (208.0, Action.UNDO)),
         scenario="adaptive", quiet=True, by_tick=True,
         retuning={"order": 30, "identification_s": 131.0, "trial_s": 31.0,
                   "roll_factor": 20.0, "effort_factor": 20.0}),
)  # fmt: skip
"""All cases; between them every mode is met, and each way in which a controller can be stopped."""


def record(case: Case, folder: Path, home: Path | None = None) -> Path:
    """Run a case, write its frame log and return it; the same bytes every time.

    Data files are named from `home`, if the log is to be kept elsewhere than in `folder`.
    """
    scenario, config = scenario_of(case), config_of(case)
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
        seed=scenario.seed,
    )
    # what differs from one machine and day to another is not what is compared
    about = {name: head["about"][name] for name in ("command", "configuration", "data")}
    head |= {"about": about, "packages": {}}
    file = folder / f"{case.name}.frames"
    with FrameLogWriter(file, head, small=True) as writer:
        sink = BlockSink(writer, block_ns=_WHOLE_NS)
        desks = Tapped(
            *(work and SimulatedRetuner(work[0])
              for work in (retuning, estimating)),
            wanted=True,
        )  # fmt: skip
        controller = build_controller_node(
            config, law, commissioned=True, retuner=desks.retuner, estimating=desks.estimating
        )
        node = NodeTap(controller, sink.write, desks.taps)
        ship, joining = ship_nodes(case, 0)
        Lockstep([*ship, LateNode(node, case), *joining]).run_until(round(case.seconds * 1e9))
        node.stop(round(case.seconds * 1e9))
        sink.flush()
    return file


def ship_nodes(case: Case, start_ns: int) -> tuple[list[Node], list[Node]]:
    """The nodes of the ship, whose faults count from a time, and those that come with faults."""
    scenario = scenario_of(case)
    script = tuple(TimedAction(*timed) for timed in case.script)
    ship = build_ship_side(scenario, scenario.seed, script)
    faulty = {each.name: FaultyNode(each) for each in ship.nodes}
    bench = Bench(faulty, ship.plant, ship.drive, ship.valve, ship.vessel.version)
    place_all(FAULTS.validate_python(case.faults), bench, start_ns, scenario.seed)
    return [*faulty.values()], bench.joining


def config_of(case: Case) -> ControllerConfig:
    """The configuration of a case's controller."""
    config = load_config(CONTROLLERS / f"{case.controller}.yaml", ControllerConfig)
    if not case.retuning:
        return config
    assert config.retuning is not None
    return config.model_copy(update={"retuning": replace(config.retuning, **case.retuning)})


def scenario_of(case: Case) -> Scenario:
    """The ship and the sea of a case."""
    scenario = load_config(SCENARIOS / f"{case.scenario}.yaml", Scenario)
    if not case.quiet:
        return scenario
    names = (each.name for each in fields(scenario.sensors) if "noise" in each.name)
    quiet = replace(scenario.sensors, **dict.fromkeys(names, 0.0))
    return scenario.model_copy(update={"sensors": quiet})


LOGS: Final = Path("tests/replay")
DESIGN_BOUND: Final = 1e-6
"""Relative to the largest element of an array: how far today's design may be from a recorded one.

Kernels that are chosen by processor differ in the sixteenth digit; Riccati equations and
factorizations of these plants lose five digits of it (4e-12 between machines with AVX-512, AVX2 and
SSE), five more are room. A weight that is changed by a thousandth moves a gain by 1e-4.
"""


def compare(path: Path, changes: dict[str, object] | None = None) -> str:
    """The first difference of a replay and what may be its cause; empty if there is none.

    The law that was recorded answers, so that frames are equal bit for bit on any processor. A
    design that is farther from it than `DESIGN_BOUND` is a difference of its own.

    Parameters
    ----------
    path : Path
        The log.
    changes : dict, optional
        Sections of the configuration that are others than recorded; its own law answers then.
    """
    try:
        log = FrameLog(path)
        with recorded_config(log.head) as config:
            chosen: ControllerConfig = config.model_copy(update=changes or {})
            result, why, law = replay_log(log, chosen, path.parent, as_recorded=not changes)
    except (FrameLogError, ReplayHeadError) as error:
        return str(error)
    designs = [f"law, {each}" for each in law.differences if each.deviation > DESIGN_BOUND]
    if result.first is not None:
        return "; ".join([str(result.first), *why, *designs])
    if not changes and law.why_not_recorded:
        designs.insert(0, law.why_not_recorded)
    return "; ".join(designs)
