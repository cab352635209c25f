"""Run of a bench in real time: in one process, or in two on a real bus."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol

import numpy as np

from firmware_sim.run import (
    COLUMNS,
    SECOND_NS,
    Job,
    Run,
    ShipFigures,
    Watch,
    controller_of,
    frame_log,
    ship_figures,
    ship_of,
    side_by_side,
)
from firmware_sim.ship_side import ShipSide, build_ship_side
from firmware_sim.truth import TruthRecorder
from utank_hil.assembly import retuner_process
from utank_hil.base.arrays import FloatArray
from utank_hil.base.provenance import describe
from utank_hil.base.tick import TICK_NS, TICK_S
from utank_hil.canbus.frame import Port
from utank_hil.canbus.ports import open_buses
from utank_hil.canbus.socketcan import SocketCanPort
from utank_hil.nodes.controller import ControllerNode
from utank_hil.nodes.signals import SIGNALS
from utank_hil.retuning import RetuningEvent
from utank_hil.runners import (
    LoopStatistics,
    MonotonicClock,
    Node,
    RealTimeLoop,
    heard_by,
    real_time_scheduling,
)
from utank_hil.telemetry.memory_log import MemoryLog
from utank_hil.telemetry.node_tap import Tapped
from utank_hil.telemetry.rows import RowWriter


class Meeting(Watch, Protocol):
    """Watch of a run in two processes, which synchronizes their start."""

    def begin_ns(self) -> int:
        """Report that this side is ready; return the common start on the monotonic clock."""


@dataclass(frozen=True, slots=True, eq=False)
class ShipRun:
    """Ship's half of a run on a real bus; `start_ns` is on the monotonic clock."""

    rows: FloatArray
    start_ns: int
    figures: ShipFigures


@dataclass(frozen=True, slots=True, eq=False)
class ControllerRun:
    """Controller's half of a run on a real bus; `start_ns` is on the monotonic clock."""

    rows: FloatArray
    start_ns: int
    loop: LoopStatistics
    retuning: tuple[RetuningEvent, ...]
    fallbacks: int | None = None
    law_error: str = ""


def run_in_one_process(job: Job, watch: Watch | None = None) -> Run:
    """Run with all nodes in one loop, without a bus."""
    _load_kernel(job)
    ship, truth, truth_log = ship_of(job)
    statistics = LoopStatistics()
    with _real_time_controller(job, statistics) as (controller, log, node):
        loop = _run_loop(job, [*ship.nodes, node, truth], None, statistics, watch)
    return join(job.name, _ship_run(ship, truth, truth_log), _controller_run(controller, log, loop))


def run_ship(job: Job, channel: str, meeting: Meeting) -> ShipRun:
    """Run the ship's side on a SocketCAN interface."""
    _load_kernel(job)
    ship, truth, truth_log = ship_of(job)
    nodes: list[Node] = [*ship.nodes, truth]
    _run_loop(job, nodes, channel, LoopStatistics(), meeting, meeting.begin_ns)
    return _ship_run(ship, truth, truth_log)


def run_controller(job: Job, channel: str, meeting: Meeting) -> ControllerRun:
    """Run the controller's side on a SocketCAN interface."""
    statistics = LoopStatistics()
    with _real_time_controller(job, statistics) as (controller, log, node):
        loop = _run_loop(job, [node], channel, statistics, meeting, meeting.begin_ns)
    return _controller_run(controller, log, loop)


def join(name: str, ship: ShipRun, controller: ControllerRun) -> Run:
    """Join the halves of a run on a real bus, on the ship's time."""
    shift_s = (controller.start_ns - ship.start_ns) / SECOND_NS
    rows = side_by_side(controller.rows, ship.rows, shift_s)
    return Run(
        name,
        rows,
        float(np.mean(rows[:, COLUMNS.index("bus_load")])) if len(rows) else 0.0,
        *ship.figures,
        controller.loop,
        controller.retuning,
        controller.fallbacks,
        controller.law_error,
    )


def _ship_run(ship: ShipSide, truth: TruthRecorder, log: MemoryLog) -> ShipRun:
    return ShipRun(log.rows, truth.start_ns, ship_figures(ship, truth))


def _controller_run(
    controller: ControllerNode, log: MemoryLog, loop: LoopStatistics
) -> ControllerRun:
    return ControllerRun(
        log.rows,
        controller.start_ns,
        loop,
        controller.law.events,
        controller.law.fallbacks,
        controller.law.error,
    )


def _load_kernel(job: Job) -> None:
    """Load the plant's compiled code, which would otherwise delay the first ticks of a run."""
    plant = build_ship_side(job.scenario, job.seed, ()).plant
    for now_ns in (0, TICK_NS):
        plant.advance(now_ns)


def _ring(job: Job) -> RowWriter:
    """Ring of a run in real time, for `utank-hil monitor`."""
    about = describe("bench", job.controller, Path.cwd(), options={"run": job.name}, seed=job.seed)
    return RowWriter(SIGNALS, about=about)


@contextmanager
def _real_time_controller(
    job: Job, statistics: LoopStatistics
) -> Iterator[tuple[ControllerNode, MemoryLog, Node]]:
    """Yield the controller, its rows, and the node that is put on the bus."""
    with retuner_process(job.controller) as (retuner, estimating):
        desks = Tapped(retuner, estimating, wanted=job.frames is not None)
        # the loop must not wait for a disk: its records are written after its end
        block_ns = job.ticks * TICK_NS + SECOND_NS
        with frame_log(job, desks, block_ns) as tapped, _ring(job) as ring:
            controller, log = controller_of(job, desks, statistics, ring)
            yield controller, log, tapped(controller)


def _run_loop(
    job: Job,
    nodes: list[Node],
    channel: str | None,
    statistics: LoopStatistics,
    watch: Watch | None,
    begin_ns: Callable[[], int] | None = None,
) -> LoopStatistics:
    port: Port | None = None
    foreign = job.controller.vessel.foreign
    if channel is not None and foreign.any:
        port = open_buses(channel, foreign, sends=True)
    elif channel is not None:
        port = SocketCanPort(channel, heard_by(nodes))
    loop = RealTimeLoop(nodes, port, statistics=statistics)

    def stop() -> bool:
        done_s = (statistics.ticks + statistics.skipped) * TICK_S
        return watch is not None and watch.stopped(done_s)

    try:
        with real_time_scheduling():
            if begin_ns is not None:  # called last: from here on nothing is loaded or built
                MonotonicClock().sleep_until(begin_ns())
            loop.run(stop, job.ticks * TICK_NS)
    finally:
        if port is not None:
            port.close()
    return statistics
