"""``utank-hil report``: a run on board as one page that can be sent."""

from pathlib import Path
from typing import Annotated

import typer

from utank_hil.console.common import Json, fail, print_json
from utank_hil.console.terminal import notes, shown


def report(
    recording: Annotated[Path, typer.Argument(help="Recording of `utank-hil run` (.rrd).")],
    out: Annotated[
        Path | None, typer.Option(help="The page; beside the recording if not given.")
    ] = None,
    json_: Json = False,
) -> None:
    """Write one HTML page of a recording: it needs no network and prints well.

    Verdict, picture, modes, alarms, deadlines, and where the results come from. The page of a bench
    is written by the bench.

    **Example:** utank-hil report out/run.rrd
    """
    from utank_hil.pictures.report_page import write_report_page
    from utank_hil.reports.recording import recording_report

    if recording.is_dir():
        fail(f"{recording}: is a folder; name a recording of `utank-hil run` (.rrd) in it")
    if recording.exists() and recording.suffix != ".rrd":
        fail(f"{recording}: is no recording; name one of `utank-hil run` (.rrd)")
    try:
        page = out or recording.with_suffix(".html")
        written = write_report_page(page, *recording_report(recording))
    except (OSError, ValueError) as error:
        fail(error)
    if json_:
        print_json({"page": str(written), "bytes": written.stat().st_size})
    else:
        notes.say(f"report: {shown(written)}")
