"""What a bench prints and leaves behind: figures, a table, a picture and a recording."""

import json
import math
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, Final

from rich.markup import escape
from rich.table import Table as RichTable

from firmware_sim.bench import BenchResult
from firmware_sim.on_board import on_board_json
from firmware_sim.retuning_figures import (
    SETTLING_S,
    RetuningFigures,
    events_on_ships_time,
    retuning_figures,
)
from firmware_sim.run import COLUMNS, RECORD_S, Run
from firmware_sim.scenario import PASSIVE
from utank_hil.analysis.motion.statistics import (
    PumpStatistics,
    RollStatistics,
    pump_statistics,
    roll_statistics,
)
from utank_hil.canbus import Fault, Mode
from utank_hil.pictures import BenchCurve, draw_bench
from utank_hil.runtime.faults import fault_text
from utank_hil.telemetry import write_recording

NO_TANK: Final = "no tank"
PICTURE, RECORDING, FIGURES = "bench.png", "bench.rrd", "bench.json"
REPORT_FILES: Final = (PICTURE, RECORDING, FIGURES)
LEAST_ROLL_RAD: Final = 1e-6
"""Less roll than this is none: a share of it says nothing."""


@dataclass(frozen=True, slots=True)
class RunFigures:
    """One run in figures, over the window of the bench.

    Attributes
    ----------
    name : str
    roll : RollStatistics
    roll_below_no_tank, roll_below_passive : float or None
        Share by which the roll RMS is less than without a tank, and than with the passive tank;
        None where there is no roll to be below, on still water, or no passive run to compare with.
    pump : PumpStatistics
    bus_load : float
    refused_commands : int
    mode, fault : str
        Of the controller at the end of the run.
    active_share : float
        Share of the window in which the controller was in charge.
    """

    name: str
    roll: RollStatistics
    roll_below_no_tank: float | None
    roll_below_passive: float | None
    pump: PumpStatistics
    bus_load: float
    refused_commands: int
    mode: str
    fault: str
    active_share: float


def figures(result: BenchResult) -> tuple[RollStatistics, tuple[RunFigures, ...]]:
    """Figures of the bare ship, and of each run that can be compared with it."""
    bare = roll_statistics(result.without_tank_rad[round(result.settle_s / RECORD_S) :])
    compared = [run for run in result.runs if result.compares(run)]
    passive = next((_roll(result, run) for run in compared if run.name == PASSIVE), None)
    return bare, tuple(_figures(result, run, bare, passive) for run in compared)


def _roll(result: BenchResult, run: Run) -> RollStatistics:
    window = run.between(result.settle_s, result.end_s)
    return roll_statistics(run.column("true_roll_rad")[window])


def _figures(
    result: BenchResult, run: Run, bare: RollStatistics, passive: RollStatistics | None
) -> RunFigures:
    window = run.between(result.settle_s, result.end_s)
    roll, mode = _roll(result, run), run.column("mode")
    return RunFigures(
        name=run.name,
        roll=roll,
        roll_below_no_tank=_share_below(roll, bare),
        roll_below_passive=None if passive is None else _share_below(roll, passive),
        pump=pump_statistics(
            run.column("true_pressure_pa")[window],
            run.column("true_shaft_power_w")[window],
            run.column("true_level_m")[window],
        ),
        bus_load=run.bus_load,
        refused_commands=run.refused_commands,
        mode=Mode(int(mode[-1])).name,
        fault=Fault(int(run.column("fault")[-1])).name,
        active_share=float((mode[window] == Mode.ACTIVE).mean()),
    )


def _share_below(roll: RollStatistics, reference: RollStatistics) -> float | None:
    return None if reference.rms_rad < LEAST_ROLL_RAD else 1.0 - roll.rms_rad / reference.rms_rad


def motion_table(result: BenchResult) -> RichTable:
    """Table of how much the ship rolled."""
    bare, runs = figures(result)
    table = _table(
        f"{result.scenario.name} · {result.mode} · seed {result.seed}",
        "roll RMS\n°",
        "significant\n°",
        "maximum\n°",
        "RMS below\nno tank",
        "RMS below\npassive",
    )
    table.caption = f"{result.settle_s:g} s to {result.end_s:g} s of the same waves"
    table.add_row(NO_TANK, *_roll_cells(bare))
    for run in runs:
        table.add_row(
            run.name,
            *_roll_cells(run.roll),
            _percent(run.roll_below_no_tank),
            "" if run.name == PASSIVE else _percent(run.roll_below_passive),
        )
    return table


def pump_table(result: BenchResult) -> RichTable:
    """Table of what pump and bus did for it."""
    table = _table(
        "Pump and bus",
        "pressure\nRMS kPa",
        "pressure\npeak kPa",
        "power\nmean MW",
        "power\npeak MW",
        "level\npeak m",
        "bus\nload",
    )
    for run in figures(result)[1]:
        pump = run.pump
        table.add_row(
            run.name,
            f"{pump.pressure_rms_pa / 1e3:.1f}",
            f"{pump.pressure_peak_pa / 1e3:.1f}",
            f"{pump.power_mean_w / 1e6:.2f}",
            f"{pump.power_peak_w / 1e6:.2f}",
            f"{pump.level_peak_m:.2f}",
            f"{run.bus_load:.1%}",
        )
    return table


def retuning_table(result: BenchResult) -> RichTable | None:
    """Table of what retuning found and gained; None where nothing retuned."""
    found = {
        run.name: retuning_figures(run, result.scenario, result.settle_s) for run in result.runs
    }
    if not any(found.values()):
        return None
    table = _table(
        "Retuning",
        "retuned\nat s",
        "roll RMS\nbefore °",
        "roll RMS\nafter °",
        "\nless",
        "roll period s\nfound ± / true",
        "ship damping MN m s\nfound / true",
        "tank damping ratio\nfound / true",
    )
    table.add_column("\nended in", no_wrap=True)
    table.add_column("\nbecause")
    table.caption = (
        f"± one standard deviation; before the first identification, and from {SETTLING_S:g} s "
        "after the new law took charge"
    )
    for name, figures in found.items():
        if figures is not None:
            table.add_row(name, *_retuning_cells(figures))
    return table


def _retuning_cells(retuning: RetuningFigures) -> tuple[str, ...]:
    found, true = retuning.found, retuning.truth
    period = ship = tank = ""
    if found is not None:
        deviation_s = found.roll_period_s * found.period_deviation
        period = f"{found.roll_period_s:.3f} ± {deviation_s:.3f} / {true.roll_period_s:.3f}"
        ship = f"{found.damping_nms_rad / 1e6:#.4g} / {true.damping_nms_rad / 1e6:#.4g}"
        tank = f"{found.tank_damping_ratio:.4f} / {true.tank_damping_ratio:.4f}"
    rolls = (retuning.roll_before_rad, retuning.roll_after_rad)
    return (
        "" if retuning.retuned_at_s is None else f"{retuning.retuned_at_s:.0f}",
        *("" if roll is None else f"{math.degrees(roll):.2f}" for roll in rolls),
        _percent(retuning.roll_after_below_before),
        period,
        ship,
        tank,
        retuning.state
        if retuning.attempts <= 1
        else f"{retuning.state}, attempt {retuning.attempts}",
        escape("; ".join(retuning.reasons)),
    )


def endings(result: BenchResult) -> list[str]:
    """What is to be said of how runs ended; nothing where all went as the operator wanted."""
    said = []
    if result.interrupted:
        said.append(f"ended at {result.end_s:g} of {result.duration_s:g} s")
    if result.not_run:
        said.append(f"not run: {', '.join(result.not_run)}")
    said += [_why_not_compared(result, run) for run in result.runs if not result.compares(run)]
    said += [
        f"{run.name}: {run.fallbacks} plans were not found in time; the one before went on"
        for run in result.runs
        if run.fallbacks
    ]
    said += [f"{run.name}: the law failed: {run.law_error}" for run in result.runs if run.law_error]
    for run in figures(result)[1]:
        if run.fault != Fault.NONE.name or run.mode == Mode.FAULT.name:
            words = fault_text(Fault[run.fault])
            said.append(f"{run.name}: the controller ended in {run.mode}, fault {words}")
        elif run.name != PASSIVE and run.active_share == 0:
            said.append(f"{run.name}: the controller was never in charge")
    return said


def _why_not_compared(result: BenchResult, run: Run) -> str:
    return (
        f"{run.name}: not compared, ended at {run.end_s:g} s with {result.rows_compared(run)} of "
        f"the {result.expected_rows} rows from {result.settle_s:g} s to {result.end_s:g} s"
    )


def _percent(share: float | None) -> str:
    return "" if share is None else f"{share:.1%}"


def _table(title: str, *headings: str) -> RichTable:
    table = RichTable(title=title)
    table.add_column("", no_wrap=True)
    for heading in headings:
        table.add_column(heading, justify="right", no_wrap=True)
    return table


def _roll_cells(roll: RollStatistics) -> tuple[str, str, str]:
    return (
        f"{math.degrees(roll.rms_rad):.2f}",
        "" if roll.significant_rad is None else f"{math.degrees(roll.significant_rad):.2f}",
        f"{math.degrees(roll.maximum_rad):.2f}",
    )


def as_json(result: BenchResult, files: dict[str, Path]) -> dict[str, Any]:
    """Everything in the tables, in SI units, ready for `json.dumps`.

    A run that is not compared has no figures, but the rest.
    """
    bare, compared = figures(result)
    by_name = {run.name: asdict(run) for run in compared}
    return {
        "scenario": result.scenario.name,
        "mode": result.mode,
        "seed": result.seed,
        "duration_s": result.duration_s,
        "settle_s": result.settle_s,
        "end_s": result.end_s,
        "interrupted": result.interrupted,
        "not_run": list(result.not_run),
        "wall_s": result.wall_s,
        "no_tank": asdict(bare),
        "on_board": on_board_json(result),
        "runs": [
            {
                "name": run.name,
                "compared": run.name in by_name,
                "rows": result.rows_compared(run),
                "expected_rows": result.expected_rows,
                "end_s": run.end_s,
                "bus_load": run.bus_load,
                "refused_commands": run.refused_commands,
                "fallbacks": run.fallbacks,
                "law_error": run.law_error,
                **by_name.get(run.name, {}),
                "loop": None if run.loop is None else run.loop.statistics.summary(),
                "retuning": _retuning_json(result, run),
            }
            for run in result.runs
        ],
        "files": {name: str(path) for name, path in files.items()},
    }


def _retuning_json(result: BenchResult, run: Run) -> dict[str, Any] | None:
    found = retuning_figures(run, result.scenario, result.settle_s)
    return None if found is None else found.as_json()


def write_report(result: BenchResult, folder: Path) -> tuple[dict[str, Path], list[str]]:
    """Write picture, recording and figures of a bench.

    Returns
    -------
    files : dict
        Path of each that was written: "picture", "recording", "figures".
    failures : list of str
        What could not be written, and why.
    """
    files: dict[str, Path] = {}
    failures = []

    def write_figures(result: BenchResult, path: Path) -> None:
        found = as_json(result, files | {"figures": path})
        path.write_text(json.dumps(found, indent=2) + "\n")

    for name, file, write in (
        ("picture", PICTURE, _draw),
        ("recording", RECORDING, _record),
        ("figures", FIGURES, write_figures),  # last, because they name the others
    ):
        try:
            write(result, folder / file)
        except (OSError, RuntimeError) as error:
            failures.append(f"the {name} could not be written: {error}")
        else:
            files[name] = folder / file
    return files, failures


def _draw(result: BenchResult, path: Path) -> None:
    found = {run.name: run for run in figures(result)[1]}
    draw_bench(
        [
            BenchCurve(
                _legend(run.name, found.get(run.name)),
                run.column("time_s"),
                run.column("true_roll_rad"),
                run.column("true_level_m"),
                run.column("true_pressure_pa"),
                run.column("retuning") if run.retuning else None,
            )
            for run in result.runs
        ],
        path,
        title=f"{result.scenario.name}, seed {result.seed}, {result.mode}",
    )


def _legend(name: str, found: RunFigures | None) -> str:
    """Name of a run with the roll that the table shows, and what that is against the passive."""
    if found is None:
        return f"{name}: not compared"
    below = None if name == PASSIVE else found.roll_below_passive
    change = "" if below is None else f" ({-below:+.0%})".replace("-", "−")
    return f"{name}: roll {math.degrees(found.roll.rms_rad):.2f}° RMS{change}"


def _record(result: BenchResult, path: Path) -> None:
    write_recording(
        path,
        COLUMNS,
        {run.name: run.rows for run in result.runs},
        {run.name: events_on_ships_time(run) for run in result.runs if run.retuning},
    )
