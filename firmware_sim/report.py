"""What a bench says and leaves behind: how runs ended, figures, a picture and a recording."""

import json
import math
from collections.abc import Mapping
from dataclasses import asdict
from functools import partial
from pathlib import Path
from typing import Any, Final

from firmware_sim.bench import BenchResult
from firmware_sim.figures import RunFigures, figures
from firmware_sim.model_limits import passed_limits
from firmware_sim.on_board import on_board_json
from firmware_sim.retuning_figures import events_on_ships_time, retuning_figures
from firmware_sim.run import COLUMNS, Run
from firmware_sim.scenario import PASSIVE
from firmware_sim.verdicts import mark_of
from utank_hil.analysis.motion.statistics import RollStatistics
from utank_hil.base.finite import finite
from utank_hil.base.whole_file import write_whole
from utank_hil.console.common import why
from utank_hil.console.exit_codes import ExitCode
from utank_hil.console.failures import KILLED
from utank_hil.pictures import BenchBar, BenchCurve, draw_bench
from utank_hil.pictures.style import COLORS, NO_TANK
from utank_hil.reports.page import PAGE, write_page
from utank_hil.telemetry.recording import write_recording

PICTURE, RECORDING, FIGURES = "bench.png", "bench.rrd", "bench.json"
REPORT_FILES: Final = (PICTURE, RECORDING, FIGURES, PAGE)


def endings(result: BenchResult) -> list[str]:
    """What is to be said of how runs ended; nothing where all went as the operator wanted."""
    said = []
    if result.interrupted:
        said.append(f"ended at {result.end_s:g} of {result.duration_s:g} s")
    if result.killed:
        said.append(KILLED)
    if result.not_run:
        said.append(f"not run: {', '.join(result.not_run)}")
    if result.without_tank_capsized_s < result.end_s:
        said.append(f"no tank: the ship capsized at {result.without_tank_capsized_s:.1f} s")
    marks = {run.name: mark_of(result, run) for run in result.runs}
    said += [f"{name}: not ranked, {mark.why}" for name, mark in marks.items() if mark]
    said += [
        f"{run.name}: {run.fallbacks} plans were not found in time; the one before went on"
        for run in result.runs
        if run.fallbacks
    ]
    said += [f"{run.name}: the law failed: {run.law_error}" for run in result.runs if run.law_error]
    return said


def exit_code(result: BenchResult) -> ExitCode:
    """How a bench ended, for scripts."""
    if result.interrupted:
        return ExitCode.INTERRUPTED
    if result.killed:
        return ExitCode.SYSTEM
    marked = any(mark_of(result, run) for run in result.runs)
    return ExitCode.NOT_RANKED if marked or result.not_run else ExitCode.OK


def as_json(
    result: BenchResult, files: Mapping[str, Path], about: Mapping[str, Any]
) -> dict[str, Any]:
    """Everything in the tables, in SI units, ready for `json.dumps`, and where it comes from.

    A run that is not compared has no figures, but the rest.
    """
    bare, compared = figures(result)
    by_name = {run.name: asdict(run) for run in compared}
    marks = {run.name: mark_of(result, run) for run in result.runs}
    return {
        **about,
        "scenario": result.scenario.name,
        "mode": result.mode,
        "seed": result.seed,
        "duration_s": result.duration_s,
        "settle_s": result.settle_s,
        "end_s": result.end_s,
        "interrupted": result.interrupted,
        "not_run": list(result.not_run),
        "wall_s": result.wall_s,
        "exit_code": exit_code(result),
        "endings": endings(result),
        "limits_passed": passed_limits(result),
        "no_tank": asdict(bare) | {"capsized_s": finite(result.without_tank_capsized_s)},
        "on_board": on_board_json(result),
        "runs": [
            {
                "name": run.name,
                "compared": run.name in by_name,
                "ranked": False,
                "mark": None if (mark := marks[run.name]) is None else asdict(mark),
                "rows": result.rows_compared(run),
                "expected_rows": result.expected_rows,
                "end_s": run.end_s,
                "capsized_s": finite(run.capsized_s),
                "strikes": run.strikes,
                "max_strike_impulse_nms": run.max_strike_impulse_nms,
                "pump_speed_rad_s": run.pump_speed_rad_s,
                "energy_j": run.energy_j,
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


def write_report(
    result: BenchResult, folder: Path, about: Mapping[str, Any]
) -> tuple[dict[str, Path], list[str]]:
    """Write picture, recording, figures and report of a bench, with where it comes from (`about`).

    Returns
    -------
    files : dict
        Path of each that was written: "picture", "recording", "figures", "report".
    failures : list of str
        What could not be written, and why.
    """
    files: dict[str, Path] = {}
    failures = []

    def write_figures(result: BenchResult, path: Path, about: Mapping[str, Any]) -> None:
        found = as_json(result, files | {"figures": path}, about)
        write_whole(path, json.dumps(found, indent=2) + "\n")

    for name, file, write in (
        ("picture", PICTURE, _draw),
        ("recording", RECORDING, _record),
        ("figures", FIGURES, write_figures),  # after those that they name
        ("report", PAGE, lambda _result, path, _about: write_page([folder], path)),
    ):
        try:
            write(result, folder / file, about)
        except (OSError, ValueError) as error:
            failures.append(f"the {name} could not be written: {why(error)}")
        else:
            files[name] = folder / file
    return files, failures


def _draw(result: BenchResult, path: Path, about: Mapping[str, Any]) -> None:
    bare, compared = figures(result)
    found = {run.name: run for run in compared}
    draw_bench(
        [
            BenchCurve(
                _legend(result, run, found),
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
        about=about,
        bars=[_bare_bar(result, bare), *map(partial(_bar, result, found), result.runs, COLORS)],
        wrong=[*endings(result), *passed_limits(result)],
    )


def _bare_bar(result: BenchResult, bare: RollStatistics) -> BenchBar:
    if result.without_tank_capsized_s < result.end_s:
        return BenchBar("no tank", NO_TANK, None, "capsized", None, "")
    return BenchBar("no tank", NO_TANK, bare.rms_rad, _degrees(bare), None, "")


def _bar(result: BenchResult, found: Mapping[str, RunFigures], run: Run, color: str) -> BenchBar:
    mark = mark_of(result, run)
    if mark is not None:
        return BenchBar(run.name, color, None, mark.word, None, "")
    shown = found[run.name]
    said = _degrees(shown.roll)
    if run.name == PASSIVE:
        return BenchBar(run.name, color, shown.roll.rms_rad, said, None, "")
    if shown.roll_below_passive is not None:
        below = shown.roll_below_passive
        said += f"   {abs(below):.0%} {'below' if below >= 0 else 'above'} passive"
    scale, unit = (1e6, "MW") if shown.pump.power_peak_w >= 1e6 else (1e3, "kW")
    mean, most = (each / scale for each in (shown.pump.power_mean_w, shown.pump.power_peak_w))
    cost = f"{mean:.2f} {unit}, at most {most:.2f}"
    return BenchBar(run.name, color, shown.roll.rms_rad, said, shown.pump.power_mean_w, cost)


def _degrees(roll: RollStatistics) -> str:
    return f"{math.degrees(roll.rms_rad):.2f}°"


def _legend(result: BenchResult, run: Run, found: dict[str, RunFigures]) -> str:
    """Name of a run with the roll that the table shows, and what that is against the passive."""
    mark = mark_of(result, run)
    if mark is not None:
        return f"{run.name}: {mark.word}"
    shown = found[run.name]
    below = None if run.name == PASSIVE else shown.roll_below_passive
    change = "" if below is None else f" ({-below:+.0%})".replace("-", "−")
    return f"{run.name}: roll {math.degrees(shown.roll.rms_rad):.2f}° RMS{change}"


def _record(result: BenchResult, path: Path, about: Mapping[str, Any]) -> None:
    write_recording(
        path,
        COLUMNS,
        {run.name: run.rows for run in result.runs},
        {run.name: events_on_ships_time(run) for run in result.runs if run.retuning},
        about,
    )
