"""Figures of a bench, computed once for tables, JSON, picture and page."""

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from firmware_sim.bench import BenchResult
from firmware_sim.model_limits import passed_limits
from firmware_sim.run import RECORD_S, Run
from firmware_sim.scenario_content import PASSIVE
from firmware_sim.ship_side import passive_script
from utank_hil.analysis.motion.statistics import (
    PumpStatistics,
    RollStatistics,
    pump_statistics,
    roll_statistics,
)
from utank_hil.base.arrays import FloatArray
from utank_hil.base.finite import finite
from utank_hil.canbus import Fault, Mode
from utank_hil.console.common import KILLED
from utank_hil.console.exit_codes import ExitCode
from utank_hil.nodes.panel import Action
from utank_hil.safety.faults import fault_text
from utank_hil.telemetry.events import event_text

NO_TANK: Final = "no tank"
LEAST_ROLL_RAD: Final = 1e-6  #: Roll below which a ratio of rolls is meaningless.
LEAST_IN_CHARGE: Final = 0.9
"""Least share of the time ordered by the operator in which the controller must be in charge."""

_OF_BENCH: Final = (
    *("mode", "seed", "duration_s", "settle_s", "end_s", "interrupted", "not_run", "wall_s"),
)
_OF_RUN: Final = (
    *("name", "end_s", "strikes", "max_strike_impulse_nms", "pump_speed_rad_s", "energy_j"),
    *("bus_load", "refused_commands", "fallbacks", "law_error"),
)  #: Figures that the bench and the run share.

_ORDERS: Final = {
    Action.ARM: Mode.ACTIVE,
    Action.PASSIVE: Mode.PASSIVE,
    Action.DISARM: Mode.PASSIVE,
    Action.STANDBY: Mode.STANDBY,
    Action.STOP: Mode.STANDBY,
}


@dataclass(frozen=True, slots=True)
class Mark:
    """Reason why a run is not ranked: a word for a table, and a sentence without the run's name."""

    word: str
    why: str


@dataclass(frozen=True, slots=True)
class BareShip(RollStatistics):
    """Roll of the ship without a tank; `capsized_s` is None if it did not capsize."""

    capsized_s: float | None


@dataclass(frozen=True, slots=True)
class RunFigures:
    """Figures of one run; a run that is not compared has None up to `active_share`."""

    name: str
    compared: bool
    ranked: bool
    mark: Mark | None
    #: rows, expected_rows: number of rows in the window, and of a complete run.
    rows: int
    expected_rows: int
    end_s: float
    capsized_s: float | None  #: Time of capsizing; None if the ship did not capsize.
    #: strikes, max_strike_impulse_nms, pump_speed_rad_s, energy_j, bus_load, refused_commands:
    #: values of `Run` over the whole run; so are `fallbacks` and `law_error`.
    strikes: int
    max_strike_impulse_nms: float
    pump_speed_rad_s: float
    energy_j: float
    bus_load: float
    refused_commands: int
    fallbacks: int | None
    law_error: str
    loop: dict[str, Any] | None  #: Timing statistics of the loop; None in simulated time.
    retuning: tuple[dict[str, Any], ...]  #: Events of retuning, as JSON, on ship's time.
    rank: int | None = None  #: Rank by roll RMS among the runs that count, from 1.
    roll: RollStatistics | None = None
    #: roll_below_no_tank, roll_below_passive: relative reduction of the roll RMS against no tank,
    #: and against the passive tank; None where one of the two runs does not count, and on still
    #: water.
    roll_below_no_tank: float | None = None
    roll_below_passive: float | None = None
    pump: PumpStatistics | None = None
    flow_peak_m3_s: float | None = None  #: Largest flow through the duct, which is the pump's.
    mode: str | None = None
    fault: str | None = None
    active_share: float | None = None


@dataclass(frozen=True, slots=True)
class BenchFigures:
    """Figures of a bench over its window, in SI units."""

    scenario: str
    mode: str
    seed: int
    duration_s: float
    settle_s: float
    end_s: float
    interrupted: bool
    not_run: tuple[str, ...]
    wall_s: float
    hs_m: float  #: Significant wave height at the start.
    exit_code: int
    endings: tuple[str, ...]  #: Remarks on the ends of runs; empty where all went as ordered.
    limits_passed: tuple[str, ...]  #: Limits of the model that were passed.
    retuned: tuple[str, ...]  #: Events of retuning in words.
    no_tank: BareShip
    runs: tuple[RunFigures, ...]  #: All runs with at least one row; the passive tank first.

    @property
    def compared(self) -> tuple[RunFigures, ...]:
        """Runs with enough rows in the window."""
        return tuple(run for run in self.runs if run.compared)

    @property
    def wrong(self) -> tuple[str, ...]:
        """All problems of the bench."""
        return (*self.endings, *self.limits_passed)

    def as_json(self, files: Mapping[str, Path], about: Mapping[str, Any]) -> dict[str, Any]:
        """Figures for `json.dumps`, with provenance and the files written."""
        return {**about, **asdict(self), "files": {name: str(each) for name, each in files.items()}}


def figures(result: BenchResult) -> BenchFigures:
    """Compute the figures of a bench."""
    marks = {run.name: mark_of(result, run) for run in result.runs}
    code = ExitCode.NOT_RANKED if any(marks.values()) or result.not_run else ExitCode.OK
    if result.interrupted or result.killed:
        code = ExitCode.INTERRUPTED if result.interrupted else ExitCode.SYSTEM
    return BenchFigures(
        **{name: getattr(result, name) for name in _OF_BENCH},
        scenario=result.scenario.name,
        hs_m=result.scenario.figures()["hs_m"],
        exit_code=int(code),
        endings=tuple(_endings(result, marks)),
        limits_passed=tuple(passed_limits(result)),
        retuned=tuple(
            f"{run.name}, {event.time_ns * 1e-9:.0f} s: {event_text(event)}"
            for run in result.runs
            for event in run.events
        ),
        no_tank=bare_figures(result),
        runs=run_figures(result),
    )


def bare_figures(result: BenchResult) -> BareShip:
    """Roll of the bare ship in the window."""
    return BareShip(
        **asdict(roll_statistics(_bare_roll(result))),
        capsized_s=finite(result.without_tank_capsized_s),
    )


def run_figures(result: BenchResult) -> tuple[RunFigures, ...]:
    """Figures of each run, ranked."""
    marks = {run.name: mark_of(result, run) for run in result.runs}
    rolls = {name: roll_statistics(roll) for name, roll in rolls_compared(result).items()}
    order = sorted((name for name in rolls if marks[name] is None), key=lambda n: rolls[n].rms_rad)
    passive = rolls[PASSIVE] if PASSIVE in order else None
    afloat = result.without_tank_capsized_s >= result.end_s
    bare = roll_statistics(_bare_roll(result)) if afloat else None
    area_m2, found = result.scenario.vessel.tank.reservoir_area_m2, []
    for run in result.runs:
        counts, window = run.name in order, _window(result, run)
        judged: dict[str, Any] = {name: getattr(run, name) for name in _OF_RUN}
        if run.name in rolls:
            roll = rolls[run.name]
            rates_m_s = np.diff(run.column("true_level_m")[window]) / RECORD_S
            judged |= {
                "rank": order.index(run.name) + 1 if counts else None,
                "roll": roll,
                "roll_below_no_tank": _share_below(roll, bare) if counts else None,
                "roll_below_passive": _share_below(roll, passive) if counts else None,
                "pump": pump_statistics(
                    run.column("true_pressure_pa")[window],
                    run.column("true_shaft_power_w")[window],
                    run.column("true_level_m")[window],
                ),
                "flow_peak_m3_s": area_m2 * float(np.abs(rates_m_s).max(initial=0.0)),
                "mode": Mode(int(run.column("mode")[-1])).name,
                "fault": Fault(int(run.column("fault")[-1])).name,
                "active_share": float((run.column("mode")[window] == Mode.ACTIVE).mean()),
            }
        found.append(
            RunFigures(
                compared=run.name in rolls,
                ranked=counts,
                mark=marks[run.name],
                rows=result.rows_compared(run),
                expected_rows=result.expected_rows,
                capsized_s=finite(run.capsized_s),
                loop=None if run.loop is None else run.loop.summary(),
                retuning=tuple(event.as_json() for event in run.events),
                **judged,
            )
        )
    return tuple(found)


def rolls_compared(result: BenchResult) -> dict[str, FloatArray]:
    """Roll of each compared run over the window."""
    return {
        run.name: run.column("true_roll_rad")[_window(result, run)]
        for run in result.runs
        if result.compares(run)
    }


def mark_of(result: BenchResult, run: Run) -> Mark | None:
    """Reason why a run is not ranked (capsized, failed or idle); None for one that is."""
    if not result.compares(run):
        return Mark(
            "not compared",
            f"not compared, ended at {run.end_s:g} s with {result.rows_compared(run)} of the "
            f"{result.expected_rows} rows from {result.settle_s:g} s to {result.end_s:g} s",
        )
    if run.capsized_s < result.end_s:
        return Mark("capsized", f"the ship capsized at {run.capsized_s:.1f} s")
    mode, fault = (int(run.column(name)[-1]) for name in ("mode", "fault"))
    if fault != Fault.NONE:
        words = fault_text(Fault(fault))
        return Mark("fault", f"the controller ended in {Mode(mode).name}, fault {words}")
    wanted = Mode.ACTIVE
    if run.name == PASSIVE:
        wanted = _ORDERS[passive_script(result.scenario.vessel)[0].action]
    ordered = _window(result, run) & (_orders(result, run) == wanted)
    if not ordered.any():
        return Mark("idle", f"no order to go to {wanted.name} before the end of the window")
    share = float((run.column("mode")[ordered] == wanted).mean())
    if share >= LEAST_IN_CHARGE:
        return None
    return Mark(
        "idle",
        f"the controller was in {wanted.name} for {share:.1%} of the time that the operator "
        f"wanted it there; {LEAST_IN_CHARGE:.0%} are asked for",
    )


def _orders(result: BenchResult, run: Run) -> npt.NDArray[np.int64]:
    """Mode ordered by the operator at each row, from when the controller is ready.

    In the passive run it is zero pressure: a pump switched off would turn with the water.
    """
    scenario = result.scenario
    script = passive_script(scenario.vessel) if run.name == PASSIVE else scenario.operator
    time_s, orders = run.column("time_s"), np.full(len(run.rows), int(Mode.STANDBY))
    ready = np.flatnonzero(run.column("mode") != Mode.INIT)
    start_s = time_s[ready[0]] if len(ready) else np.inf
    for timed in sorted(script, key=lambda timed: timed.time_s):
        if timed.action in _ORDERS:
            orders[time_s >= start_s + timed.time_s] = _ORDERS[timed.action]
    return orders


def _endings(result: BenchResult, marks: Mapping[str, Mark | None]) -> list[str]:
    said = []
    if result.interrupted:
        said.append(f"ended at {result.end_s:g} of {result.duration_s:g} s")
    if result.killed:
        said.append(KILLED)
    if result.not_run:
        said.append(f"not run: {', '.join(result.not_run)}")
    if result.without_tank_capsized_s < result.end_s:
        said.append(f"{NO_TANK}: the ship capsized at {result.without_tank_capsized_s:.1f} s")
    said += [f"{name}: not ranked, {mark.why}" for name, mark in marks.items() if mark]
    said += [
        f"{run.name}: {run.fallbacks} plans were not found in time; the one before went on"
        for run in result.runs
        if run.fallbacks
    ]
    said += [f"{run.name}: the law failed: {run.law_error}" for run in result.runs if run.law_error]
    return said


def _bare_roll(result: BenchResult) -> FloatArray:
    return result.without_tank_rad[round(result.settle_s / RECORD_S) :]


def _window(result: BenchResult, run: Run) -> npt.NDArray[np.bool_]:
    return run.between(result.settle_s, result.end_s)


def _share_below(roll: RollStatistics, reference: RollStatistics | None) -> float | None:
    if reference is None or reference.rms_rad < LEAST_ROLL_RAD:
        return None
    return 1.0 - roll.rms_rad / reference.rms_rad
