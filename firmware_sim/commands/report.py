"""``utank-hil report``: runs as one page that can be sent."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from utank_hil.console.common import Json, argument, fail, failing, option, print_json
from utank_hil.console.terminal import notes, say_note, shown
from utank_hil.telemetry.frame_log import SUFFIX

if TYPE_CHECKING:
    from utank_hil.reports.page import Report


def report(
    runs: Annotated[
        list[Path], argument("Folders of benches and campaigns, logs of `utank-hil run` (.frames).")
    ],
    out: Annotated[
        Path | None, option("The page, or a folder for it; beside the first run if not given.")
    ] = None,
    json_: Json = False,
) -> None:
    """Write one HTML page of one or several runs: it needs no network and prints well.

    Verdict, tables, pictures, modes, alarms, deadlines, and where the results come from.

    **Example:** utank-hil report out/run-20261122T093000Z.frames
    """
    from firmware_sim.report_page import PAGE, RECORDING
    from utank_hil.pictures.report_page import write_report_page
    from utank_hil.reports.page import joined

    runs = [run.parent if run.name == RECORDING else run for run in runs]
    if out is not None and (out.is_dir() or not (out.suffix or out.exists())):
        out /= PAGE
    page = out or (runs[0] / PAGE if runs[0].is_dir() else runs[0].with_suffix(".html"))
    if out is None and len(runs) > 1:  # the page of the first run alone stays
        first = runs[0].resolve()
        page = first.with_name(f"{first.stem}-and-{len(runs) - 1}-more.html")
    with failing(OSError, ValueError):
        reports = [_report(run) for run in runs]
        page.parent.mkdir(parents=True, exist_ok=True)
        written = write_report_page(page, *joined(reports))
    if json_:
        print_json({"page": str(written), "bytes": written.stat().st_size})
    else:
        notes.say(f"report: {shown(written)}")


def _report(run: Path) -> "Report":
    from firmware_sim.campaign.report import campaign_report
    from firmware_sim.campaign.store import SUMMARY
    from firmware_sim.report_page import FIGURES, read_bench
    from utank_hil.reports.recording import recording_report

    try:
        if (run / FIGURES).is_file():
            return read_bench(run)
        if (run / SUMMARY).is_file():
            return campaign_report(run)
    except KeyError as error:
        raise ValueError(f"{run}: has no {error}: it is of another version") from error
    if run.is_dir():
        fail(
            f"{run}: is a folder of no bench ({FIGURES}) and of no campaign ({SUMMARY}): "
            f"name such a one, or name a log of `utank-hil run` ({SUFFIX})"
        )
    if run.exists() and run.suffix != SUFFIX:
        fail(
            f"{run}: is no log of `utank-hil run` ({SUFFIX}): name one, or a folder of `bench` or "
            "`campaign`"
        )
    return recording_report(run, say_note)
