"""Runs that go on: found on this machine, and streamed to viewers, late ones too."""

import os
import shutil
import subprocess
import sys
import time
from pathlib import Path
from urllib.parse import urlsplit

import numpy as np
import pytest
import typer
from rerun.chunk import RrdReader
from rerun.error_utils import RerunWarning

from utank_hil.canbus import RetuningState
from utank_hil.canbus.events import RetuningEvent
from utank_hil.commands.monitor import _chosen
from utank_hil.nodes.signals import SIGNALS
from utank_hil.telemetry.events import EventWriter
from utank_hil.telemetry.live import LiveRun, LiveStream, live_runs
from utank_hil.telemetry.recording_reader import _chunks, read_about, read_recording
from utank_hil.telemetry.ring import RowWriter, ring_names
from utank_hil.telemetry.viewer import rerun_binary, rerun_environment

ABOUT = {
    "command": "run",
    "configuration": {
        "name": "a law",
        "vessel": {
            "tank": {"width_m": 17.0, "height_m": 5.0, "lz_m": 2.0, "headroom_m": 4.0},
            "pump": None,
        },
    },
}


def here():
    """The runs of this process: others may go on on the machine."""
    return [run for run in live_runs() if run.pid == os.getpid()]


def rows(first, count):
    values = np.zeros((count, len(SIGNALS)))
    values[:, SIGNALS.index("time_s")] = np.arange(first, first + count) / 100
    values[:, SIGNALS.index("roll_rad")] = np.sin(values[:, 0])
    return values


def listening(port):
    """Hexadecimal addresses on which somebody listens at a port, from the kernel's own table."""
    tables = (Path(f"/proc/net/{name}").read_text().splitlines()[1:] for name in ("tcp", "tcp6"))
    ends = [line.split() for table in tables for line in table]
    found = [address.split(":") for _, address, _, state, *_ in ends if state == "0A"]
    return {host for host, number in found if int(number, 16) == port}


def saved(url, file, seconds=20.0):
    """What a viewer that connects now has got, again and again."""
    viewer = subprocess.Popen([rerun_binary(), url, "--save", str(file)], env=rerun_environment())
    try:
        deadline = time.monotonic() + seconds
        while time.monotonic() < deadline:
            time.sleep(0.2)
            try:
                yield read_recording(file)["live"]
            except (FileNotFoundError, ValueError):  # nothing there yet
                continue
    finally:
        viewer.terminate()
        viewer.wait()


def test_a_run_is_found_by_its_ring_and_says_what_it_is():
    assert here() == []
    with RowWriter(SIGNALS, about=ABOUT) as ring, EventWriter() as events, RowWriter(["x"]):
        (run,) = here()
        assert run == LiveRun(ring.name, events.name, os.getpid(), ABOUT)
        assert str(run) == f"{os.getpid()}: run, a law"
    assert here() == []


def test_a_killed_run_is_none(tmp_path, monkeypatch):
    code = (
        "import time; from utank_hil.telemetry.ring import RowWriter;"
        "from utank_hil.nodes.signals import SIGNALS;"
        "ring = RowWriter(SIGNALS); print(ring.name, flush=True); time.sleep(60)"
    )
    process = subprocess.Popen([sys.executable, "-c", code], stdout=subprocess.PIPE, text=True)
    name = process.stdout.readline().strip()
    try:
        assert name in [run.ring for run in live_runs()]
        # as where the writer's tracker is killed too; in a directory of this test's own, because
        # every ring that some other process opens removes the left-over ones of /dev/shm
        shutil.copy(f"/dev/shm/{name}", tmp_path)
    finally:
        process.kill()
        process.communicate()
    monkeypatch.setattr("utank_hil.telemetry.ring._SHM", tmp_path)
    assert ring_names() == [name]
    assert live_runs() == []


def test_of_several_runs_one_is_chosen_by_its_number(capsys):
    runs = [LiveRun(f"ring-{pid}", None, pid, ABOUT) for pid in (11, 12)]
    assert _chosen(runs, 12) is runs[1]
    assert _chosen(runs[:1], None) is runs[0]
    for found, pid, said in (
        (runs, None, "utank-hil monitor 12: run, a law"),
        (runs, 13, "13: is no controller"),
        ([], None, "Start a controller: utank-hil run"),
    ):
        with pytest.raises(typer.Exit):
            _chosen(found, pid)
        assert said in capsys.readouterr().err


@pytest.mark.slow
def test_a_late_viewer_has_data_layout_events_and_what_comes(tmp_path):
    event = RetuningEvent(2_000_000_000, RetuningState.REFUSED, ("too short",))
    with RowWriter(SIGNALS, about=ABOUT) as ring, EventWriter() as events:
        for row in rows(0, 300):
            ring.write(row)
        events.write_event(event, 1_000_000_000)
        (run,) = here()
        with LiveStream(run) as stream:
            assert listening(urlsplit(stream.url).port) == {"0100007F"}
            assert stream.send()
            file, began, later = tmp_path / "late.rrd", time.monotonic(), 300
            for got in saved(stream.url, file):
                if later == 300:
                    assert time.monotonic() - began < 10.0  # starting the viewer's process included
                    np.testing.assert_allclose(got["roll_rad"], np.sin(got["time_s"]), atol=1e-12)
                if len(got["time_s"]) == 1000:
                    break
                if later < 1000:
                    for row in rows(later, 700):
                        ring.write(row)
                    later = 1000
                    assert stream.send()
            assert len(got["time_s"]) == 1000
            ring.close()
            assert not stream.send()
    name = "TextLog:text"
    log = [chunk.to_record_batch().column(name) for chunk in _chunks(file, name)]
    texts = [text for column in log for (text,) in column.to_pylist()]
    assert "retuning REFUSED: too short" in texts
    pictures = _chunks(file, "LineStrips2D:strips")
    assert any(chunk.entity_path == "/1/live/scene/ship/water" for chunk in pictures)
    with pytest.warns(RerunWarning, match="no footer"):
        assert len(RrdReader(file).blueprints()) == 1
    assert read_about(file) == ABOUT
