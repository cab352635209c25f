"""``utank-hil report``: a run as one page that can be sent."""

from pathlib import Path
from typing import Annotated, Any

import typer

from utank_hil.console.common import Json, fail, print_json
from utank_hil.console.terminal import notes, shown


def report(
    runs: Annotated[
        list[Path], typer.Argument(help="Folders of benches and campaigns, recordings (.rrd).")
    ],
    out: Annotated[
        Path | None, typer.Option(help="The page; beside the first run if not given.")
    ] = None,
    json_: Json = False,
) -> None:
    """Write one HTML page of one or several runs: it needs no network and prints well.

    Verdict, tables, pictures, alarms, deadlines, and where the results come from.

    **Example:** utank-hil report out
    """
    from utank_hil.reports.page import PAGE, write_page

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
