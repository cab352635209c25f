"""The log of a run: JSON lines with both clocks, in plain words."""

import json
import os
import resource
import time
from datetime import UTC, datetime, timedelta
from pathlib import Path

import pytest

from utank_hil.canbus import AlarmState, Fault, Mode, RetuningState
from utank_hil.canbus.events import AlarmEvent, RetuningEvent
from utank_hil.commands.announcer import log_event
from utank_hil.safety.faults import FAULTS


def test_events_are_lines_with_both_clocks_and_words(tmp_path: Path) -> None:
    file = tmp_path / "log.jsonl"
    log = file.open("ab", buffering=0)
    start_ns = time.monotonic_ns() - 5_000_000_000
    row = FAULTS[0]
    log_event(
        log,
        AlarmEvent(2_000_000_000, row.code, AlarmState.ACTIVE_ACKNOWLEDGED, Mode.FAULT),
        start_ns,
    )
    log_event(log, AlarmEvent(3_000_000_000, row.code, None, Mode.FAULT), start_ns)
    log_event(log, RetuningEvent(4_000_000_000, RetuningState.REFUSED, ("größer",)), start_ns)
    lines = [json.loads(line) for line in file.read_text(encoding="utf-8").splitlines()]
    log.close()
    assert [line["event"] for line in lines] == ["alarm", "reset refused", "retuning"]
    assert [line["time_s"] for line in lines] == [2.0, 3.0, 4.0]
    assert [line["monotonic_ns"] - start_ns for line in lines] == [2e9, 3e9, 4e9]
    for line in lines:
        age = datetime.now(UTC) - datetime.fromisoformat(line["utc"])
        assert abs(age - timedelta(seconds=5 - line["time_s"])) < timedelta(seconds=1)
    assert lines[0]["state"] == "ACTIVE_ACKNOWLEDGED"
    assert (lines[0]["fault"], lines[0]["code"], lines[0]["mode"]) == (
        row.code.name, int(row.code), "FAULT",
    )  # fmt: skip
    assert (lines[0]["happened"], lines[0]["remedy"]) == (row.happened, row.remedy)
    assert lines[2]["reasons"] == ["größer"]
    assert lines[2]["state"] == "REFUSED"


def test_each_line_is_on_the_disk_before_the_next(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    synced: list[int] = []
    monkeypatch.setattr(os, "fsync", lambda _: synced.append(file.stat().st_size))
    file = tmp_path / "log.jsonl"
    log = file.open("ab", buffering=0)
    for _ in range(3):
        log_event(log, AlarmEvent(0, Fault.DRIFT, AlarmState.NORMAL, Mode.STANDBY), 0)
    log.close()
    size = file.stat().st_size // 3
    assert synced[-3:] == [size, 2 * size, 3 * size]


def test_a_code_without_a_row_is_logged_by_its_name(tmp_path: Path) -> None:
    without = next(code for code in Fault if code not in {row.code for row in FAULTS})
    log = (tmp_path / "log.jsonl").open("ab", buffering=0)
    log_event(log, AlarmEvent(0, without, AlarmState.NORMAL, Mode.STANDBY), 0)
    log.close()
    assert json.loads((tmp_path / "log.jsonl").read_text())["fault"] == without.name


def test_a_full_disk_is_an_error_for_the_caller() -> None:
    event = AlarmEvent(0, Fault.LEVEL_LIMIT, AlarmState.NORMAL, Mode.STANDBY)
    with (
        Path("/dev/full").open("ab", buffering=0) as log,
        pytest.raises(OSError, match="No space left"),
    ):
        log_event(log, event, 0)


def test_a_line_that_fits_in_part_is_an_error_and_leaves_no_half_of_it(tmp_path: Path) -> None:
    file = tmp_path / "log.jsonl"
    log, event = (
        file.open("ab", buffering=0),
        AlarmEvent(0, Fault.LEVEL_LIMIT, AlarmState.NORMAL, Mode.STANDBY),
    )
    log_event(log, event, 0)
    for _ in range(2):
        before = resource.getrlimit(resource.RLIMIT_FSIZE)
        try:
            resource.setrlimit(resource.RLIMIT_FSIZE, (file.stat().st_size + 50, before[1]))
            with pytest.raises(OSError, match="File too large"):
                log_event(log, event, 0)
        finally:
            resource.setrlimit(resource.RLIMIT_FSIZE, before)
    log_event(log, event, 0)
    log.close()
    assert [json.loads(line)["code"] for line in file.read_text().splitlines()] == [event.code] * 2
