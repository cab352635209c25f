"""A long recording in several files, within a bound of the disk."""

import os
import time
from pathlib import Path
from tempfile import TemporaryDirectory

from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from utank_hil.telemetry.rotation import make_room, part_of, remove_oldest


@given(
    sizes=st.lists(st.integers(980, 1020), min_size=8, max_size=8),
    keep_bytes=st.integers(2200, 5000),
)
def test_the_parts_of_a_recording_stay_within_the_bound(sizes, keep_bytes):
    with TemporaryDirectory() as folder:
        file = Path(folder) / "run-a.frames"
        for number, size in enumerate(sizes, 1):
            make_room(file, number, keep_bytes)
            part = part_of(file, number)
            part.write_bytes(bytes(size))
            os.utime(part, ns=(number, number))
            left = [path.stat().st_size for path in file.parent.iterdir()]
            assert sum(left) <= keep_bytes
            assert sum(left) + 2 * 1050 > keep_bytes or len(left) == number


@settings(suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(sizes=st.lists(st.integers(0, 500), max_size=8), keep_bytes=st.integers(0, 2000))
def test_what_is_removed_is_the_oldest_and_no_more_than_needed(tmp_path, sizes, keep_bytes):
    for path in tmp_path.iterdir():
        path.unlink()
    files = []
    for age, size in enumerate(sizes):
        path = tmp_path / f"run-{len(sizes) - age}.frames"  # by time, not by name
        path.write_bytes(bytes(size))
        os.utime(path, ns=(age, age))
        files.append(path)
    apart = [tmp_path / name for name in ("bench-1.frames", "run-1.yaml", "run-now.frames")]
    for path in apart:
        path.write_bytes(bytes(3000))
    removed = remove_oldest(tmp_path / "run-now.frames", keep_bytes)
    left = [path for path in files if path.exists()]
    assert removed + left == files
    assert all(path.exists() for path in apart)
    total = sum(path.stat().st_size for path in left)
    assert total <= keep_bytes
    if removed:
        assert total + sizes[len(removed) - 1] > keep_bytes


def test_a_clock_that_was_set_back_does_not_cost_the_run_its_own_parts(tmp_path):
    """As at a start without a battery behind the clock: the new files look the oldest."""
    file = tmp_path / "run-20000101T000000Z.frames"
    before = tmp_path / "run-20261101T000000Z.frames"
    for path, time_s in ((before, 2e9), (file, 1e9), (part_of(file, 2), 1e9 + 3600)):
        path.write_bytes(bytes(1000))
        os.utime(path, (time_s, time_s))
    assert remove_oldest(part_of(file, 3), 2500) == [before]
    assert remove_oldest(part_of(file, 3), 1500) == [file]


def test_runs_of_a_computer_without_a_clock_are_removed_in_their_order(tmp_path, monkeypatch):
    """Each start begins in the year 2000; one run has had the time from the network."""
    starts = [2e9, 1e9, 1e9 + 5, 2.1e9, 1e9 + 1]
    for number, start_s in enumerate(starts):
        file = tmp_path / f"run-{9 - number}.frames"  # names tell nothing either
        monkeypatch.setattr(time, "time_ns", lambda now=start_s: int(now * 1e9))
        make_room(file, 1, 10_000)
        for part in (file, part_of(file, 2)):
            part.write_bytes(bytes(1000))
            os.utime(part, (start_s + 3600, start_s + 3600))
    removed = remove_oldest(tmp_path / "run-0.frames", 2000)
    assert [int(path.stem[4]) for path in removed] == [9, 9, 8, 8, 7, 7, 6, 6]


def test_recordings_of_an_earlier_version_count_and_are_removed(tmp_path):
    """It recorded a run into a file of frames and one of Rerun."""
    old = [tmp_path / "run-1.frames", tmp_path / "run-1.rrd", tmp_path / "run-1-part002.rrd"]
    for age, path in enumerate(old):
        path.write_bytes(bytes(1000))
        os.utime(path, ns=(age, age))
    (tmp_path / "bench-1.rrd").write_bytes(bytes(3000))
    assert remove_oldest(tmp_path / "run-2.frames", 1500) == old[:2]


def test_a_file_that_somebody_else_removes_meanwhile_ends_no_recording(tmp_path):
    """A link to nowhere is as such a file: it has a name, and nothing is known of it."""
    (tmp_path / "run-1.frames").symlink_to(tmp_path / "gone")
    old = tmp_path / "run-2.frames"
    old.write_bytes(bytes(1000))
    assert remove_oldest(tmp_path / "run-3.frames", 500) == [old]
