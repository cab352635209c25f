"""Run of a bench in simulated time."""

from typing import Final

from firmware_sim.faulty_bench import FaultyBench, Tap
from firmware_sim.run import (
    RECORD_NS,
    SECOND_NS,
    Job,
    Run,
    Watch,
    controller_of,
    frame_log,
    ship_figures,
    ship_of,
    side_by_side,
)
from firmware_sim.scenario import PASSIVE
from firmware_sim.ship_side import ShipSide
from firmware_sim.truth import TRUTH, TruthRecorder
from utank_hil.assembly import works_of
from utank_hil.base.tick import TICK_NS
from utank_hil.nodes.controller import ControllerNode
from utank_hil.nodes.signals import ROW_TICKS, SIGNALS
from utank_hil.retuning import SimulatedRetuner
from utank_hil.runners import Lockstep, SimulatedBus
from utank_hil.runners.several_buses import with_more
from utank_hil.telemetry.memory_log import MemoryLog
from utank_hil.telemetry.node_tap import Tapped

FRAME_BLOCK_NS: Final = 10 * SECOND_NS
"""Time span of a block in a frame log: each block waits for the disk."""


def run_lockstep(job: Job, watch: Watch | None = None) -> Run:
    """Run in simulated time, with the scenario's faults unless the run is passive.

    The same job gives the same rows, bit for bit.
    """
    retuner, estimating = (work and SimulatedRetuner(work[0]) for work in works_of(job.controller))
    desks = Tapped(retuner, estimating, wanted=job.frames is not None)
    with frame_log(job, desks, FRAME_BLOCK_NS) as tapped:
        if job.scenario.faults and job.name != PASSIVE:
            return _run_with_faults(job, watch, desks, tapped)
        ship, truth, truth_log = ship_of(job)
        controller, log = controller_of(job, desks)
        bit_rate = job.controller.bit_rate
        more = len(job.controller.vessel.foreign.buses) - 1
        bus = with_more(SimulatedBus(bit_rate=bit_rate), more, bit_rate)
        lockstep = Lockstep([*ship.nodes, tapped(controller), truth], bus)
        _run_to_the_end(job, lockstep, watch)
    return _lockstep_run(job, lockstep, controller, log, ship, truth, truth_log)


def _run_with_faults(job: Job, watch: Watch | None, desks: Tapped, tapped: Tap) -> Run:
    log = MemoryLog(len(SIGNALS), -(-job.ticks // ROW_TICKS))
    bench = FaultyBench(
        job.scenario, job.controller, job.law, seed=job.seed, script=job.script, sink=log.write,
        sink_every=ROW_TICKS, retuner=desks.retuner, estimating=desks.estimating, tapped=tapped,
    )  # fmt: skip
    truth_log = MemoryLog(len(TRUTH), -(-job.ticks // ROW_TICKS))
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
        side_by_side(log.rows, truth_log.rows),
        lockstep.bus.load(lockstep.now_ns),
        *ship_figures(ship, truth),
        retuning=controller.law.events,
        fallbacks=controller.law.fallbacks,
        law_error=controller.law.error,
    )
