"""A run on a SocketCAN interface is replayed exactly, and canplayer plays what is exported."""

import re
import subprocess
import time
from contextlib import closing
from itertools import takewhile
from pathlib import Path

import pytest
from busy_machine import first_that_can_be_judged
from two_processes import (
    CHANNEL,
    LINE,
    Candump,
    link_down,
    patient_controller,
    run_controller,
    run_ship,
    watched,
)

from utank_hil.console.exit_codes import ExitCode
from utank_hil.telemetry.bus_files.writing import write_frames
from utank_hil.telemetry.bus_logs import frames_of
from utank_hil.telemetry.frame_log import FrameLog, Kind
from utank_hil.telemetry.replay import entries_of, replay_log
from utank_hil.telemetry.replay_head import recorded_config

pytestmark = [pytest.mark.socketcan, pytest.mark.timeout(900)]

STORM = Path("configs/scenarios/storm.yaml")
KEPT = Path("tests/replay/every-mode.frames")
LISTENERS = Path("/proc/net/can/rcvlist_all")
PLAYED_NS = 2_500_000_000


def driven(folder):
    """The frame log of a run in which the pump was driven, and then the interface was down."""
    with (
        watched() as watcher,
        run_ship(folder, STORM),
        run_controller(folder, patient_controller(folder), "--out", folder) as controller,
    ):
        watcher.wait_in_charge(1e3)
        watcher.watch(2.0)
        with link_down():
            watcher.watch(0.3)
        watcher.watch(0.5)
        report, _ = controller.end(ExitCode.BUS_LOST)
    recording = report["recording"]
    assert isinstance(recording, dict)
    assert recording["records_lost"] == 0
    return Path(recording["file"])


def wait_for_listener():
    """Wait until candump's socket takes every frame."""
    deadline = time.monotonic() + 30.0
    while not re.search(rf"{CHANNEL}.*\braw\b", LISTENERS.read_text()):
        assert time.monotonic() < deadline
        time.sleep(0.02)


@pytest.mark.evidence
def test_a_run_between_two_processes_is_replayed_bit_for_bit(tmp_path):
    path = first_that_can_be_judged(driven, tmp_path)
    log = FrameLog(path)
    kinds = {entry.kind for entry in entries_of(log.blocks())}
    assert {Kind.STARTED, Kind.LINK_ERROR, Kind.STOP} <= kinds
    with recorded_config(log.head) as config:
        result, why, law = replay_log(log, config, path.parent)
    assert (why, law.why_not_recorded, law.differences) == ([], "", [])
    assert result.first is None, result.first
    assert result.ticks > 250
    assert result.frames > 200
    assert log.cut == ""


def test_canplayer_puts_an_exported_log_on_the_bus_frame_by_frame(tmp_path):
    entries = list(entries_of(FrameLog(KEPT).blocks()))
    first = list(takewhile(lambda entry: entry.time_ns < PLAYED_NS, entries))
    file = tmp_path / "kept.log"
    write_frames(file, frames_of(first))
    with closing(Candump(tmp_path)):
        wait_for_listener()
        player = subprocess.run(
            ["canplayer", "-I", str(file), f"{CHANNEL}=can0"],
            capture_output=True, text=True, timeout=60, check=False,
        )  # fmt: skip
        assert player.returncode == 0, player.stderr
    heard = [
        (int(parts["id"], 16), bytes.fromhex(parts["data"]))
        for line in (tmp_path / "candump.log").read_text().splitlines()
        if (parts := re.fullmatch(LINE, line))
    ]
    assert heard == [
        (number, data) for number, data, kind, _ in first if kind in (Kind.RECEIVED, Kind.SENT)
    ]
