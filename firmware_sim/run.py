"""Run of a bench: a ship in a sea with one controller; its job and its results.

It is executed by `lockstep_run` in simulated time and by `real_time_run` in real time.
"""

import math
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Final, NamedTuple, Protocol

import numpy as np
import numpy.typing as npt

from firmware_sim.faulty_bench import Tap
from firmware_sim.scenario import Scenario
from firmware_sim.ship_side import ShipSide, bare_plant, build_ship_side
from firmware_sim.truth import TRUTH, TruthRecorder
from utank_hil.assembly import build_controller_node
from utank_hil.base.arrays import FloatArray
from utank_hil.base.tick import TICK_NS
from utank_hil.configuration import ControllerConfig
from utank_hil.control import BuiltLaw
from utank_hil.nodes.controller import ControllerNode
from utank_hil.nodes.panel import TimedAction
from utank_hil.nodes.signals import ROW_TICKS, SIGNALS
from utank_hil.retuning import RetuningEvent
from utank_hil.runners import LoopStatistics
from utank_hil.telemetry.frame_log import BlockSink, FrameLogWriter
from utank_hil.telemetry.memory_log import MemoryLog
from utank_hil.telemetry.node_tap import NodeTap, Tapped
from utank_hil.telemetry.replay_head import replay_head
from utank_hil.telemetry.ring import RingWriter

SECOND_NS: Final = 1_000_000_000
RECORD_NS: Final = ROW_TICKS * TICK_NS
RECORD_S: Final = RECORD_NS / SECOND_NS
COLUMNS: Final = (*SIGNALS, *TRUTH[1:])


class Watch(Protocol):
    """Observer of a run under way."""

    def stopped(self, done_s: float) -> bool:
        """Record the progress; return whether the run shall end now."""


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


class ShipFigures(NamedTuple):
    """Fields of `Run` that the ship's side gives, in order."""

    refused_commands: int
    energy_j: float
    strikes: int = 0
    capsized_s: float = math.inf
    max_strike_impulse_nms: float = 0.0
    pump_speed_rad_s: float = 0.0


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
    loop: LoopStatistics | None = None
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

    def between(self, start_s: float, end_s: float) -> npt.NDArray[np.bool_]:
        """Mask of the rows in a span of ship's time, shape (n,)."""
        time_s, half_s = self.column("time_s"), RECORD_S / 2
        return (time_s > start_s - half_s) & (time_s < end_s - half_s)


def roll_without_tank(scenario: Scenario, seed: int, count: int) -> tuple[FloatArray, float]:
    """Roll of the ship without tank every `RECORD_S`, shape (count,), and `capsized_s`."""
    plant = bare_plant(scenario, seed)
    roll_rad = np.empty(count)
    for row in range(count):
        plant.advance(row * RECORD_NS)
        roll_rad[row] = plant.roll_rad
    return roll_rad, plant.capsized_s


def ship_of(job: Job) -> tuple[ShipSide, TruthRecorder, MemoryLog]:
    """Ship's side of a run, recorder of the truth, and its log."""
    ship = build_ship_side(job.scenario, job.seed, job.script)
    log = MemoryLog(len(TRUTH), -(-job.ticks // ROW_TICKS))
    return ship, TruthRecorder(ship.plant, log, RECORD_NS), log


def controller_of(
    job: Job,
    desks: Tapped,
    statistics: LoopStatistics | None = None,
    ring: RingWriter | None = None,
) -> tuple[ControllerNode, MemoryLog]:
    """Controller of a run, and its log; the rows also go to `ring` if given."""
    log = MemoryLog(len(SIGNALS), -(-job.ticks // ROW_TICKS))

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
        sink_every=ROW_TICKS,
        commissioned=True,
    )
    return node, log


@contextmanager
def frame_log(job: Job, desks: Tapped, block_ns: int) -> Iterator[Tap]:
    """Yield the tap on the controller that writes the frame log, if the run has one."""
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


def ship_figures(ship: ShipSide, truth: TruthRecorder) -> ShipFigures:
    """Results of the ship's side of a run, without its rows."""
    plant = ship.plant
    return ShipFigures(
        ship.refused_commands,
        plant.pump_energy_j,
        plant.strikes,
        plant.capsized_s,
        plant.max_strike_impulse_nms,
        truth.pump_speed_rad_s,
    )


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
