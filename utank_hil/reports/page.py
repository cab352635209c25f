"""Writes the page of one or several runs, of whatever kind."""

import tempfile
from collections.abc import Callable, Sequence
from importlib.metadata import entry_points
from pathlib import Path
from typing import Final

from utank_hil.pictures.report_page import write_report_page
from utank_hil.reports.recording import Report, ReportKind, recording_report

GROUP: Final = "utank_hil.reports"  #: Entry points of runs that leave a folder (`ReportKind`).
PAGE: Final = "report.html"


def write_page(runs: list[Path], page: Path) -> Path:
    """Write the page of these runs; OSError or ValueError says which can't be read, or written."""
    return write_reports([_report(run) for run in runs], page)


def write_reports(reports: Sequence[Report], page: Path) -> Path:
    """Write the page of these reports, one after the other."""
    title, below = reports[0].title, reports[0].below
    if len(reports) > 1:
        title = ", ".join(each.title for each in reports)
        below = " ".join(f"{each.title}: {each.below}" for each in reports)
    verdicts = [each.verdict for each in reports]
    sections = [section for each in reports for section in each.sections]
    return write_report_page(page, title, below, verdicts, sections)


def _report(run: Path) -> Report:
    if not run.exists():
        raise ValueError(f"{run}: is not there")
    file = run
    make: Callable[[Path, Path], Report] = recording_report
    if not run.is_file():
        kinds: list[ReportKind] = [point.load() for point in entry_points(group=GROUP)]
        kind = next((kind for kind in kinds if (run / kind.file).exists()), None)
        if kind is None:
            files = " and no ".join(kind.file for kind in kinds)
            raise ValueError(
                f"{run}: holds no {files}: give the folder of a bench or of a campaign, or the "
                ".rrd file of a run"
            )
        file, make = run / kind.file, kind.report
    try:
        with tempfile.TemporaryDirectory() as scratch:
            return make(run, Path(scratch))
    except KeyError as error:
        reason = f"has no {error}: it is of another version, make it again"
        raise ValueError(f"{file}: {reason}") from error
