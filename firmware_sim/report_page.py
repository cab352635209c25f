"""Files of a bench: figures, picture, recording, and its page."""

import json
import math
import shlex
from collections.abc import Callable, Mapping
from functools import partial
from pathlib import Path
from typing import Any, Final

import numpy as np
from pydantic import TypeAdapter, ValidationError

from firmware_sim.bench import BenchResult
from firmware_sim.figures import NO_TANK as BARE
from firmware_sim.figures import BenchFigures, RunFigures, rolls_compared
from firmware_sim.report_tables import few_rolls, in_one_unit, roll_interval, tables
from firmware_sim.run import COLUMNS, RECORD_S
from firmware_sim.scenario_content import PASSIVE
from firmware_sim.tank_report import less
from utank_hil.base.arrays import FloatArray
from utank_hil.base.whole_file import write_whole
from utank_hil.configuration import Vessel
from utank_hil.console.common import why
from utank_hil.console.ship_report import power_words, ship_line
from utank_hil.pictures import BenchBar, BenchCurve, draw_bench, report_page
from utank_hil.pictures.style import COLORS, NO_TANK
from utank_hil.reports.page import Report, about_section, printed, roll_section
from utank_hil.telemetry.recording import write_recording
from utank_hil.telemetry.recording_reader import read_recording

PICTURE, RECORDING, FIGURES, PAGE = "bench.png", "bench.rrd", "bench.json", "report.html"

_SEAS: Final = {
    "measured": "measured",
    "tabulated": "of a table",
    "jonswap": "growing (JONSWAP)",
    "ittc": "of given height and period (ITTC)",
    "pierson_moskowitz": "fully developed (Pierson-Moskowitz)",
    "regular": "one regular wave",
    "components": "given waves",
}
_SEA_KEYS: Final = {
    "time": "{} UTC",
    "until": "to {} UTC",
    "hs_m": "significant height {:g} m",
    "tp_s": "peak period {:g} s",
    "amplitude_m": "amplitude {:g} m",
    "period_s": "period {:g} s",
    "spreading": "spread as cos^2s with s = {:g}",
    "course_deg": "course {:g}° from true north",
    "heading_deg": "waves at {:g}° to the course (0° following, 90° from port, 180° head)",
}


def bench_page(
    found: BenchFigures,
    about: Mapping[str, Any],
    picture: bytes | None,
    rolls: Mapping[str, FloatArray],
) -> Report:
    """Return the page of a bench; `rolls` has each run's over the window, every `RECORD_S`."""
    vessel = Vessel.model_validate(about["configuration"]["vessel"])
    few = few_rolls(found, vessel.ship.natural_frequency_rad_s)
    says = "Roll and power of each run, and roll, level and pressure over time"
    names = [run.name for run in found.runs if run.name != PASSIVE]
    sea = about["configuration"]["sea"]
    height = "" if "hs_m" in sea else f", significant height {found.hs_m:.2f} m at the start"
    run = [
        f"Ship: {vessel.name}. {ship_line(vessel)}",
        f"Sea: {sea_words(sea)}{height}.",
        f"Runs: {', '.join(['without a tank', 'with the passive tank', *names])}.",
        f"Again: {again(about)}",
    ]
    sections = [
        report_page.ReportSection("What was run", run),
        report_page.ReportSection(
            "Roll and cost",
            pictures=[] if picture is None else [report_page.ReportPicture(picture, says)],
            tables=[printed(table) for table in tables(found)],
        ),
        *([roll_section(rolls, RECORD_S)] if rolls else []),
        *([report_page.ReportSection("Retuning", found.retuned)] if found.retuned else []),
        _deadlines(found),
        about_section(about, about["configuration"]),
    ]
    below = (
        f"{found.mode}, seed {found.seed}, {found.settle_s:g} s to "
        f"{found.end_s:g} s of the same waves for each run. {about['date']}."
    )
    return Report(f"{found.scenario}: bench", below, [_verdict(found, few)], sections)


def read_bench(folder: Path) -> Report:
    """The page of a bench; `OSError, ValueError` for bad files, `KeyError` for other versions."""
    content = json.loads((folder / FIGURES).read_text(encoding="utf-8"))
    try:
        found = TypeAdapter(BenchFigures).validate_python(content)
    except ValidationError as error:
        key = ".".join(map(str, error.errors()[0]["loc"]))
        reason = f"has no {key} that can be used: it is of another version, make it again"
        raise ValueError(f"{folder / FIGURES}: {reason}") from error
    recorded, rolls = read_recording(folder / RECORDING), {}
    for run in found.compared:
        time_s = recorded[run.name]["time_s"]
        window = (time_s > found.settle_s - RECORD_S / 2) & (time_s < found.end_s - RECORD_S / 2)
        rolls[run.name] = recorded[run.name]["true_roll_rad"][window]
    return bench_page(found, content, (folder / PICTURE).read_bytes(), rolls)


def _verdict(found: BenchFigures, few: str) -> report_page.Verdict:
    ranked = [run for run in found.runs if run.ranked and run.name != PASSIVE]
    lines = []
    if ranked:
        best = min(ranked, key=lambda run: run.rank or math.inf)
        assert best.roll is not None
        assert best.pump is not None
        line = f"{best.name} rolls {math.degrees(best.roll.rms_rad):.2f}° RMS"
        if best.roll_below_passive is not None:
            line += f", {less(best.roll_below_passive)} than the passive tank"
        if best.roll_below_no_tank is not None:
            line += f" and {less(best.roll_below_no_tank)} than no tank"
        power = power_words(best.pump.power_mean_w)
        lines.append(f"{line}, for {power} of shaft power on average.")
    lines += [few] if few else []
    lines += found.wrong or ["No run failed, and no limit of the model was passed."]
    return report_page.Verdict(lines, good=not found.wrong)


def sea_words(sea: Mapping[str, Any]) -> str:
    """Readable description of the section ``sea`` of a scenario."""
    words = [_SEAS[sea["kind"]]]
    for key, said in _SEA_KEYS.items():
        value = sea.get(key)
        if value is not None:
            words.append(said.format(value.replace("T", " ") if isinstance(value, str) else value))
    if sea.get("speed_m_s"):
        words.append(f"speed {sea['speed_m_s']:g} m/s")
    return ", ".join(words)


def again(about: Mapping[str, Any]) -> str:
    """Command of a bench for a shell, with its seed; the folder of results is left to it."""
    options = {"seed": about["seed"], **about["options"]}
    options["seed"] = about["seed"]
    words = ["utank-hil", about["command"], str(options.pop("scenario", ""))]
    for name, value in options.items():
        if name in ("out", "json_", "frames", "fmu") or value is None or value is False:
            continue
        words.append(f"--{_FLAGS.get(name, name.replace('_', '-'))}")
        said = f"{value:.15g}" if isinstance(value, float) else str(value)
        words += [] if value is True else [said]
    return shlex.join(filter(None, words))


def _deadlines(found: BenchFigures) -> report_page.ReportSection:
    loops = {run.name: run.loop for run in found.runs if run.loop}
    if not loops:
        return report_page.ReportSection("Deadlines", ["Simulated time: there are none."])
    keys = [key for key, value in next(iter(loops.values())).items() if not isinstance(value, dict)]
    rows = [
        [name, *(f"{loop[key]:.4g}" if loop[key] is not None else "" for key in keys)]
        for name, loop in loops.items()
    ]
    headings = ["", *(key.replace("_", " ") for key in keys)]
    return report_page.ReportSection("Deadlines", tables=[report_page.ReportTable(headings, rows)])


_FLAGS: Final = {"real_time": "realtime"}  #: Options whose names differ from their parameters.

REPORT_FILES: Final = (PICTURE, RECORDING, FIGURES, PAGE)


def write_files(
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
        report_page.write_report_page(
            path, *bench_page(found, about, picture, rolls_compared(result))
        )

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
            run.column("mode"),
        )
        for run, judged in zip(result.runs, found.runs, strict=True)
    ]
    time_s = RECORD_S * np.arange(len(result.without_tank_rad), dtype=np.float64)
    upright = time_s < result.without_tank_capsized_s
    none = np.full(int(upright.sum()), np.nan)
    bare_rad = result.without_tank_rad[upright]
    bare = found.no_tank
    bar = BenchBar(BARE, NO_TANK, bare.rms_rad, _degrees(bare.rms_rad), None, "")
    if bare.capsized_s is not None and bare.capsized_s < found.end_s:
        bar = BenchBar(BARE, NO_TANK, None, "capsized", None, "")
    draw_bench(
        curves,
        path,
        title=f"{found.scenario}, seed {found.seed}, {found.mode}",
        about=about,
        bare=BenchCurve(BARE, time_s[upright], bare_rad, none, none),
        bars=[bar, *map(bar_of, found.runs, COLORS)],
        wrong=found.wrong,
        interval=roll_interval(found, result.scenario.vessel.ship.natural_frequency_rad_s),
    )


def bar_of(run: RunFigures, color: str) -> BenchBar:
    """Bars and words of a run in the picture's summary."""
    if run.mark is not None or run.roll is None or run.pump is None:
        return BenchBar(run.name, color, None, "" if run.mark is None else run.mark.word, None, "")
    said, pump = _degrees(run.roll.rms_rad), run.pump
    if run.name == PASSIVE:
        return BenchBar(run.name, color, run.roll.rms_rad, said, None, "")
    if run.roll_below_passive is not None:
        below = run.roll_below_passive
        share, side = f"{abs(below):.0%}", "below" if below >= 0 else "above"
        said += "   as passive" if share == "0%" else f"   {share} {side} passive"
    unit, (mean, most) = in_one_unit([pump.power_mean_w, pump.power_peak_w], "W")
    cost = f"{mean}, at most {most} {unit}"
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
        {run.name: run.events for run in result.runs},
        about,
    )
