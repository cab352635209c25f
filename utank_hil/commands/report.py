"""``utank-hil report``: a run as one page that can be sent."""

import json
import sys
import tempfile
from pathlib import Path
from typing import Annotated, Any, Final

import typer

from utank_hil.commands.common import Json, fail, notes, shown

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

    [bold]Example:[/bold] utank-hil report out
    """
    page = out or (runs[0] / PAGE if runs[0].is_dir() else runs[0].with_suffix(".html"))
    try:
        written = write_page(runs, page)
    except (OSError, ValueError) as error:
        fail(error)
    if json_:
        result: dict[str, Any] = {"page": str(written), "bytes": written.stat().st_size}
        sys.stdout.write(json.dumps(result) + "\n")
    else:
        notes.print(f"report: {shown(written)}", soft_wrap=True)


def write_page(runs: list[Path], page: Path) -> Path:
    """Write the page of these runs.

    Raises
    ------
    OSError, ValueError
        If a run can't be read or the page can't be written; says which.
    """
    from utank_hil.commands.report_bench import FIGURES, bench_sections
    from utank_hil.commands.report_campaign import SUMMARY, campaign_sections
    from utank_hil.commands.report_recording import recording_sections
    from utank_hil.pictures.report_page import write_report_page

    verdicts, sections, headings = [], [], []
    for run in runs:
        with tempfile.TemporaryDirectory() as scratch:
            if run.is_dir() and (run / FIGURES).exists():
                try:
                    found = bench_sections(run, Path(scratch))
                except KeyError as error:
                    raise ValueError(
                        f"{run / FIGURES}: has no {error}: it is of another version, run the bench "
                        "again"
                    ) from error
            elif run.is_dir() and (run / SUMMARY).exists():
                found = campaign_sections(run)
            elif run.is_file():
                found = recording_sections(run, Path(scratch))
            elif run.is_dir():
                raise ValueError(
                    f"{run}: holds no {FIGURES} and no {SUMMARY}: give the folder of a bench or "
                    "of a campaign, or the .rrd file of a run"
                )
            else:
                raise ValueError(f"{run}: is not there")
            title, below, verdict, parts = found
            headings.append((title, below))
            verdicts.append(verdict)
            sections += parts
    title, below = headings[0]
    if len(headings) > 1:
        title = ", ".join(title for title, _ in headings)
        below = " ".join(f"{title}: {below}" for title, below in headings)
    return write_report_page(page, title, below, verdicts, sections)
