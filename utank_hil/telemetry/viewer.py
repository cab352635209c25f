"""Opens the Rerun viewer on a recording or on a live stream, on this machine only."""

import importlib.util
import os
import socket
import subprocess
import time
from contextlib import suppress
from pathlib import Path
from typing import Final
from urllib.parse import quote

from utank_hil.closing import Closing

TIMELINE: Final = "time"
"""Of all recordings."""
_TRIES: Final = 20
_PAUSE_S: Final = 0.5
LOOPBACK: Final = "127.0.0.1"  # Rerun's own default is every interface


class Viewer(Closing):
    """A running viewer; `open_viewer` makes one.

    Attributes
    ----------
    url : str or None
        Address for a browser; None if the viewer has its own window.
    """

    def __init__(self, process: subprocess.Popen[bytes], url: str | None) -> None:
        self._process = process
        self.url = url

    def wait(self) -> None:
        """Wait until the user closes the window; forever if the viewer is in a browser."""
        self._process.wait()

    def close(self) -> None:
        """End the viewer; idempotent."""
        self._process.terminate()
        self._process.wait()


def open_viewer(source: Path | str, at_s: float | None = None) -> Viewer:
    """Show a recording or a live stream in a window, or in a browser if there is no display.

    Without a display the viewer is served on loopback at `Viewer.url`, for a browser on this
    machine or through an ssh tunnel.

    Parameters
    ----------
    source : Path or str
        A file, or the `url` of a `RecorderProcess`.
    at_s : float, optional
        Where the cursor of a recording shall stand; at its beginning if not given.

    Raises
    ------
    FileNotFoundError
        If there is no such file.
    """
    if isinstance(source, Path) and not source.is_file():
        raise FileNotFoundError(f"no recording {source}")
    command = [rerun_binary(), "--bind", LOOPBACK]
    port = None
    if os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY"):
        port = free_tcp_port()
        command += ["--port", str(port)]
        url = None
    else:
        data_port, page_port = free_tcp_port(), free_tcp_port()
        command += ["--serve-web", "--port", str(data_port), "--web-viewer-port", str(page_port)]
        data = live_url(data_port) if isinstance(source, Path) else source
        when = "" if at_s is None else f"#when=time@{at_s:g}s"
        url = f"http://{LOOPBACK}:{page_port}?url={quote(data + when, safe='')}"
    process = subprocess.Popen(
        [*command, str(source)], env=rerun_environment(), stdin=subprocess.DEVNULL
    )
    if port is not None and at_s is not None:
        _move_cursor(port, at_s)
    return Viewer(process, url)


def _move_cursor(port: int, at_s: float) -> None:
    """Move the time cursor of a viewer that is starting; if it does not answer, it stays."""
    from rerun.experimental import ViewerClient

    for _ in range(_TRIES):
        time.sleep(_PAUSE_S)
        with suppress(Exception):  # whatever the client raises: the viewer shows its recording
            ViewerClient.connect(live_url(port)).set_time(TIMELINE, duration=at_s)
            return


def rerun_binary() -> str:
    """Return the viewer's executable; the `rerun` script would leave it running if killed."""
    package = importlib.util.find_spec("rerun_cli")
    assert package is not None
    assert package.origin is not None
    return str(Path(package.origin).with_name("rerun"))


def rerun_environment() -> dict[str, str]:
    """Return an environment without Rerun's analytics, and with warnings only in its log."""
    return os.environ | {"CI": "1", "RUST_LOG": "warn"}


def live_url(port: int) -> str:
    """Return the address of a live stream that is served on a loopback port."""
    return f"rerun+http://{LOOPBACK}:{port}/proxy"


def free_tcp_port() -> int:
    """Return a free TCP port of the loopback interface."""
    with socket.socket() as probe:
        probe.bind((LOOPBACK, 0))
        port: int = probe.getsockname()[1]
        return port
