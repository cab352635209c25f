"""What `monitor` says where it can't show: a port in use, no display, no driver."""

import json
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

from utank_hil.canbus.enumerations import Fault, Mode
from utank_hil.cli import app
from utank_hil.console.exit_codes import ExitCode
from utank_hil.nodes.signals import SIGNALS
from utank_hil.telemetry import live, viewer
from utank_hil.telemetry.frame_log import EVENTS, ROWS, FrameLogWriter
from utank_hil.telemetry.recording import write_recording
from utank_hil.telemetry.recording_reader import _chunks, read_recording
from utank_hil.telemetry.ring import RowWriter
from utank_hil.telemetry.run_log import _packed

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
    assert "if a port was in use, another start takes another" in said
    assert recording.exists()  # not for the viewer to lose


def test_the_log_of_a_run_is_shown_as_a_recording_where_something_happens(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    rows = np.zeros((100, len(SIGNALS)))
    rows[:, SIGNALS.index("time_s")] = np.arange(100)
    rows[60:, SIGNALS.index("mode")] = Mode.FAULT
    rows[60:, SIGNALS.index("fault")] = Fault.LEVEL_LIMIT
    alarm = {"time_ns": 60_000_000_000, "code": int(Fault.LEVEL_LIMIT), "state": None, "mode": 4}
    with FrameLogWriter(tmp_path / "run-a.frames", {"about": {}, "columns": SIGNALS}) as log:
        log.append(ROWS, _packed(rows))
        log.append(EVENTS, json.dumps([alarm]).encode())
    shown: list[object] = []

    def watched(source: Path, at_s: float, json_: bool) -> None:
        chunks = _chunks(source, "TextLog:text")
        found = [chunk.to_record_batch().column("TextLog:text") for chunk in chunks]
        texts = [text for each in found for (text,) in each.to_pylist()]
        run = read_recording(source)["run"]["fault"]
        shown.extend([source.name, at_s, run.tolist(), any("REFUSED" in text for text in texts)])

    monkeypatch.setattr("utank_hil.commands.monitor.watch", watched)
    result = CliRunner().invoke(app, ["monitor", str(tmp_path / "run-a.frames")])
    assert result.exit_code == 0, result.output
    assert shown == ["run-a.rrd", 60.0, rows[:, SIGNALS.index("fault")].tolist(), True]
    assert [path.name for path in tmp_path.iterdir()] == ["run-a.frames"]


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


class Page:
    """In place of a viewer: one that is served, and closed at once."""

    url, ports, failed = "http://127.0.0.1:9?url=x", (9, 10), False

    def __enter__(self):
        return self

    def __exit__(self, *_):
        pass

    def wait(self, longest_s):
        return True


def test_the_address_for_a_browser_is_one_json_object(
    monkeypatch: pytest.MonkeyPatch, recording: Path
) -> None:
    monkeypatch.setattr(viewer, "open_viewer", lambda *_, **__: Page())
    result = CliRunner().invoke(app, ["monitor", str(recording), "--json"])
    assert result.exit_code == 0
    assert json.loads(result.stdout) == {"url": Page.url, "ports": [9, 10], "at_s": 0.0}
    monkeypatch.setattr(Page, "url", None)  # a window
    result = CliRunner().invoke(app, ["monitor", str(recording), "--json"])
    assert json.loads(result.stdout)["url"] is None


@pytest.mark.usefixtures("one_process")
def test_a_bench_is_shown_when_it_has_ended(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    shown: list[Path] = []
    monkeypatch.setattr("firmware_sim.commands.bench.watch", shown.append)
    still = "configs/scenarios/still_water.yaml"
    words = ["bench", still, "--duration", "1", "--view", "--json", "--out", str(tmp_path)]
    result = CliRunner().invoke(app, words)
    assert shown == [tmp_path / "bench.rrd"], result.output
    json.loads(result.stdout)


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
