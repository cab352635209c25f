"""What a bench prints and leaves behind: figures, a table, a picture and a recording."""

import json
import math
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, Final

from rich.table import Table as RichTable

from firmware_sim.bench import BenchResult
from firmware_sim.retuning_figures import retuning_figures
from firmware_sim.run import COLUMNS, RECORD_S, Run
from firmware_sim.scenario import PASSIVE
from utank_hil.analysis.metrics import (
    PumpStatistics,
    RollStatistics,
    pump_statistics,
    roll_statistics,
)
from utank_hil.arrays import FloatArray
from utank_hil.canbus import Fault, Mode
from utank_hil.telemetry import BenchCurve, draw_bench, write_recording

NO_TANK: Final = "no tank"
LEAST_ROLL_RAD: Final = 1e-6
"""Less roll than this is none: a share of it says nothing."""


@dataclass(frozen=True, slots=True)
class RunFigures:
    """One run in figures.

    Attributes
    ----------
    name : str
    roll : RollStatistics
    roll_below_no_tank, roll_below_passive : float or None
        Share by which the roll RMS is less than without a tank, and than with the passive tank;
        None where there is no roll to be below, on still water.
    pump : PumpStatistics
    bus_load : float
    refused_commands : int
    mode, fault : str
        Of the controller at the end of the run.
    active_share : float
        Share of the judged time in which the controller was in charge.
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
    """Figures of the bare ship, and of each run."""
    skip = int(result.settle_s / RECORD_S)
    bare_rad, passive = result.without_tank_rad, result.runs[0]
    return roll_statistics(bare_rad[skip:]), tuple(
        _figures(run, skip, bare_rad, passive) for run in result.runs
    )


def _figures(run: Run, skip: int, bare_rad: FloatArray, passive: Run) -> RunFigures:
    # a run that was ended early is compared over the time it had
    count = min(len(run.rows), len(passive.rows))
    compared_rad, without_tank_rad, passive_rad = (
        roll_statistics(roll_rad[skip:count]).rms_rad
        for roll_rad in (run.column("true_roll_rad"), bare_rad, passive.column("true_roll_rad"))
    )
    roll = roll_statistics(run.column("true_roll_rad")[skip:])
    mode = run.column("mode")
    return RunFigures(
        name=run.name,
        roll=roll,
        roll_below_no_tank=_share_below(compared_rad, without_tank_rad),
        roll_below_passive=_share_below(compared_rad, passive_rad),
        pump=pump_statistics(
            run.column("true_pressure_pa")[skip:],
            run.column("true_shaft_power_w")[skip:],
            run.column("true_level_m")[skip:],
        ),
        bus_load=run.bus_load,
        refused_commands=run.refused_commands,
        mode=Mode(int(mode[-1])).name,
        fault=Fault(int(run.column("fault")[-1])).name,
        active_share=float((mode[skip:] == Mode.ACTIVE).mean()),
    )


def _share_below(value: float, reference: float) -> float | None:
    return None if reference < LEAST_ROLL_RAD else 1.0 - value / reference


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
    table.add_row(NO_TANK, *_roll_cells(bare))
    for run in runs:
        first = run is runs[0]
        table.add_row(
            run.name,
            *_roll_cells(run.roll),
            _percent(run.roll_below_no_tank),
            "" if first else _percent(run.roll_below_passive),
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


def endings(result: BenchResult) -> list[str]:
    """What is to be said of how runs ended; nothing where all went as the operator wanted."""
    said = []
    for run in figures(result)[1]:
        if run.fault != Fault.NONE.name or run.mode == Mode.FAULT.name:
            said.append(f"{run.name}: the controller ended in {run.mode}, fault {run.fault}")
        elif run.name != PASSIVE and run.active_share == 0:
            said.append(f"{run.name}: the controller was never in charge")
    return said


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
        f"{math.degrees(roll.significant_rad):.2f}",
        f"{math.degrees(roll.maximum_rad):.2f}",
    )


def as_json(result: BenchResult, files: dict[str, Path]) -> dict[str, Any]:
    """Everything in the tables, in SI units, ready for `json.dumps`."""
    bare, runs = figures(result)
    return {
        "scenario": result.scenario.name,
        "mode": result.mode,
        "seed": result.seed,
        "duration_s": result.duration_s,
        "settle_s": result.settle_s,
        "wall_s": result.wall_s,
        "no_tank": asdict(bare),
        "runs": [
            {
                **asdict(run),
                "loop": None if done.loop is None else done.loop.statistics.summary(),
                "retuning": retuning_figures(done, result.settle_s),
            }
            for run, done in zip(runs, result.runs, strict=True)
        ],
        "files": {name: str(path) for name, path in files.items()},
    }


def write_report(result: BenchResult, folder: Path) -> dict[str, Path]:
    """Write picture, recording and figures of a bench.

    Returns
    -------
    dict
        Path of each: "picture", "recording", "figures".
    """
    folder.mkdir(parents=True, exist_ok=True)
    files = {
        "picture": folder / "bench.png",
        "recording": folder / "bench.rrd",
        "figures": folder / "bench.json",
    }
    draw_bench(
        [
            BenchCurve(
                run.name,
                run.column("time_s"),
                run.column("true_roll_rad"),
                run.column("true_level_m"),
                run.column("true_pressure_pa"),
            )
            for run in result.runs
        ],
        files["picture"],
        title=f"{result.scenario.name}, seed {result.seed}, {result.mode}",
    )
    write_recording(files["recording"], COLUMNS, {run.name: run.rows for run in result.runs})
    files["figures"].write_text(json.dumps(as_json(result, files), indent=2) + "\n")
    return files
