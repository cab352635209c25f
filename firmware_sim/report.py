"""Files of a bench: figures, a picture, a recording and a page."""

import json
import math
import tempfile
from collections.abc import Callable, Mapping
from functools import partial
from pathlib import Path
from typing import Any, Final

from firmware_sim.bench import BenchResult
from firmware_sim.figures import NO_TANK as BARE
from firmware_sim.figures import BenchFigures, RunFigures, rolls_compared
from firmware_sim.report_page import FIGURES, PICTURE, RECORDING, bench_page
from firmware_sim.report_tables import roll_interval
from firmware_sim.retuning_figures import events_on_ships_time
from firmware_sim.run import COLUMNS
from firmware_sim.scenario import PASSIVE
from utank_hil.base.whole_file import write_whole
from utank_hil.console.common import why
from utank_hil.pictures import BenchBar, BenchCurve, draw_bench
from utank_hil.pictures.style import COLORS, NO_TANK
from utank_hil.reports.page import PAGE, write_reports
from utank_hil.telemetry.recording import write_recording

REPORT_FILES: Final = (PICTURE, RECORDING, FIGURES, PAGE)


def write_report(
    result: BenchResult, found: BenchFigures, folder: Path, about: Mapping[str, Any]
) -> tuple[dict[str, Path], list[str]]:
    """Write picture, recording, figures and page of a bench, with their provenance `about`.

    Returns the paths of the files written ("picture", "recording", "figures", "report"), and those
    that could not be, with the reason.
    """
    files: dict[str, Path] = {}
    failures = []

    def write_figures(path: Path) -> None:
        content = found.as_json(files | {"figures": path}, about)
        write_whole(path, json.dumps(content, indent=2) + "\n")

    def write_page(path: Path) -> None:
        picture = files["picture"].read_bytes() if "picture" in files else None
        with tempfile.TemporaryDirectory() as scratch:
            page = bench_page(found, about, picture, rolls_compared(result), Path(scratch))
            write_reports([page], path)

    writers: tuple[tuple[str, str, Callable[[Path], None]], ...] = (
        ("picture", PICTURE, partial(_draw, result, found, about)),
        ("recording", RECORDING, partial(_record, result, about)),
        ("figures", FIGURES, write_figures),  # after the files that they name
        ("report", PAGE, write_page),
    )
    for name, file, write in writers:
        try:
            write(folder / file)
        except (OSError, ValueError) as error:
            failures.append(f"the {name} could not be written: {why(error)}")
        else:
            files[name] = folder / file
    return files, failures


def _draw(result: BenchResult, found: BenchFigures, about: Mapping[str, Any], path: Path) -> None:
    curves = [
        BenchCurve(
            _legend(judged),
            run.column("time_s"),
            run.column("true_roll_rad"),
            run.column("true_level_m"),
            run.column("true_pressure_pa"),
            run.column("retuning") if run.retuning else None,
        )
        for run, judged in zip(result.runs, found.runs, strict=True)
    ]
    draw_bench(
        curves,
        path,
        title=f"{found.scenario}, seed {found.seed}, {found.mode}",
        about=about,
        bars=[_bare_bar(found), *map(_bar, found.runs, COLORS)],
        wrong=found.wrong,
        interval=roll_interval(found, result.scenario.vessel.ship.natural_frequency_rad_s),
    )


def _bare_bar(found: BenchFigures) -> BenchBar:
    bare = found.no_tank
    if bare.capsized_s is not None and bare.capsized_s < found.end_s:
        return BenchBar(BARE, NO_TANK, None, "capsized", None, "")
    return BenchBar(BARE, NO_TANK, bare.rms_rad, _degrees(bare.rms_rad), None, "")


def _bar(run: RunFigures, color: str) -> BenchBar:
    if run.mark is not None or run.roll is None or run.pump is None:
        return BenchBar(run.name, color, None, "" if run.mark is None else run.mark.word, None, "")
    said, pump = _degrees(run.roll.rms_rad), run.pump
    if run.name == PASSIVE:
        return BenchBar(run.name, color, run.roll.rms_rad, said, None, "")
    if run.roll_below_passive is not None:
        below = run.roll_below_passive
        said += f"   {abs(below):.0%} {'below' if below >= 0 else 'above'} passive"
    scale, unit = (1e6, "MW") if pump.power_peak_w >= 1e6 else (1e3, "kW")
    mean, most = pump.power_mean_w / scale, pump.power_peak_w / scale
    cost = f"{mean:.2f} {unit}, at most {most:.2f}"
    return BenchBar(run.name, color, run.roll.rms_rad, said, pump.power_mean_w, cost)


def _degrees(roll_rad: float) -> str:
    return f"{math.degrees(roll_rad):.2f}°"


def _legend(run: RunFigures) -> str:
    """Legend of a run: its name, its roll as in the table, and the reduction against passive."""
    if run.mark is not None or run.roll is None:
        return run.name if run.mark is None else f"{run.name}: {run.mark.word}"
    below = None if run.name == PASSIVE else run.roll_below_passive
    change = "" if below is None else f" ({-below:+.0%})".replace("-", "−")
    return f"{run.name}: roll {_degrees(run.roll.rms_rad)} RMS{change}"


def _record(result: BenchResult, about: Mapping[str, Any], path: Path) -> None:
    write_recording(
        path,
        COLUMNS,
        {run.name: run.rows for run in result.runs},
        {run.name: events_on_ships_time(run) for run in result.runs if run.retuning},
        about,
    )
