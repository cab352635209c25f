from concurrent.futures import ThreadPoolExecutor
from datetime import datetime, tzinfo
from pathlib import Path

import pytest

from utank_hil.base import stamps
from utank_hil.base.whole_file import claimed_files


def test_files_share_the_time_and_are_made(tmp_path: Path) -> None:
    first, second = claimed_files(tmp_path, "run-{}.rrd", "run-{}.yaml")
    assert first.exists()
    assert second.exists()
    assert first.stem == second.stem


@pytest.mark.parametrize("names", [("a-{}", "b-{}"), ("b-{}", "a-{}")])
def test_a_link_that_leads_nowhere_is_never_written_through(
    tmp_path: Path, names: tuple[str, str], monkeypatch: pytest.MonkeyPatch
) -> None:
    class Still(datetime):
        @classmethod
        def now(cls, tz: tzinfo | None = None) -> "Still":
            return cls(2026, 1, 2, 3, 4, 5, tzinfo=tz)

    monkeypatch.setattr(stamps, "datetime", Still)
    outside = tmp_path / "outside"
    (tmp_path / "a-20260102T030405Z").symlink_to(outside)
    files = claimed_files(tmp_path, *names)
    assert [file.name[2:] for file in files] == ["20260102T030405Z-2"] * 2
    assert not outside.exists()
    assert sorted(file.name for file in tmp_path.iterdir()) == sorted(
        ["a-20260102T030405Z", *(file.name for file in files)]
    )


def test_many_at_once_each_get_their_own(tmp_path: Path) -> None:
    with ThreadPoolExecutor(8) as pool:
        files = list(pool.map(lambda _: claimed_files(tmp_path, "run-{}.rrd")[0], range(40)))
    assert len(set(files)) == 40


def test_name_whose_companion_is_there_is_taken(tmp_path: Path) -> None:
    _, second = claimed_files(tmp_path, "a-{}", "b-{}")
    _, third = claimed_files(tmp_path, "c-{}", "b-{}")
    assert third != second


def test_folder_that_is_not_there_is_an_error(tmp_path: Path) -> None:
    with pytest.raises(OSError, match="missing"):
        claimed_files(tmp_path / "missing", "run-{}.rrd")
