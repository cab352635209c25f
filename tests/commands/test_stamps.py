from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest

from utank_hil.commands.stamps import claimed_files


def test_files_share_the_time_and_only_the_first_is_made(tmp_path: Path) -> None:
    first, second = claimed_files(tmp_path, "run-{}.rrd", "run-{}.yaml")
    assert first.exists()
    assert not second.exists()
    assert first.stem == second.stem


def test_many_at_once_each_get_their_own(tmp_path: Path) -> None:
    with ThreadPoolExecutor(8) as pool:
        files = list(pool.map(lambda _: claimed_files(tmp_path, "run-{}.rrd")[0], range(40)))
    assert len(set(files)) == 40


def test_name_whose_companion_is_there_is_taken(tmp_path: Path) -> None:
    _, second = claimed_files(tmp_path, "a-{}", "b-{}")
    second.touch()
    _, third = claimed_files(tmp_path, "c-{}", "b-{}")
    assert third != second


def test_folder_that_is_not_there_is_an_error(tmp_path: Path) -> None:
    with pytest.raises(OSError, match="missing"):
        claimed_files(tmp_path / "missing", "run-{}.rrd")
