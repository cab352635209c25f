"""What reports of runs share: their parts, and the page that they are written to."""

import tempfile
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import yaml
from rich.table import Table

from utank_hil.base.arrays import FloatArray
from utank_hil.pictures.report_page import ReportPicture, ReportSection, ReportTable, Verdict
from utank_hil.pictures.roll_statistics import draw_roll_statistics


class Report(NamedTuple):
    """The report of a run as `write_report_page` takes it."""

    title: str
    about: str
    verdicts: Sequence[Verdict]
    sections: Sequence[ReportSection]


def joined(reports: Sequence[Report]) -> Report:
    """One report of several, one after the other."""
    if len(reports) == 1:
        return reports[0]
    return Report(
        ", ".join(each.title for each in reports),
        " ".join(f"{each.title}: {each.about}" for each in reports),
        [verdict for each in reports for verdict in each.verdicts],
        [section for each in reports for section in each.sections],
    )


def roll_section(rolls: Mapping[str, FloatArray], step_s: float) -> ReportSection:
    """Spectra of the roll (rad, each of shape (n,)) and exceedance of its amplitudes."""
    title = "Roll at which periods, how often"
    with tempfile.TemporaryDirectory() as scratch:
        file = draw_roll_statistics(rolls, step_s, Path(scratch) / "roll.png", title)
        png = file.read_bytes()
    says = "Left: spectra of the roll over its period. Right: share of amplitudes above each angle."
    return ReportSection("Spectra and exceedance", pictures=[ReportPicture(png, says)])


def printed(table: Table) -> ReportTable:
    """A table of the terminal."""

    def line(text: object) -> str:
        return " ".join(str(text or "").split())

    rows = zip(*([line(cell) for cell in column.cells] for column in table.columns), strict=True)
    caption = ": ".join(filter(None, (line(table.title), line(table.caption))))
    return ReportTable([line(column.header) for column in table.columns], list(rows), caption)


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
