"""The Rerun viewer for a recording or a live stream, on this machine only."""

import importlib.util
import os
import socket
import subprocess
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path
from typing import Final
from urllib.parse import quote, urlsplit

from utank_hil.base.closing import Closing

TIMELINE: Final = "time"  #: Name of the time line of all recordings.
_TRIES, _PAUSE_S = 20, 0.5
"""Number and interval of requests to a starting viewer to move its cursor: ten seconds in all."""
LOOPBACK: Final = "127.0.0.1"  #: Where viewers listen; Rerun's own default is every interface.


class Viewer(Closing):
    """A running viewer, made by `open_viewer`."""

    def __init__(
        self,
        process: subprocess.Popen[bytes],
        held: Sequence[socket.socket],
        url: str | None = None,
        ports: tuple[int, ...] = (),
    ) -> None:
        self._process = process
        self._held = held
        self.url = url  #: Address for a browser; None if the viewer has its own window.
        self.ports = ports  #: Ports on loopback that such a browser needs.

    def wait(self, longest_s: float) -> bool:
        """Wait for the end of the viewer, in a browser by `close`, and return whether it ended."""
        with suppress(subprocess.TimeoutExpired):
            self._process.wait(longest_s)
        return self._process.poll() is not None

    @property
    def failed(self) -> bool:
        """Whether the viewer ended by an error, for example without a graphics driver."""
        return (self._process.poll() or 0) > 0

    def close(self) -> None:
        """End the viewer; idempotent."""
        self._process.terminate()
        self._process.wait()
        for port in self._held:
            port.close()


def open_viewer(source: Path | str, at_s: float | None = None, *, window: bool = True) -> Viewer:
    """Show a recording or a live stream in a window, or in a browser if there is no display.

    In a browser it is served on loopback at `Viewer.url`, for this machine or an ssh tunnel.
    FileNotFoundError is raised if there is no such file. `source` is a file, or the `url` of a
    `LiveStream`; `at_s` the position of the cursor in a recording, by default its beginning;
    `window` says whether a window is allowed.
    """
    if isinstance(source, Path) and not source.is_file():
        raise FileNotFoundError(f"no recording {source}")
    command = [rerun_binary(), "--bind", LOOPBACK]
    held = [hold_port()]
    port = port_of(held[0])
    command += ["--port", str(port)]
    displays = (os.environ.get(name) for name in ("DISPLAY", "WAYLAND_DISPLAY"))
    if window and any(displays):
        viewer = Viewer(_started([*command, str(source)]), held)
        if at_s is not None:
            _move_cursor(viewer, port, at_s)
        return viewer
    held.append(hold_port())  # Rerun 0.41 may hang if the page's port is taken.
    page_port = port_of(held[1])
    command += ["--serve-web", "--web-viewer-port", str(page_port), str(source)]
    data = live_url(port) if isinstance(source, Path) else source
    when = "" if at_s is None else f"#when=time@{at_s:g}s"
    url = f"http://{LOOPBACK}:{page_port}?url={quote(data + when, safe='')}"
    data_port = urlsplit(data).port
    assert data_port is not None
    return Viewer(_started(command), held, url, (page_port, data_port))


def _started(command: list[str]) -> subprocess.Popen[bytes]:
    return subprocess.Popen(command, env=rerun_environment(), stdin=subprocess.DEVNULL)


def _move_cursor(viewer: Viewer, port: int, at_s: float) -> None:
    """Move the time cursor of a starting viewer; without an answer it stays."""
    from rerun.experimental import ViewerClient

    for _ in range(_TRIES):
        if viewer.wait(_PAUSE_S):
            return
        with suppress(Exception):  # the viewer still shows its recording
            ViewerClient.connect(live_url(port)).set_time(TIMELINE, duration=at_s)
            return


def rerun_binary() -> str:
    """Return the viewer's executable; the `rerun` script would leave it running if killed."""
    package = importlib.util.find_spec("rerun_cli")
    if package is None or package.origin is None:
        raise ModuleNotFoundError("rerun is not installed", name="rerun")
    return str(Path(package.origin).with_name("rerun"))


def rerun_environment() -> dict[str, str]:
    """Return an environment without Rerun's analytics, and with warnings only in its log."""
    return os.environ | {"CI": "1", "RUST_LOG": "warn"}


def live_url(port: int) -> str:
    """Return the address of a live stream on a loopback port."""
    return f"rerun+http://{LOOPBACK}:{port}/proxy"


def hold_port() -> socket.socket:
    """Return a socket that holds a free TCP port of the loopback interface until it is closed.

    A server with SO_REUSEADDR, as Rerun's, may listen on it; the kernel gives it to no other
    socket.
    """
    held = socket.socket()
    held.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
    held.bind((LOOPBACK, 0))
    return held


def port_of(held: socket.socket) -> int:
    """Return the number of a socket's port."""
    port: int = held.getsockname()[1]
    return port
