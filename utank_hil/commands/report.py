"""``utank-hil report``: a run on board as one page that can be sent."""

from pathlib import Path
from typing import Annotated

from utank_hil.console.common import Json, argument, fail, option, print_json
from utank_hil.console.terminal import notes, say_note, shown
from utank_hil.telemetry.frame_log import SUFFIX


def report(
    recording: Annotated[Path, argument("Log of `utank-hil run` (.frames).")],
    out: Annotated[Path | None, option("The page; beside the recording if not given.")] = None,
    json_: Json = False,
) -> None:
    """Write one HTML page of a recording: it needs no network and prints well.

    Verdict, picture, modes, alarms, deadlines, and where the results come from. The page of a bench
    is written by the bench.

    **Example:** utank-hil report out/run-20261122T093000Z.frames
    """
    from utank_hil.pictures.report_page import write_report_page
    from utank_hil.reports.recording import recording_report

    if recording.is_dir():
        fail(f"{recording}: is a folder; name a log of `utank-hil run` (.frames) in it")
    if recording.exists() and recording.suffix != SUFFIX:
        fail(f"{recording}: is no log of `utank-hil run` ({SUFFIX})")
    try:
        page = out or recording.with_suffix(".html")
        written = write_report_page(page, *recording_report(recording, say_note))
    except (OSError, ValueError) as error:
        fail(error)
    if json_:
        print_json({"page": str(written), "bytes": written.stat().st_size})
    else:
        notes.say(f"report: {shown(written)}")
