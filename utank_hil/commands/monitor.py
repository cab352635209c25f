"""``utank-hil monitor``: shows a recording, or a running controller."""

import os
import sys
from collections.abc import Callable
from contextlib import ExitStack
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Annotated, Final

from utank_hil.console.common import Json, argument, fail, failing, print_json
from utank_hil.console.terminal import notes, say_note
from utank_hil.telemetry.frame_log import SUFFIX

if TYPE_CHECKING:
    from utank_hil.telemetry.live import LiveRun
    from utank_hil.telemetry.viewer import Viewer

LIVE: Final = "rerun+http://"  #: Beginning of the address of a live stream.
LOOKS: Final = "&theme=dark&hide_welcome_screen&notebook=0&persist=0"
"""Options of the viewer in a browser: a dark ground that suits the colours, and no menus."""
_LOOK_S: Final = 0.25  #: Time between two reads of the ring, short enough to appear smooth.
_NICENESS: Final = 5  #: Below what controls, above idle.


def monitor(
    source: Annotated[
        str | None,
        argument(
            "A log of a run (.frames), a bench's recording (.rrd) or folder, the process "
            "number of a run, or the address of a stream.",
            default="the controller or bench in real time that runs on this machine",
        ),
    ] = None,
    json_: Json = False,
) -> None:
    """Show ship, tank and alarms in the viewer: the first tab for the watch, others for engineers.

    Without a source it attaches to what runs on this machine, which does not notice. A recording
    opens where something happens: at the first fault, else where a new law was tried, else at the
    largest roll. Without a display the viewer is served on loopback for a browser; how to reach it
    from another machine by ssh is printed; with --json, so is the address, as soon as it is served.

    **Example:** utank-hil monitor out
    """
    from utank_hil.base.text_files import where_instead
    from utank_hil.telemetry.highlight import highlight_s
    from utank_hil.telemetry.live import LiveStream, live_runs
    from utank_hil.telemetry.recording import write_recording
    from utank_hil.telemetry.recording_reader import read_recording
    from utank_hil.telemetry.run_log import read_run_log

    if source is not None and source.startswith(LIVE):
        watch(source, json_=json_)
        return
    with failing(OSError, ValueError):
        if source is None or source.isdecimal():
            os.nice(_NICENESS)  # A loop may run on this machine.
            with LiveStream(
                _chosen(live_runs(), None if source is None else int(source))
            ) as stream:
                watch(stream.url, send=stream.send, json_=json_)
            return
        file = Path(source) / "bench.rrd" if Path(source).is_dir() else Path(source)
        if not file.is_file():
            named = f"give a recording, a bench's folder, or {LIVE}...; {where_instead(file)}"
            fail(f"{file}: is not there; {named}")
        if file.suffix != SUFFIX:
            watch(file, highlight_s([*read_recording(file).values()]), json_=json_)
            return
        log = read_run_log(file, say_note)
        with TemporaryDirectory() as folder:
            shown = Path(folder) / file.with_suffix(".rrd").name
            runs, events = {"run": log.rows}, {"run": log.events}
            write_recording(shown, log.columns, runs, events, log.about)
            watch(shown, highlight_s([log.signals]), json_=json_)


def watch(
    source: Path | str,
    at_s: float | None = None,
    send: Callable[[], bool] | None = None,
    *,
    json_: bool = False,
) -> None:
    """Show a recording or a stream, as `open_viewer`, until the viewer is closed or Ctrl-C.

    `send` sends new data, and returns whether more may come. With `json_` the address for a browser
    is printed as JSON, null if the viewer has its own window.
    """
    from utank_hil.runners import stop_on_signals
    from utank_hil.telemetry.viewer import open_viewer

    with stop_on_signals() as stopped, ExitStack() as stack:
        viewer = _said(stack.enter_context(open_viewer(source, at_s)), at_s, json_)
        while not stopped():
            if send is not None and not send():
                send = None
                notes.say("the run has ended; the viewer keeps what it has got")
            if not viewer.wait(_LOOK_S) or stopped():
                continue
            if not viewer.failed:
                break
            if viewer.url is not None:
                said = "if a port was in use, another start takes another"
                fail(f"the viewer failed; what it says is above; {said}")
            notes.say(
                "the reason is above; a graphics driver for any machine: "
                "apt-get install mesa-vulkan-drivers",
                yellow="no window:",
            )
            page = stack.enter_context(open_viewer(source, at_s, window=False))
            viewer = _said(page, at_s, json_)
    if json_ and viewer.url is None:
        _print_address(viewer, at_s)
    notes.say("viewer closed")


def _print_address(viewer: "Viewer", at_s: float | None) -> None:
    print_json({"url": viewer.url, "ports": viewer.ports, "at_s": at_s})
    sys.stdout.flush()  # a script that reads from a pipe opens the address now


def _said(viewer: "Viewer", at_s: float | None, json_: bool) -> "Viewer":
    if viewer.url is not None:
        if json_:
            _print_address(viewer, at_s)
        tunnel = " ".join(f"-L {port}:127.0.0.1:{port}" for port in viewer.ports)
        notes.say(
            f"Open {viewer.url}{LOOKS} in a browser; Ctrl-C ends the viewer.\n"
            f"From another machine first: ssh {tunnel} THIS_MACHINE"
        )
        if at_s is not None:
            # Rerun 0.41 moves the cursor of a page neither by its address nor by a layout.
            notes.say(f"Something happens at {at_s:.1f} s: type it into the field at the bottom.")
    return viewer


def _chosen(runs: "list[LiveRun]", pid: int | None) -> "LiveRun":
    found = [run for run in runs if pid in (None, run.pid)]
    if not found and pid is None:
        fail(
            "nothing runs here that this user may see. Start a controller: utank-hil run "
            "CONFIG.yaml --bus can0; or a bench: utank-hil bench --realtime; or name a recording"
        )
    if not found:
        fail(f"{pid}: is no controller or bench that runs here and that this user may see")
    if len(found) > 1:
        lines = "".join(f"\n  utank-hil monitor {run}" for run in found)
        fail(f"several run here; choose one by its number:{lines}")
    return found[0]
