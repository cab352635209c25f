"""``utank-hil report``: a run as one page that can be sent."""

import tempfile
from collections.abc import Callable
from importlib.metadata import entry_points
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Final

import typer

from utank_hil.commands.common import Json, fail, print_json
from utank_hil.commands.terminal import notes, shown

if TYPE_CHECKING:
    from utank_hil.commands.report_parts import Report, ReportKind

GROUP: Final = "utank_hil.reports"
"""Entry points of kinds of runs that leave a folder (`ReportKind`)."""
PAGE: Final = "report.html"


def report(
    runs: Annotated[
        list[Path], typer.Argument(help="Folders of benches and campaigns, recordings (.rrd).")
    ],
    out: Annotated[
        Path | None,
        typer.Option(help="The page; beside the first run if not given."),
    ] = None,
    json_: Json = False,
) -> None:
    """Write one HTML page of one or several runs: it needs no network and prints well.

    Verdict, tables, pictures, alarms, deadlines, and where the results come from.

    **Example:** utank-hil report out
    """
    page = out or (runs[0] / PAGE if runs[0].is_dir() else runs[0].with_suffix(".html"))
    try:
        written = write_page(runs, page)
    except (OSError, ValueError) as error:
        fail(error)
    if json_:
        result: dict[str, Any] = {"page": str(written), "bytes": written.stat().st_size}
        print_json(result)
    else:
        notes.say(f"report: {shown(written)}")


def write_page(runs: list[Path], page: Path) -> Path:
    """Write the page of these runs.

    Raises
    ------
    OSError, ValueError
        If a run can't be read or the page can't be written; says which.
    """
    from utank_hil.pictures.report_page import write_report_page

    reports = [_report(run) for run in runs]
    title, below = reports[0].title, reports[0].below
    if len(reports) > 1:
        title = ", ".join(each.title for each in reports)
        below = " ".join(f"{each.title}: {each.below}" for each in reports)
    verdicts = [each.verdict for each in reports]
    sections = [section for each in reports for section in each.sections]
    return write_report_page(page, title, below, verdicts, sections)


def _report(run: Path) -> "Report":
    from utank_hil.commands.report_recording import recording_report

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
