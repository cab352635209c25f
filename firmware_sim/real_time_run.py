"""Run of a bench in real time: in one process, or in two on a real bus."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Protocol

from firmware_sim.run import (
    RECORD_NS,
    SECOND_NS,
    ControllerRun,
    Job,
    Run,
    ShipRun,
    Watch,
    controller_of,
    controller_run,
    frame_log,
    join,
    ship_run,
)
from firmware_sim.ship_side import ShipSide, build_ship_side
from firmware_sim.truth import TRUTH, TruthRecorder
from utank_hil.assembly import retuner_process
from utank_hil.base.arrays import FloatArray
from utank_hil.base.provenance import describe
from utank_hil.base.tick import TICK_NS, TICK_S
from utank_hil.canbus.frame import Port
from utank_hil.canbus.ports import open_buses
from utank_hil.canbus.socketcan import SocketCanPort
from utank_hil.nodes.controller import ControllerNode
from utank_hil.nodes.signals import SIGNALS
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


def run_in_one_process(job: Job, watch: Watch | None = None) -> Run:
    """Run with all nodes in one loop, without a bus."""
    ship, truth, truth_log = _ship_of(job)
    statistics = LoopStatistics()
    with _real_time_controller(job, statistics) as (controller, log, node):
        _run_loop(job, [*ship.nodes, node, truth], None, statistics, watch)
    its = controller_run(controller, log, statistics)
    return join(job.name, ship_run(ship, truth, truth_log), its)


def run_ship(job: Job, channel: str, meeting: Meeting) -> ShipRun:
    """Run the ship's side on a SocketCAN interface."""
    ship, truth, truth_log = _ship_of(job)
    nodes: list[Node] = [*ship.nodes, truth]
    _run_loop(job, nodes, channel, LoopStatistics(), meeting, meeting.begin_ns)
    return ship_run(ship, truth, truth_log)


def run_controller(job: Job, channel: str, meeting: Meeting) -> ControllerRun:
    """Run the controller's side on a SocketCAN interface."""
    statistics = LoopStatistics()
    with _real_time_controller(job, statistics) as (controller, log, node):
        _run_loop(job, [node], channel, statistics, meeting, meeting.begin_ns)
    return controller_run(controller, log, statistics)


def _ship_of(job: Job) -> tuple[ShipSide, TruthRecorder, MemoryLog]:
    """Ship's side of a run, the recorder of its truth, and the rows of that."""
    first = build_ship_side(job.scenario, job.seed, ()).plant
    for now_ns in (0, TICK_NS):  # its compiled code loads here, and not in the first ticks of a run
        first.advance(now_ns)
    ship = build_ship_side(job.scenario, job.seed, job.script, job.controller)
    log = job.log_of(TRUTH)
    return ship, TruthRecorder(ship.plant, log, RECORD_NS), log


@contextmanager
def _real_time_controller(
    job: Job, statistics: LoopStatistics
) -> Iterator[tuple[ControllerNode, MemoryLog, Node]]:
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


def _run_loop(
    job: Job,
    nodes: list[Node],
    channel: str | None,
    statistics: LoopStatistics,
    watch: Watch | None,
    begin_ns: Callable[[], int] | None = None,
) -> None:
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
