"""Run of a bench: a ship in a sea with one controller, its job and results.

In simulated time, or in real time: in one process, or in two on a real bus.
"""

import math
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from multiprocessing.context import SpawnContext
from pathlib import Path
from typing import Final, NamedTuple

import numpy as np
import numpy.typing as npt

from firmware_sim.faulty_bench import FaultyBench, Tap
from firmware_sim.plant import Plant
from firmware_sim.scenario import Scenario
from firmware_sim.scenario_content import PASSIVE
from firmware_sim.ship_side import ShipSide, bare_plant, build_ship_side, load_compiled_code
from firmware_sim.truth import TRUTH, MemoryLog, TruthRecorder
from utank_hil import runners
from utank_hil.assembly import build_controller_node, retuner_process, works_of
from utank_hil.base.arrays import FloatArray
from utank_hil.base.provenance import describe
from utank_hil.base.tick import TICK_NS, TICK_S
from utank_hil.canbus import RetuningState
from utank_hil.canbus.frame import Port
from utank_hil.canbus.ports import open_buses
from utank_hil.canbus.profiles.device_plan import ForeignDevices
from utank_hil.canbus.socketcan import SocketCanPort
from utank_hil.configuration import ControllerConfig
from utank_hil.control import BuiltLaw
from utank_hil.nodes.controller import ControllerNode
from utank_hil.nodes.panel import TimedAction
from utank_hil.nodes.signals import ROW_TICKS, SIGNALS
from utank_hil.retuning import RetuningEvent, SimulatedRetuner
from utank_hil.runners.lockstep import with_more
from utank_hil.telemetry.frame_log import BlockSink, FrameLogWriter
from utank_hil.telemetry.node_tap import NodeTap, Tapped
from utank_hil.telemetry.replay_head import replay_head
from utank_hil.telemetry.ring import RowWriter

SECOND_NS: Final = 1_000_000_000
RECORD_NS: Final = ROW_TICKS * TICK_NS
RECORD_S: Final = RECORD_NS / SECOND_NS
COLUMNS: Final = (*SIGNALS, *TRUTH[1:])
READY_POLL_S: Final = 0.01  #: Polling interval of each side in s: one tick.
FRAME_BLOCK_NS: Final = 10 * SECOND_NS
"""Time span of a block in a frame log in simulated time: each block waits for the disk."""


class Board:
    """Shared memory through which the bench and the processes of its runs communicate."""

    def __init__(self, context: SpawnContext, runs: int) -> None:
        self.done_s = [context.Value("d", 0.0, lock=False) for _ in range(runs)]
        self.stop = context.Value("b", False, lock=False)
        self.ready = context.Value("i", 0)
        self.begin_ns = context.Value("q", 0, lock=False)


class Watch:
    """The bench's view of a run, and its start where there is one process for each side."""

    def __init__(self, board: Board, index: int) -> None:
        self._board = board
        self._done_s = board.done_s[index]

    def stopped(self, done_s: float) -> bool:
        """Record the progress; return whether the run shall end now."""
        self._done_s.value = done_s
        return bool(self._board.stop.value)

    def begin_ns(self) -> int:
        """Report that this side is ready; return the common start on the monotonic clock."""
        board = self._board
        with board.ready.get_lock():
            board.ready.value += 1
        while not board.begin_ns.value and not board.stop.value:
            time.sleep(READY_POLL_S)
        return int(board.begin_ns.value)


@dataclass(frozen=True, slots=True)
class Job:
    """Run to be executed."""

    name: str
    scenario: Scenario
    controller: ControllerConfig
    law: BuiltLaw
    script: tuple[TimedAction, ...]
    seed: int
    duration_s: float
    frames: Path | None = None  #: Path of the run's frame log, if any.

    @property
    def ticks(self) -> int:
        """Number of the controller's ticks in the run."""
        return round(self.duration_s * SECOND_NS / TICK_NS)

    def log_of(self, columns: tuple[str, ...]) -> MemoryLog:
        """Empty log for the rows of the run."""
        return MemoryLog(len(columns), -(-self.ticks // ROW_TICKS))


@dataclass(frozen=True, slots=True, eq=False)
class Run:
    """Results of one run."""

    name: str
    #: shape (n, len(COLUMNS)): telemetry and truth every `RECORD_S`, on ship's time: `time_s`
    #: counts from the start of its motion. In real time, rows that either side did not write are
    #: missing.
    rows: FloatArray
    bus_load: float
    refused_commands: int  #: Number of commands outside the drive's own limits.
    energy_j: float
    strikes: int = 0
    capsized_s: float = math.inf  #: Ship's time of capsizing; infinite if it did not.
    max_strike_impulse_nms: float = 0.0
    pump_speed_rad_s: float = 0.0  #: Greatest speed of the pump's rotor.
    #: Timing statistics of the controller's loop; None in simulated time.
    loop: runners.LoopStatistics | None = None
    retuning: tuple[RetuningEvent, ...] = ()  #: Events of the controller's retuning.
    fallbacks: int | None = None
    law_error: str = ""

    def column(self, name: str) -> FloatArray:
        """Column of `rows`, shape (n,)."""
        return self.rows[:, COLUMNS.index(name)]

    @property
    def end_s(self) -> float:
        """Ship's time of the last row; 0 if there is none."""
        return float(self.rows[-1, 0]) + RECORD_S if len(self.rows) else 0.0

    @property
    def events(self) -> tuple[RetuningEvent, ...]:
        """Events of retuning on the time of the rows, to within one, by the changes of state."""
        time_s, state = self.column("time_s"), self.column("retuning")
        if not self.retuning:
            return ()
        shift_ns = round(self.end_s * SECOND_NS) - self.retuning[-1].time_ns  # if no row shows one
        for event in self.retuning:
            seen = time_s[state == event.state]
            if event.state is not RetuningState.IDLE and len(seen):
                shift_ns = round(float(seen[0]) * SECOND_NS) - event.time_ns
                break
        return tuple(replace(each, time_ns=each.time_ns + shift_ns) for each in self.retuning)

    def between(self, start_s: float, end_s: float) -> npt.NDArray[np.bool_]:
        """Mask of the rows in a span of ship's time, shape (n,)."""
        time_s, half_s = self.column("time_s"), RECORD_S / 2
        return (time_s > start_s - half_s) & (time_s < end_s - half_s)


class ShipRun(NamedTuple):
    """Ship's half of a run; `start_ns` is on the clock of its runner, as the controller's."""

    rows: FloatArray
    start_ns: int
    #: Fields of `Run` that the ship's side gives, in order.
    figures: tuple[int, float, int, float, float, float]


class ControllerRun(NamedTuple):
    """Controller's half of a run, whose last fields are those of `Run`, in order."""

    rows: FloatArray
    start_ns: int
    loop: runners.LoopStatistics | None
    retuning: tuple[RetuningEvent, ...] = ()
    fallbacks: int | None = None
    law_error: str = ""


def join(name: str, ship: ShipRun, controller: ControllerRun, bus_load: float | None = None) -> Run:
    """Join the halves of a run on the ship's time; without a bus load with the mean one shown."""
    shift_s = (controller.start_ns - ship.start_ns) / SECOND_NS
    rows = side_by_side(controller.rows, ship.rows, shift_s)
    if bus_load is None:
        bus_load = float(np.mean(rows[:, COLUMNS.index("bus_load")])) if len(rows) else 0.0
    return Run(name, rows, bus_load, *ship.figures, *controller[2:])


def roll_without_tank(scenario: Scenario, seed: int, count: int) -> tuple[FloatArray, float]:
    """Roll of the ship without tank every `RECORD_S`, shape (count,), and `capsized_s`."""
    return roll_at_zero_pressure(bare_plant(scenario, seed), count)


def roll_at_zero_pressure(plant: Plant, count: int) -> tuple[FloatArray, float]:
    """Roll with the pump, if any, at zero pressure; as `roll_without_tank`."""
    roll_rad = np.empty(count)
    for row in range(count):
        plant.drive_pump(0.0, enabled=True)
        plant.advance(row * RECORD_NS)
        roll_rad[row] = plant.roll_rad
    return roll_rad, plant.capsized_s


def ship_run(ship: ShipSide, truth: TruthRecorder, log: MemoryLog) -> ShipRun:
    """Ship's half of a run that ended."""
    plant = ship.plant
    figures = (
        ship.refused_commands, plant.pump_energy_j, plant.strikes, plant.capsized_s,
        plant.max_strike_impulse_nms, truth.pump_speed_rad_s,
    )  # fmt: skip
    return ShipRun(log.rows, truth.start_ns, figures)


def controller_run(
    node: ControllerNode, log: MemoryLog, loop: runners.LoopStatistics | None = None
) -> ControllerRun:
    """Controller's half of a run that ended."""
    law = node.law
    return ControllerRun(log.rows, node.start_ns, loop, law.events, law.fallbacks, law.error)


def controller_of(
    job: Job,
    desks: Tapped,
    sink: Callable[[FloatArray], None],
    statistics: runners.LoopStatistics | None = None,
) -> ControllerNode:
    """Controller of a run, whose telemetry goes to `sink`."""
    return build_controller_node(
        job.controller,
        job.law,
        retuner=desks.retuner,
        estimating=desks.estimating,
        statistics=statistics,
        sink=sink,
        sink_every=ROW_TICKS,
        commissioned=True,
    )


@contextmanager
def frame_log(job: Job, desks: Tapped, block_ns: int) -> Iterator[Tap]:
    """Yield the tap on the controller that writes the frame log, if the run has one."""
    if job.frames is None:
        yield lambda controller: controller
        return
    head = replay_head(
        "bench", job.controller, job.law, job.frames.parent, options={"run": job.name},
        retuner=desks.retuner is not None, estimating=desks.estimating is not None, seed=job.seed,
        scenario=job.scenario.model_copy(update={"controllers": {}}),
    )  # fmt: skip
    with FrameLogWriter(job.frames, head) as writer:
        sink = BlockSink(writer, block_ns)
        try:
            yield lambda controller: NodeTap(controller, sink.write, desks.taps)
        except runners.NodeError as error:
            if isinstance(error.__cause__, OSError):  # a full disk is no failure of the node
                raise error.__cause__ from None
            raise
        sink.flush()


def run_lockstep(job: Job, watch: Watch | None = None) -> Run:
    """Run in simulated time, the passive run without faults: same job, same rows, bit for bit."""
    retuner, estimating = (work and SimulatedRetuner(work[0]) for work in works_of(job.controller))
    desks = Tapped(retuner, estimating, wanted=job.frames is not None)
    log, truth_log, bench = job.log_of(SIGNALS), job.log_of(TRUTH), None
    with frame_log(job, desks, FRAME_BLOCK_NS) as tapped:
        if job.scenario.faults and job.name != PASSIVE:
            bench = FaultyBench(
                job.scenario, job.controller, job.law, seed=job.seed, script=job.script,
                sink=log.write, sink_every=ROW_TICKS, retuner=retuner, estimating=estimating,
                tapped=tapped,
            )  # fmt: skip
            ship, controller, lockstep = bench.ship, bench.node, bench.lockstep
            bench.place(job.scenario.faults)
        else:
            ship = build_ship_side(job.scenario, job.seed, job.script, job.controller)
            controller = controller_of(job, desks, log.write)
            bit_rate, buses = job.controller.bit_rate, job.controller.vessel.foreign.buses
            bus = with_more(runners.SimulatedBus(bit_rate=bit_rate), len(buses) - 1, bit_rate)
            lockstep = runners.Lockstep([*ship.nodes, tapped(controller)], bus)
        truth = TruthRecorder(ship.plant, truth_log, RECORD_NS)
        lockstep.join([truth])
        end_ns = job.ticks * TICK_NS
        while lockstep.now_ns < end_ns:
            if watch is not None and watch.stopped(lockstep.now_ns / SECOND_NS):
                break
            lockstep.run_until(min(lockstep.now_ns + SECOND_NS, end_ns))
    if bench is not None:
        controller = bench.node  # a fault may have replaced it
    ours = ship_run(ship, truth, truth_log)
    return join(job.name, ours, controller_run(controller, log), lockstep.bus.load(lockstep.now_ns))


def side_by_side(shown_rows: FloatArray, truth: FloatArray, shift_s: float = 0.0) -> FloatArray:
    """Join rows of controller and ship, which begin with their time, on ship's time.

    Each row of the truth is joined with the controller's row nearest in time, not that of the same
    index, because a late tick in real time leaves out a row on one side. A row without a partner
    within `RECORD_S` is left out. `shift_s` is the time from the ship's start to the controller's.
    """
    if len(truth) == 0 or len(shown_rows) == 0:
        return np.empty((0, len(COLUMNS)))
    shown_s = shown_rows[:, 0] + shift_s
    nearest = np.searchsorted((shown_s[1:] + shown_s[:-1]) / 2, truth[:, 0])
    shown = np.abs(shown_s[nearest] - truth[:, 0]) <= RECORD_S
    return np.hstack([truth[shown, :1], shown_rows[nearest[shown], 1:], truth[shown, 1:]])


def run_in_one_process(job: Job, watch: Watch | None = None) -> Run:
    """Run with all nodes in one loop, without a bus."""
    ship, truth, truth_log = _ship_of(job)
    statistics = runners.LoopStatistics()
    with _real_time_controller(job, statistics) as (controller, log, node):
        _run_loop(job, [*ship.nodes, node, truth], None, statistics, watch)
    its = controller_run(controller, log, statistics)
    return join(job.name, ship_run(ship, truth, truth_log), its)


def run_ship(job: Job, channel: str, watch: Watch) -> ShipRun:
    """Run the ship's side on a SocketCAN interface."""
    ship, truth, truth_log = _ship_of(job)
    nodes: list[runners.Node] = [*ship.nodes, truth]
    _run_loop(job, nodes, channel, runners.LoopStatistics(), watch)
    return ship_run(ship, truth, truth_log)


def run_controller(job: Job, channel: str, watch: Watch) -> ControllerRun:
    """Run the controller's side on a SocketCAN interface."""
    statistics = runners.LoopStatistics()
    with _real_time_controller(job, statistics) as (controller, log, node):
        _run_loop(job, [node], channel, statistics, watch)
    return controller_run(controller, log, statistics)


def _ship_of(job: Job) -> tuple[ShipSide, TruthRecorder, MemoryLog]:
    load_compiled_code(job.scenario, job.seed)
    ship = build_ship_side(job.scenario, job.seed, job.script, job.controller)
    log = job.log_of(TRUTH)
    return ship, TruthRecorder(ship.plant, log, RECORD_NS), log


@contextmanager
def _real_time_controller(
    job: Job, statistics: runners.LoopStatistics
) -> Iterator[tuple[ControllerNode, MemoryLog, runners.Node]]:
    """Yield the controller, its rows, and the node that is put on the bus."""
    with retuner_process(job.controller) as (retuner, estimating):
        desks = Tapped(retuner, estimating, wanted=job.frames is not None)
        # the loop must not wait for a disk: its records are written after its end
        block_ns = job.ticks * TICK_NS + SECOND_NS
        about = describe(
            "bench", job.controller, Path.cwd(), options={"run": job.name}, seed=job.seed
        )
        with frame_log(job, desks, block_ns) as tapped, RowWriter(SIGNALS, about=about) as ring:
            log = job.log_of(SIGNALS)

            def shown(row: FloatArray) -> None:
                log.write(row)
                ring.write(row)  # for `utank-hil monitor`

            controller = controller_of(job, desks, shown, statistics)
            yield controller, log, tapped(controller)


def ship_port(channel: str, nodes: list[runners.Node], foreign: ForeignDevices) -> Port:
    """Port for nodes of a ship with these devices, which hears no more than they do."""
    if foreign.any:
        return open_buses(channel, foreign, sends=True)
    return SocketCanPort(channel, runners.heard_by(nodes))


def _run_loop(
    job: Job,
    nodes: list[runners.Node],
    channel: str | None,
    statistics: runners.LoopStatistics,
    watch: Watch | None,
) -> None:
    foreign = job.controller.vessel.foreign
    port = None if channel is None else ship_port(channel, nodes, foreign)
    loop = runners.RealTimeLoop(nodes, port, statistics=statistics)

    def stop() -> bool:
        done_s = (statistics.ticks + statistics.skipped) * TICK_S
        return watch is not None and watch.stopped(done_s)

    try:
        with runners.real_time_scheduling():
            if port is not None and watch is not None:  # last: from here on nothing is built
                runners.MonotonicClock().sleep_until(watch.begin_ns())
            loop.run(stop, job.ticks * TICK_NS)
    finally:
        if port is not None:
            port.close()
