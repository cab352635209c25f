"""Sections that every report has: the roll's statistics, and where the results come from."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import yaml

from utank_hil.arrays import FloatArray
from utank_hil.pictures.report_page import ReportPicture, ReportSection, ReportTable
from utank_hil.pictures.roll_statistics import draw_roll_statistics


def roll_figure(rolls: Mapping[str, FloatArray], step_s: float, scratch: Path) -> ReportSection:
    """Spectra of the roll and exceedance of its amplitudes, as a picture in `scratch`."""
    file = draw_roll_statistics(
        rolls, step_s, scratch / "roll.png", "Roll at which periods, how often"
    )
    says = "Left: spectra of the roll over its period. Right: share of amplitudes above each angle."
    return ReportSection(
        "Spectra and exceedance", pictures=[ReportPicture(file.read_bytes(), says)]
    )


def about_section(about: Mapping[str, Any], configuration: Any) -> ReportSection:
    """Program, machine and command of a result, its data files and its whole configuration."""
    machine = about["machine"]
    options = {name: value for name, value in about["options"].items() if value is not None}
    rows = [
        ["program", f"{about['program']} {about['version']}, commit {about['commit']}"],
        ["date", about["date"]],
        ["machine", f"{machine['platform']}, Python {machine['python']}, {machine['cpus']} cores"],
        ["command", f"{about['command']}: " + ", ".join(f"{k} {v}" for k, v in options.items())],
        *([f"data file {name}", f"SHA-256 {digest}"] for name, digest in about["data"].items()),
    ]
    listing = yaml.safe_dump(configuration, sort_keys=False, allow_unicode=True)
    return ReportSection(
        "Where it comes from",
        tables=[ReportTable(["", ""], rows, text=True)],
        listings={"The whole configuration": listing},
    )
