"""What `monitor` says where it can't show: a port in use, no display, no driver."""

import os
import signal
import socket
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from utank_hil.cli import app
from utank_hil.console.exit_codes import ExitCode
from utank_hil.nodes.signals import SIGNALS
from utank_hil.telemetry import live, viewer
from utank_hil.telemetry.recording import write_recording
from utank_hil.telemetry.ring import RowWriter

pytestmark = pytest.mark.slow


@pytest.fixture
def recording(tmp_path: Path) -> Path:
    file = tmp_path / "run.rrd"
    write_recording(file, SIGNALS, {"run": np.zeros((3, len(SIGNALS)))})
    return file


@pytest.fixture
def taken() -> Iterator[socket.socket]:
    """A port where somebody else listens."""
    with socket.create_server((viewer.LOOPBACK, 0)) as other:
        yield other


def refused(*words: str) -> str:
    """What a command says before it ends, refused."""
    result = CliRunner().invoke(app, words)
    assert result.exit_code == ExitCode.USAGE
    assert isinstance(result.exception, SystemExit)  # no traceback
    return " ".join(result.stderr.split())


def test_a_port_that_was_taken_since_ends_the_viewer_with_the_remedy(
    monkeypatch: pytest.MonkeyPatch, recording: Path, taken: socket.socket
) -> None:
    for name in ("DISPLAY", "WAYLAND_DISPLAY"):
        monkeypatch.delenv(name, raising=False)
    ports = [taken.dup(), viewer.hold_port()]
    monkeypatch.setattr(viewer, "hold_port", lambda: ports.pop(0))
    said = refused("monitor", str(recording))
    assert "the viewer failed" in said
    assert f"if a port was in use, utank-hil monitor {recording} takes another" in said
    assert recording.exists()  # not for the viewer to lose


def test_a_stream_whose_port_was_taken_is_refused_instead_of_showing_nothing(
    monkeypatch: pytest.MonkeyPatch, taken: socket.socket
) -> None:
    monkeypatch.setattr(live, "hold_port", taken.dup)
    monkeypatch.setattr(os, "nice", lambda by: by)  # of the tests
    with RowWriter(SIGNALS):
        said = refused("monitor", str(os.getpid()))
    assert (
        f"port {viewer.port_of(taken)} of this machine was taken; start it again: it takes another"
        in said
    )


def test_where_no_window_can_be_the_page_and_the_remedy_are_named(recording: Path) -> None:
    process = subprocess.Popen(
        [sys.executable, "-c", "from utank_hil.cli import main; main()", "monitor", str(recording)],
        env=os.environ | {"DISPLAY": ":none", "VK_DRIVER_FILES": "/none"},
        stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
        text=True,
    )
    assert process.stderr is not None
    said = ""
    while "From another machine" not in said:
        line = process.stderr.readline()
        assert line, said
        said += line
    process.send_signal(signal.SIGINT)
    said += process.communicate()[1]
    assert process.returncode == ExitCode.OK
    assert "no window: the reason is above" in said
    assert "apt-get install mesa-vulkan-drivers" in said
    assert "Open http://127.0.0.1:" in said
    assert "Traceback" not in said
