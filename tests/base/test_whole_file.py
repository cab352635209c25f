"""Files are there whole or not at all, on a full disk too."""

from concurrent.futures import ThreadPoolExecutor
from datetime import datetime
from pathlib import Path

import numpy as np
import pytest
from little_room import ROOM, little_room

from utank_hil.base import whole_file
from utank_hil.base.whole_file import claimed_files, left_whole, write_whole
from utank_hil.pictures.report_page import write_report_page
from utank_hil.pictures.style import picture
from utank_hil.telemetry.recording import write_recording


def a_text(path):
    write_whole(path, "0123456789" * ROOM)


def a_recording(path):
    rows = np.random.default_rng(1).standard_normal((2000, 2))
    write_recording(path, ["time_s", "roll_rad"], {"passive": rows})


def a_picture(path):
    with picture(path, "Noise", (4.0, 3.0)) as figure:
        figure.add_subplot().plot(np.random.default_rng(1).standard_normal(500))


def a_page(path):
    write_report_page(path, "Storm", "seed 1", [], [])


@pytest.mark.parametrize("write", [a_text, a_recording, a_picture, a_page])
def test_what_does_not_fit_is_named_and_not_left_in_half(tmp_path, write):
    path = tmp_path / "file"
    write(path)
    assert path.stat().st_size > ROOM
    with little_room(), pytest.raises(OSError, match=str(path)):
        write(path)
    assert not path.exists()


def test_what_is_interrupted_is_not_left_in_half(tmp_path):
    path = tmp_path / "file"
    with pytest.raises(KeyboardInterrupt), left_whole(path):  # noqa: PT012
        path.write_text("ha")
        raise KeyboardInterrupt
    assert not path.exists()


def test_a_file_that_must_not_be_written_stays(tmp_path, monkeypatch):
    def refuse(_path, _content):
        raise PermissionError(13, "Permission denied")

    path = tmp_path / "page.html"
    path.write_text("mine")
    monkeypatch.setattr(Path, "write_bytes", refuse)
    with pytest.raises(PermissionError, match=str(path)):
        write_whole(path, "text")
    assert path.read_text() == "mine"


def test_a_full_device_stays_and_is_named():
    with pytest.raises(OSError, match="No space left on device: '/dev/full'"):
        write_whole(Path("/dev/full"), "text")
    assert Path("/dev/full").exists()


def test_files_share_the_time_and_are_made(tmp_path):
    first, second = claimed_files(tmp_path, "run-{}.rrd", "run-{}.yaml")
    assert first.exists()
    assert second.exists()
    assert first.stem == second.stem


@pytest.mark.parametrize("names", [("a-{}", "b-{}"), ("b-{}", "a-{}")])
def test_a_link_that_leads_nowhere_is_never_written_through(tmp_path, names, monkeypatch):
    class Still(datetime):
        @classmethod
        def now(cls, tz=None):
            return cls(2026, 1, 2, 3, 4, 5, tzinfo=tz)

    monkeypatch.setattr(whole_file, "datetime", Still)
    outside = tmp_path / "outside"
    (tmp_path / "a-20260102T030405Z").symlink_to(outside)
    files = claimed_files(tmp_path, *names)
    assert [file.name[2:] for file in files] == ["20260102T030405Z-2"] * 2
    assert not outside.exists()
    assert sorted(file.name for file in tmp_path.iterdir()) == sorted(
        ["a-20260102T030405Z", *(file.name for file in files)]
    )


def test_many_at_once_each_get_their_own(tmp_path):
    with ThreadPoolExecutor(8) as pool:
        files = list(pool.map(lambda _: claimed_files(tmp_path, "run-{}.rrd")[0], range(40)))
    assert len(set(files)) == 40


def test_name_whose_companion_is_there_is_taken(tmp_path):
    _, second = claimed_files(tmp_path, "a-{}", "b-{}")
    _, third = claimed_files(tmp_path, "c-{}", "b-{}")
    assert third != second


def test_folder_that_is_not_there_is_an_error(tmp_path):
    with pytest.raises(OSError, match="missing"):
        claimed_files(tmp_path / "missing", "run-{}.rrd")
