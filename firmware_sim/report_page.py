"""What a report says of a bench: read from the files that it left."""

import json
import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Final

import numpy as np

from firmware_sim.report_tables import tables
from firmware_sim.scenario import PASSIVE
from utank_hil.base.arrays import FloatArray
from utank_hil.configuration import Vessel
from utank_hil.console.ship_report import power_words, ship_line
from utank_hil.pictures.report_page import ReportPicture, ReportSection, ReportTable, Verdict
from utank_hil.reports.parts import (
    Report,
    ReportKind,
    about_section,
    printed,
    roll_figure,
)
from utank_hil.telemetry.recording import read_recording

Recorded = Mapping[str, Mapping[str, FloatArray]]
"""Columns by run."""
FIGURES, PICTURE, RECORDING = "bench.json", "bench.png", "bench.rrd"

_SEAS: Final = {
    "measured": "measured",
    "jonswap": "growing (JONSWAP)",
    "ittc": "of given height and period (ITTC)",
    "pierson_moskowitz": "fully developed (Pierson-Moskowitz)",
    "regular": "one regular wave",
}
_SEA_KEYS: Final = {
    "time": "{} UTC",
    "until": "to {} UTC",
    "hs_m": "significant height {:g} m",
    "tp_s": "peak period {:g} s",
    "amplitude_m": "amplitude {:g} m",
    "period_s": "period {:g} s",
    "spreading": "spread as cos^2s with s = {:g}",
    "course_deg": "her course {:g}° from true north",
    "heading_deg": "waves at {:g}° to her course (0° following, 90° from port, 180° head)",
}


def bench_report(folder: Path, scratch: Path) -> Report:
    """The report of a bench.

    Parameters
    ----------
    folder : Path
        What ``utank-hil bench --out`` wrote.
    scratch : Path
        Folder for pictures that are made for the report.

    Raises
    ------
    OSError, ValueError
        If a file of the bench is missing or is none.
    """
    content = json.loads((folder / FIGURES).read_text(encoding="utf-8"))
    says = "Roll and power of each run, and roll, level and pressure over time"
    sections = [
        ReportSection("What was run", _what_was_run(content)),
        ReportSection(
            "Roll and cost",
            pictures=[ReportPicture((folder / PICTURE).read_bytes(), says)],
            tables=[printed(table) for table in tables(content)],
        ),
        *_roll_figure(content, read_recording(folder / RECORDING), scratch),
        _deadlines(content),
        about_section(content, content["configuration"]),
    ]
    below = (
        f"{content['mode']}, seed {content['seed']}, {content['settle_s']:g} s to "
        f"{content['end_s']:g} s of the same waves for each run. {content['date']}."
    )
    return Report(f"{content['scenario']}: bench", below, _verdict(content), sections)


BENCH: Final = ReportKind(FIGURES, bench_report)


def _roll_figure(content: dict[str, Any], recorded: Recorded, scratch: Path) -> list[ReportSection]:
    # a run that is not compared may have ended before the compared time begins
    compared = [run["name"] for run in content["runs"] if run["compared"]]
    rolls = {}
    for name in compared:
        time_s = recorded[name]["time_s"]
        between = (time_s >= content["settle_s"]) & (time_s <= content["end_s"])
        rolls[name] = recorded[name]["true_roll_rad"][between]
    if not rolls:
        return []
    step_s = float(np.median(np.diff(recorded[compared[0]]["time_s"])))
    return [roll_figure(rolls, step_s, scratch)]


def _verdict(content: dict[str, Any]) -> Verdict:
    ranked = [run for run in content["runs"] if run["ranked"] and run["name"] != PASSIVE]
    lines = []
    if ranked:
        best = min(ranked, key=lambda run: run["rank"])
        below, bare = best["roll_below_passive"], best["roll_below_no_tank"]
        line = f"{best['name']} rolls {math.degrees(best['roll']['rms_rad']):.2f}° RMS"
        if below is not None:
            line += f", {_less(below)} than the passive tank"
        if bare is not None:
            line += f" and {_less(bare)} than no tank"
        power = power_words(best["pump"]["power_mean_w"])
        lines.append(f"{line}, for {power} of shaft power on average.")
    wrong = [*content["endings"], *content["limits_passed"]]
    lines += wrong or ["No run failed, and no limit of the model was passed."]
    return Verdict(lines, good=not wrong)


def _less(share: float) -> str:
    return f"{abs(share):.0%} {'less' if share >= 0 else 'more'}"


def sea_words(sea: Mapping[str, Any]) -> str:
    """The section ``sea`` of a scenario, for people."""
    words = [_SEAS[sea["kind"]]]
    for key, said in _SEA_KEYS.items():
        value = sea.get(key)
        if value is not None:
            words.append(said.format(value.replace("T", " ") if isinstance(value, str) else value))
    if sea.get("speed_m_s"):
        words.append(f"her speed {sea['speed_m_s']:g} m/s")
    return ", ".join(words)


def _what_was_run(content: dict[str, Any]) -> list[str]:
    vessel = Vessel.model_validate(content["configuration"]["vessel"])
    names = [run["name"] for run in content["runs"] if run["name"] != PASSIVE]
    return [
        f"Ship: {vessel.name}. {ship_line(vessel)}",
        f"Sea: {sea_words(content['configuration']['sea'])}.",
        f"Runs: {', '.join(['without a tank', 'with the passive tank', *names])}.",
    ]


def _deadlines(content: dict[str, Any]) -> ReportSection:
    loops = {run["name"]: run["loop"] for run in content["runs"] if run["loop"]}
    if not loops:
        return ReportSection("Deadlines", ["Simulated time: there are none."])
    keys = [key for key, value in next(iter(loops.values())).items() if not isinstance(value, dict)]
    rows = [
        [name, *(f"{loop[key]:.4g}" if loop[key] is not None else "" for key in keys)]
        for name, loop in loops.items()
    ]
    headings = ["", *(key.replace("_", " ") for key in keys)]
    return ReportSection("Deadlines", tables=[ReportTable(headings, rows)])
