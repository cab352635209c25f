"""Results of before are kept, and two commands at once never mix theirs."""

import fcntl
import os
import subprocess
import sys
from pathlib import Path

import pytest
import typer
from typer.testing import CliRunner

from utank_hil.console.common import prepare_out

app = typer.Typer()


@app.command()
def write(out: Path, keep: bool = True) -> None:
    folder = prepare_out(out, ("a.txt", "b.txt"), keep=keep)
    (folder / "a.txt").write_text("new")
    typer.echo(folder)


def written(*words: object) -> str:
    result = CliRunner().invoke(app, [str(word) for word in words])
    assert result.exit_code == 0, result.output
    return str(result.stdout).strip()


def test_a_second_command_writes_beside_the_first(tmp_path: Path) -> None:
    out = tmp_path / "out"
    assert [written(out) for _ in range(3)] == [str(out), f"{out}-2", f"{out}-3"]
    (out / "a.txt").unlink()
    assert written(out) == str(out)


def test_other_files_in_the_folder_do_no_harm(tmp_path: Path) -> None:
    (tmp_path / "tank.json").touch()
    assert written(tmp_path) == str(tmp_path)


def test_a_folder_in_which_another_command_writes_is_left_to_it(tmp_path: Path) -> None:
    out = tmp_path / "out"
    out.mkdir()
    other = os.open(out, os.O_RDONLY)
    fcntl.flock(other, fcntl.LOCK_EX)
    assert written(out) == f"{out}-2"
    refused = CliRunner().invoke(app, [str(out), "--no-keep"])
    assert refused.exit_code == 2
    assert "another command writes there" in refused.stderr
    os.close(other)
    assert written(out) == str(out)
    assert written(out, "--no-keep") == str(out)


def test_the_working_folder_has_a_name_too(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    home = tmp_path / "home"
    home.mkdir()
    monkeypatch.chdir(home)
    assert written(".") == "."
    assert (tmp_path / "home-2").is_dir() is False
    assert Path(written(".")).resolve() == tmp_path / "home-2"


ENDED = """
import sys
from pathlib import Path
from utank_hil.console.common import prepare_out
folder = prepare_out(Path(sys.argv[1]), ("a.txt",))
if len(sys.argv) > 2:
    (folder / sys.argv[2]).touch()
raise KeyboardInterrupt
"""


def test_a_command_that_ends_early_leaves_no_empty_folder(tmp_path: Path) -> None:
    def ended(*words: object) -> None:
        asked = [sys.executable, "-c", ENDED, *map(str, words)]
        assert subprocess.run(asked, stderr=subprocess.DEVNULL, check=False).returncode != 0

    (tmp_path / "mine").mkdir()
    ended(tmp_path / "mine" / "new" / "deep")
    ended(tmp_path / "mine")
    ended(tmp_path / "held" / "deep", "b.txt")
    left = sorted(str(each.relative_to(tmp_path)) for each in tmp_path.rglob("*"))
    assert left == ["held", "held/deep", "held/deep/b.txt", "mine"]


def test_a_folder_whose_name_no_result_can_hold_is_refused_first(tmp_path: Path) -> None:
    """As one of an old disk, in ISO 8859-1."""
    folder = os.fsdecode(os.fsencode(tmp_path) + b"/Schl\xfcssel")
    result = CliRunner().invoke(app, [folder])
    assert result.exit_code == 2
    assert "is no UTF-8 here" in result.stderr
    assert not os.path.exists(folder)
