"""The viewer, where there is no display: served in the browser, to this machine only."""

import socket
import time
import urllib.error
import urllib.request
from pathlib import Path

import numpy as np
import pytest

from utank_hil.telemetry.recording import write_recording
from utank_hil.telemetry.viewer import hold_port, open_viewer, port_of


def fetch(url, seconds=20.0):
    deadline = time.monotonic() + seconds
    while True:
        try:
            with urllib.request.urlopen(url, timeout=seconds) as answer:
                content: bytes = answer.read()
                return content
        except urllib.error.URLError:
            assert time.monotonic() < deadline
            time.sleep(0.05)


@pytest.mark.slow
def test_without_a_display_the_viewer_is_a_page_on_loopback(tmp_path, monkeypatch):
    for name in ("DISPLAY", "WAYLAND_DISPLAY"):
        monkeypatch.delenv(name, raising=False)
    file = tmp_path / "a.rrd"
    write_recording(file, ["time_s", "roll_rad"], {"passive": np.zeros((3, 2))})
    with open_viewer(file) as viewer:
        assert viewer.url.startswith("http://127.0.0.1:")
        assert b"Rerun" in fetch(viewer.url)
        process = viewer._process
        sockets = {link.readlink().name for link in Path(f"/proc/{process.pid}/fd").iterdir()}
        table = Path(f"/proc/{process.pid}/net/tcp").read_text().splitlines()[1:]
        listening = [line.split() for line in table if line.split()[3] == "0A"]
        mine = {line[1][:8] for line in listening if f"socket:[{line[9]}]" in sockets}
        assert mine == {"0100007F"}
    viewer.close()
    assert process.poll() is not None


def test_a_port_that_is_held_is_for_a_server_of_ours_only():
    with hold_port() as held, socket.socket() as other:
        with pytest.raises(OSError, match="in use"):
            other.bind(held.getsockname())
        with socket.create_server(held.getsockname()) as server:
            assert port_of(server) == port_of(held)


def test_a_missing_file_is_named(tmp_path):
    with pytest.raises(FileNotFoundError, match=r"no\.rrd"):
        open_viewer(tmp_path / "no.rrd")
