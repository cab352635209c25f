"""A long recording in several files, within a bound of the disk."""

import os
import time
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from rerun.chunk import RrdReader

from utank_hil.runtime.signals import SIGNALS
from utank_hil.telemetry.parts import RecordingParts
from utank_hil.telemetry.recorder import RecorderProcess, RecorderReport
from utank_hil.telemetry.recording import read_about, read_recording
from utank_hil.telemetry.ring import RingWriter
from utank_hil.telemetry.rotation import Rotation, remove_oldest

TIME = SIGNALS.index("time_s")


def rows(first: int, count: int) -> np.ndarray:
    """Rows of 10 ms."""
    values = np.zeros((count, len(SIGNALS)))
    values[:, TIME] = np.arange(first, first + count) / 100
    return values


def times(file: Path) -> list[float]:
    return read_recording(file)["live"]["time_s"].tolist()


def written(folder: Path, rotation: Rotation | None, batches: int = 7) -> list[Path]:
    """Files of a recording of batches of half a second, oldest first."""
    with RecordingParts(folder / "run-a.rrd", SIGNALS, rotation, about={"x": 1}) as parts:
        for batch in range(batches):
            parts.write(rows(50 * batch, 50))
            parts.flush()
    return sorted(folder.glob("*.rrd"), key=lambda file: file.stem)


@pytest.mark.slow
def test_no_row_is_lost_or_twice_between_files_and_each_can_be_opened_alone(tmp_path: Path) -> None:
    files = written(tmp_path, Rotation(part_s=1.0))
    assert [file.name for file in files] == [
        "run-a.rrd", "run-a-part002.rrd", "run-a-part003.rrd", "run-a-part004.rrd",
    ]  # fmt: skip
    found = [times(file) for file in files]
    assert [len(each) for each in found] == [100, 100, 100, 50]
    np.testing.assert_allclose(np.concatenate(found), np.arange(350) / 100)
    for file in files:
        RrdReader(file).store()  # needs the footer
        assert read_about(file) == {"x": 1}


@pytest.mark.slow
def test_without_rotation_there_is_one_file(tmp_path: Path) -> None:
    (file,) = written(tmp_path, None)
    assert len(times(file)) == 350


@pytest.mark.slow
def test_oldest_files_make_room_and_the_folder_stays_within_the_bound(tmp_path: Path) -> None:
    part_bytes = max(file.stat().st_size for file in written(tmp_path, Rotation(1.0), 2))
    for file in tmp_path.iterdir():
        file.unlink()
    other = tmp_path / "bench.rrd"
    other.write_bytes(bytes(10 * part_bytes))
    keep_bytes = 3 * part_bytes
    files = written(tmp_path, Rotation(1.0, keep_bytes), 20)
    mine = [file for file in files if file != other]
    assert other in files
    assert sum(file.stat().st_size for file in mine) <= keep_bytes
    assert mine[-1].name == "run-a-part010.rrd"
    assert len(mine) >= 2
    assert times(mine[-1])[-1] == pytest.approx(9.99)


@pytest.mark.slow
def test_a_rotating_recorder_tells_how_many_files_there_are_and_loses_nothing(
    tmp_path: Path,
) -> None:
    with RingWriter(SIGNALS) as ring:
        recorder = RecorderProcess(ring.name, tmp_path / "run-a.rrd", rotation=Rotation(0.4))
        sent = 0
        while not (tmp_path / "run-a-part002.rrd").exists():
            assert sent < 1000
            ring.write(rows(5 * sent, 1)[0])
            sent += 1
            time.sleep(0.05)
    report = recorder.stop()
    assert report == RecorderReport(sent, 0, len(list(tmp_path.iterdir())))
    assert report.parts >= 2
    assert sum(len(times(file)) for file in tmp_path.iterdir()) == sent


@settings(suppress_health_check=[HealthCheck.function_scoped_fixture], max_examples=40)
@given(
    sizes=st.lists(st.integers(0, 500), max_size=8),
    keep_bytes=st.integers(0, 2000),
)
def test_what_is_removed_is_the_oldest_and_no_more_than_needed(
    tmp_path: Path, sizes: list[int], keep_bytes: int
) -> None:
    for path in tmp_path.iterdir():
        path.unlink()
    files = []
    for age, size in enumerate(sizes):
        path = tmp_path / f"run-{len(sizes) - age}.rrd"  # by time, not by name
        path.write_bytes(bytes(size))
        os.utime(path, ns=(age, age))
        files.append(path)
    apart = [tmp_path / name for name in ("bench-1.rrd", "run-1.yaml", "run-now.rrd")]
    for path in apart:
        path.write_bytes(bytes(3000))
    removed = remove_oldest(tmp_path / "run-now.rrd", keep_bytes)
    left = [path for path in files if path.exists()]
    assert removed + left == files
    assert all(path.exists() for path in apart)
    total = sum(path.stat().st_size for path in left)
    assert total <= keep_bytes
    if removed:
        assert total + sizes[len(removed) - 1] > keep_bytes
