"""What every report has: its parts, the roll's statistics, and where the results come from."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import yaml
from rich.table import Table

from utank_hil.base.arrays import FloatArray
from utank_hil.pictures.report_page import ReportPicture, ReportSection, ReportTable, Verdict
from utank_hil.pictures.roll_statistics import draw_roll_statistics


class Report(NamedTuple):
    """The report of a run: heading, the line below it, what is said first of all, and the rest."""

    title: str
    below: str
    verdict: Verdict
    sections: Sequence[ReportSection]


@dataclass(frozen=True, slots=True)
class ReportKind:
    """A kind of run that can be reported."""

    file: str  #: By which the run's folder is known.
    #: Of the folder, with another one for pictures that are made for the report. Raises OSError or
    #: ValueError for what it can't read, KeyError for what another version wrote.
    report: Callable[[Path, Path], Report]


def printed(table: Table) -> ReportTable:
    """A table of the terminal."""

    def line(text: object) -> str:
        return " ".join(str(text or "").split())

    rows = zip(*([line(cell) for cell in column.cells] for column in table.columns), strict=True)
    caption = ": ".join(filter(None, (line(table.title), line(table.caption))))
    return ReportTable([line(column.header) for column in table.columns], list(rows), caption)


def roll_figure(rolls: Mapping[str, FloatArray], step_s: float, scratch: Path) -> ReportSection:
    """Spectra of the roll and exceedance of its amplitudes, as a picture in `scratch`."""
    title = "Roll at which periods, how often"
    file = draw_roll_statistics(rolls, step_s, scratch / "roll.png", title)
    says = "Left: spectra of the roll over its period. Right: share of amplitudes above each angle."
    picture = ReportPicture(file.read_bytes(), says)
    return ReportSection("Spectra and exceedance", pictures=[picture])


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
