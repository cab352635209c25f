"""One run of a bench: a ship in a sea with one controller, in lockstep or in real time."""

import math
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Final, Protocol

import numpy as np
import numpy.typing as npt

from firmware_sim.faulty_bench import FaultyBench, Tap
from firmware_sim.scenario import PASSIVE, Scenario
from firmware_sim.ship_side import ShipSide, bare_plant, build_ship_side
from firmware_sim.truth import TRUTH, TruthRecorder
from utank_hil.arrays import FloatArray
from utank_hil.assembly import build_controller_node, retuner_process, works_of
from utank_hil.canbus import SocketCanPort
from utank_hil.configuration import ControllerConfig
from utank_hil.control import BuiltLaw
from utank_hil.provenance import describe
from utank_hil.retuning import (
    RetuningEvent,
    SimulatedRetuner,
)
from utank_hil.runtime import (
    Lockstep,
    LoopStatistics,
    MonotonicClock,
    Node,
    RealTimeLoop,
    SchedulingReport,
    SimulatedBus,
    heard_by,
    real_time_scheduling,
)
from utank_hil.runtime.controller_node import ControllerNode
from utank_hil.runtime.panel import TimedAction
from utank_hil.runtime.signals import SIGNALS
from utank_hil.telemetry import RingWriter
from utank_hil.telemetry.frame_log import BlockSink, FrameLogWriter
from utank_hil.telemetry.memory_log import MemoryLog
from utank_hil.telemetry.node_tap import NodeTap, Tapped
from utank_hil.telemetry.replay_head import replay_head
from utank_hil.tick import TICK_NS, TICK_S

SECOND_NS: Final = 1_000_000_000
RECORD_TICKS: Final = 5
"""Of the controller's ticks, every fifth is kept: 20 Hz, ample for a ship."""
RECORD_NS: Final = RECORD_TICKS * TICK_NS
FRAME_BLOCK_NS: Final = 10 * SECOND_NS
"""Of a frame log in simulated time: each block waits for the disk."""
RECORD_S: Final = RECORD_NS / SECOND_NS
COLUMNS: Final = (*SIGNALS, *TRUTH[1:])


class Watch(Protocol):
    """Looks on from outside while a run goes on."""

    def stopped(self, done_s: float) -> bool:
        """Take note of the progress; say whether the run shall end now."""


class Meeting(Watch, Protocol):
    """Watches a run of two processes, and has both begin together."""

    def begin_ns(self) -> int:
        """Tell that this side is ready; when both shall begin, on the monotonic clock."""


@dataclass(frozen=True, slots=True)
class Job:
    """A run to do.

    Attributes
    ----------
    name : str
    scenario : Scenario
    controller : ControllerConfig
    law : BuiltLaw
        Of the controller.
    script : tuple of TimedAction
        What the operator does.
    seed : int
    duration_s : float
    frames : Path or None
        Where the run leaves its frame log, if it is to leave one.
    """

    name: str
    scenario: Scenario
    controller: ControllerConfig
    law: BuiltLaw
    script: tuple[TimedAction, ...]
    seed: int
    duration_s: float
    frames: Path | None = None

    @property
    def ticks(self) -> int:
        """Ticks of the controller in the run."""
        return round(self.duration_s * SECOND_NS / TICK_NS)


@dataclass(frozen=True, slots=True, eq=False)
class LoopResult:
    """How one real-time loop kept its time."""

    statistics: LoopStatistics
    scheduling: SchedulingReport


@dataclass(frozen=True, slots=True, eq=False)
class Run:
    """What one run left behind.

    Attributes
    ----------
    name : str
    rows : ndarray, shape (n, len(COLUMNS))
        Controller's telemetry and the truth, every `RECORD_S`, on the ship's time: `time_s` counts
        from the start of its motion in the waves. In real time rows are left out
        that a late ship did not write, or for which the controller said nothing.
    bus_load : float
        Mean share of the bus in use.
    refused_commands : int
        Commands that the drive found outside its own limits.
    energy_j : float
        Work of the pump's shaft.
    strikes : int
        How often the water struck a limit of its level.
    capsized_s : float
        The ship's time at which it capsized; infinite if it did not.
    max_strike_impulse_nms : float
        Greatest angular impulse of a strike on the ship.
    pump_speed_rad_s : float
        Greatest speed of the pump's rotor.
    loop : LoopResult or None
        Of the loop with the controller; None in simulated time.
    retuning : tuple of RetuningEvent
        What the controller did to retune itself.
    fallbacks : int or None
    law_error : str
        As in `ControllerNode`.
    """

    name: str
    rows: FloatArray
    bus_load: float
    refused_commands: int
    energy_j: float
    strikes: int = 0
    capsized_s: float = math.inf
    max_strike_impulse_nms: float = 0.0
    pump_speed_rad_s: float = 0.0
    loop: LoopResult | None = None
    retuning: tuple[RetuningEvent, ...] = ()
    fallbacks: int | None = None
    law_error: str = ""

    def column(self, name: str) -> FloatArray:
        """One column of `rows`, shape (n,)."""
        return self.rows[:, COLUMNS.index(name)]

    @property
    def end_s(self) -> float:
        """The ship's time at the end of the last row; 0 if there is none."""
        return float(self.rows[-1, 0]) + RECORD_S if len(self.rows) else 0.0

    def between(self, start_s: float, end_s: float) -> npt.NDArray[np.bool_]:
        """Which rows lie in a span of the ship's time, shape (n,)."""
        time_s, half_s = self.column("time_s"), RECORD_S / 2
        return (time_s > start_s - half_s) & (time_s < end_s - half_s)


@dataclass(frozen=True, slots=True, eq=False)
class ShipRun:
    """The ship's half of a run on a real bus; `start_ns` on the monotonic clock."""

    rows: FloatArray
    start_ns: int
    refused_commands: int
    energy_j: float
    strikes: int = 0
    capsized_s: float = math.inf
    max_strike_impulse_nms: float = 0.0
    pump_speed_rad_s: float = 0.0


@dataclass(frozen=True, slots=True, eq=False)
class ControllerRun:
    """The controller's half of a run on a real bus; `start_ns` on the monotonic clock."""

    rows: FloatArray
    start_ns: int
    loop: LoopResult
    retuning: tuple[RetuningEvent, ...]
    fallbacks: int | None = None
    law_error: str = ""


def run_lockstep(job: Job, watch: Watch | None = None) -> Run:
    """Run in simulated time; the same job gives the same rows, bit for bit.

    The scenario's faults are in it, but for the passive run.
    """
    retuner, estimating = (
        work and SimulatedRetuner(work[0], job.scenario.retuner_latency_s)
        for work in works_of(job.controller)
    )
    desks = Tapped(retuner, estimating, wanted=job.frames is not None)
    with _frame_log(job, desks, FRAME_BLOCK_NS) as tapped:
        if job.scenario.faults and job.name != PASSIVE:
            return _run_with_faults(job, watch, desks, tapped)
        ship, truth, truth_log = _ship(job)
        controller, log = _controller(job, desks)
        bus = SimulatedBus(bit_rate=job.controller.bit_rate)
        lockstep = Lockstep([*ship.nodes, tapped(controller), truth], bus)
        _run_to_the_end(job, lockstep, watch)
    return _lockstep_run(job, lockstep, controller, log, ship, truth, truth_log)


def _run_with_faults(job: Job, watch: Watch | None, desks: Tapped, tapped: Tap) -> Run:
    """A run in which the scenario's faults happen."""
    log = MemoryLog(len(SIGNALS), -(-job.ticks // RECORD_TICKS))
    bench = FaultyBench(
        job.scenario, job.controller, job.law, seed=job.seed, script=job.script, sink=log.write,
        sink_every=RECORD_TICKS, retuner=desks.retuner, estimating=desks.estimating, tapped=tapped,
    )  # fmt: skip
    truth_log = MemoryLog(len(TRUTH), -(-job.ticks // RECORD_TICKS))
    truth = TruthRecorder(bench.ship.plant, truth_log, RECORD_NS)
    bench.place(job.scenario.faults)
    bench.join([truth])
    _run_to_the_end(job, bench.lockstep, watch)
    return _lockstep_run(job, bench.lockstep, bench.node, log, bench.ship, truth, truth_log)


def _run_to_the_end(job: Job, lockstep: Lockstep, watch: Watch | None) -> None:
    end_ns = job.ticks * TICK_NS
    while lockstep.now_ns < end_ns:
        if watch is not None and watch.stopped(lockstep.now_ns / SECOND_NS):
            return
        lockstep.run_until(min(lockstep.now_ns + SECOND_NS, end_ns))


def _lockstep_run(
    job: Job,
    lockstep: Lockstep,
    controller: ControllerNode,
    log: MemoryLog,
    ship: ShipSide,
    truth: TruthRecorder,
    truth_log: MemoryLog,
) -> Run:
    return Run(
        job.name,
        _side_by_side(log.rows, truth_log.rows),
        lockstep.bus.statistics(lockstep.now_ns).load,
        *_ship_figures(ship, truth),
        retuning=controller.retuning_events,
        fallbacks=controller.fallbacks,
        law_error=controller.law_error,
    )


def run_in_one_process(job: Job, watch: Watch | None = None) -> Run:
    """Run in real time with all nodes in one loop and no bus but the loop itself."""
    _load_kernel(job)
    ship, truth, truth_log = _ship(job)
    statistics = LoopStatistics()
    with _real_time_controller(job, statistics) as (controller, log, node):
        loop = _run_loop(job, [*ship.nodes, node, truth], None, statistics, watch)
    rows = _side_by_side(log.rows, truth_log.rows)
    return Run(
        job.name,
        rows,
        float(np.mean(rows[:, COLUMNS.index("bus_load")])) if len(rows) else 0.0,
        *_ship_figures(ship, truth),
        loop,
        controller.retuning_events,
        controller.fallbacks,
        controller.law_error,
    )


def run_ship(job: Job, channel: str, meeting: Meeting) -> ShipRun:
    """Run the ship's side on a SocketCAN interface."""
    _load_kernel(job)
    ship, truth, truth_log = _ship(job)
    nodes: list[Node] = [*ship.nodes, truth]
    _run_loop(job, nodes, channel, LoopStatistics(), meeting, meeting.begin_ns)
    return ShipRun(truth_log.rows, truth.start_ns, *_ship_figures(ship, truth))


def run_controller(job: Job, channel: str, meeting: Meeting) -> ControllerRun:
    """Run the controller's side on a SocketCAN interface."""
    statistics = LoopStatistics()
    with _real_time_controller(job, statistics) as (controller, log, node):
        loop = _run_loop(job, [node], channel, statistics, meeting, meeting.begin_ns)
    return ControllerRun(
        log.rows,
        controller.start_ns,
        loop,
        controller.retuning_events,
        controller.fallbacks,
        controller.law_error,
    )


def join(name: str, ship: ShipRun, controller: ControllerRun) -> Run:
    """Put the halves of a run on a real bus side by side, on the ship's time."""
    shift_s = (controller.start_ns - ship.start_ns) / SECOND_NS
    rows = _side_by_side(controller.rows, ship.rows, shift_s)
    return Run(
        name,
        rows,
        float(np.mean(rows[:, COLUMNS.index("bus_load")])) if len(rows) else 0.0,
        ship.refused_commands,
        ship.energy_j,
        ship.strikes,
        ship.capsized_s,
        ship.max_strike_impulse_nms,
        ship.pump_speed_rad_s,
        controller.loop,
        controller.retuning,
        controller.fallbacks,
        controller.law_error,
    )


def roll_without_tank(scenario: Scenario, seed: int, count: int) -> tuple[FloatArray, float]:
    """Roll of the ship without its tank every `RECORD_S`, shape (count,), and `capsized_s`."""
    plant = bare_plant(scenario, seed)
    roll_rad = np.empty(count)
    for row in range(count):
        plant.advance(row * RECORD_NS)
        roll_rad[row] = plant.roll_rad
    return roll_rad, plant.capsized_s


def _ship_figures(
    ship: ShipSide, truth: TruthRecorder
) -> tuple[int, float, int, float, float, float]:
    """Fields of `Run` and `ShipRun` from `refused_commands` to `pump_speed_rad_s`, in order."""
    plant = ship.plant
    return (
        ship.refused_commands,
        plant.pump_energy_j,
        plant.strikes,
        plant.capsized_s,
        plant.max_strike_impulse_nms,
        truth.pump_speed_rad_s,
    )


def _load_kernel(job: Job) -> None:
    """Have the plant's compiled code loaded, which would cost the first ticks of a run."""
    plant = build_ship_side(job.scenario, job.seed, ()).plant
    for now_ns in (0, TICK_NS):
        plant.advance(now_ns)


def _ship(job: Job) -> tuple[ShipSide, TruthRecorder, MemoryLog]:
    ship = build_ship_side(job.scenario, job.seed, job.script)
    log = MemoryLog(len(TRUTH), -(-job.ticks // RECORD_TICKS))
    return ship, TruthRecorder(ship.plant, log, RECORD_NS), log


def _controller(
    job: Job,
    desks: Tapped,
    statistics: LoopStatistics | None = None,
    ring: RingWriter | None = None,
) -> tuple[ControllerNode, MemoryLog]:
    log = MemoryLog(len(SIGNALS), -(-job.ticks // RECORD_TICKS))

    def shown(row: FloatArray) -> None:
        log.write(row)
        if ring is not None:
            ring.write(row)

    node = build_controller_node(
        job.controller,
        job.law,
        retuner=desks.retuner,
        estimating=desks.estimating,
        statistics=statistics,
        sink=shown,
        sink_every=RECORD_TICKS,
        commissioned=True,
    )
    return node, log


def _ring(job: Job) -> RingWriter:
    """The ring of a run in real time, for `utank-hil monitor`."""
    about = describe("bench", job.controller, Path.cwd(), options={"run": job.name}, seed=job.seed)
    return RingWriter(SIGNALS, about=about)


@contextmanager
def _real_time_controller(
    job: Job, statistics: LoopStatistics
) -> Iterator[tuple[ControllerNode, MemoryLog, Node]]:
    """The controller, its rows, and the node that is put on the bus."""
    with retuner_process(job.controller) as (retuner, estimating):
        desks = Tapped(retuner, estimating, wanted=job.frames is not None)
        # the loop waits for no disk: its records are written when it has ended
        block_ns = job.ticks * TICK_NS + SECOND_NS
        with _frame_log(job, desks, block_ns) as tapped, _ring(job) as ring:
            controller, log = _controller(job, desks, statistics, ring)
            yield controller, log, tapped(controller)


@contextmanager
def _frame_log(job: Job, desks: Tapped, block_ns: int) -> Iterator[Tap]:
    """Puts a tap on the controller, if the run is to leave a frame log."""
    if job.frames is None:
        yield lambda controller: controller
        return
    head = replay_head(
        "bench", job.controller, job.law, job.frames.parent, options={"run": job.name},
        retuner=desks.retuner is not None, estimating=desks.estimating is not None, seed=job.seed,
    )  # fmt: skip
    with FrameLogWriter(job.frames, head) as writer:
        sink = BlockSink(writer, block_ns)
        yield lambda controller: NodeTap(controller, sink.write, desks.taps)
        sink.flush()


def _run_loop(
    job: Job,
    nodes: list[Node],
    channel: str | None,
    statistics: LoopStatistics,
    watch: Watch | None,
    begin_ns: Callable[[], int] | None = None,
) -> LoopResult:
    port = None if channel is None else SocketCanPort(channel, heard_by(nodes))
    loop = RealTimeLoop(nodes, port, statistics=statistics)

    def stop() -> bool:
        done_s = (statistics.ticks + statistics.skipped) * TICK_S
        return watch is not None and watch.stopped(done_s)

    try:
        with real_time_scheduling() as scheduling:
            if begin_ns is not None:  # asked last: from here on nothing is left to load or build
                MonotonicClock().sleep_until(begin_ns())
            loop.run(stop, job.ticks * TICK_NS)
    finally:
        if port is not None:
            port.close()
    return LoopResult(statistics, scheduling)


def _side_by_side(shown_rows: FloatArray, truth: FloatArray, shift_s: float = 0.0) -> FloatArray:
    """Join rows of controller and ship, both of which begin with their time, on the ship's time.

    Beside each row of the truth stands the controller's row that is nearest in time: not the one of
    the same number, because in real time a late tick leaves a row out, on one side or on both. A
    row is left out that the controller has none for within `RECORD_S`. `shift_s` is the time from
    the ship's start to the controller's.
    """
    if len(truth) == 0 or len(shown_rows) == 0:
        return np.empty((0, len(COLUMNS)))
    shown_s = shown_rows[:, 0] + shift_s
    nearest = np.searchsorted((shown_s[1:] + shown_s[:-1]) / 2, truth[:, 0])
    shown = np.abs(shown_s[nearest] - truth[:, 0]) <= RECORD_S
    return np.hstack([truth[shown, :1], shown_rows[nearest[shown], 1:], truth[shown, 1:]])
