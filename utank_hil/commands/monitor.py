"""``utank-hil monitor``: look at a recording, or at a controller that runs."""

from pathlib import Path
from typing import Annotated, Final

import typer

from utank_hil.commands.common import fail, notes

LIVE: Final = "rerun+http://"
"""How the address of a live stream begins."""


def monitor(
    source: Annotated[
        str,
        typer.Argument(
            help="A recording (.rrd), a bench's folder, or the address that `run --view` prints."
        ),
    ],
) -> None:
    """Show ship, tank and alarms in the viewer: the first tab for the watch, others for engineers.

    A recording opens where something happens: at the first fault, else where a new law was tried,
    else at the largest roll. Without a display the viewer is served on loopback for a browser; from
    another machine: ssh -L PORT:127.0.0.1:PORT SHIP, for both ports of the address.

    **Example:** utank-hil monitor out/bench.rrd
    """
    from utank_hil.telemetry import open_viewer
    from utank_hil.telemetry.highlight import highlight_s

    at_s = None
    shown: Path | str = source
    if not source.startswith(LIVE):
        file = Path(source)
        shown = file = file / "bench.rrd" if file.is_dir() else file
        if not file.is_file():
            fail(f"{file}: is not there; give a recording, a bench's folder, or {LIVE}...")
        try:
            at_s = highlight_s(file)
        except ValueError as error:
            fail(error)
    try:
        viewer = open_viewer(shown, at_s)
    except OSError as error:
        fail(error)
    with viewer:
        if viewer.url is not None:
            notes.print(f"Open {viewer.url} in a browser; Ctrl-C ends the viewer.", soft_wrap=True)
        try:
            viewer.wait()
        except KeyboardInterrupt:
            notes.print("viewer closed")
