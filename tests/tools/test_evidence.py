"""The evidence of a release: what is run, what is kept of it, and when it is run again."""

import json
import shlex
from importlib.metadata import version
from pathlib import Path

import pytest

from tools import evidence
from tools.evidence import PARTS, Part, PartError, main, read, run


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """A folder of records of its own."""
    monkeypatch.setattr(evidence, "FOLDER", tmp_path)
    return tmp_path


def test_every_study_and_benchmark_is_a_part_and_every_part_is_of_a_module_that_is_there():
    commands = " ".join(part.command for part in PARTS.values())
    for pattern in ("studies/*", "benchmarks/*"):
        for file in Path("tools").glob(f"{pattern}.py"):
            if '\nif __name__ == "__main__":' in file.read_text():
                assert f"tools.{file.parent.name}.{file.stem} " in commands
    for part in PARTS.values():
        words = shlex.split(part.command)
        if words[0] == "python":
            place = Path(words[2].replace(".", "/"))
            assert place.with_suffix(".py").is_file() or (place / "__main__.py").is_file()


def test_a_record_says_what_was_run_where_and_when(folder):
    run("toy", Part("python -c 'print([3])'", 1))
    kept = read("toy")
    assert (kept["result"], kept["version"]) == ([3], version("utank-hil"))
    assert kept["command"] == "python -c 'print([3])'"
    assert kept["machine"]["cores"] >= 1
    run("words", Part("python -c 'print(\"no object\")'", 1))
    assert read("words")["result"] == ["no object"]


def test_a_part_that_fails_keeps_the_record_that_was_there(folder, tmp_path, monkeypatch):
    run("toy", Part("python -c 'print(3)'", 1))
    monkeypatch.setattr(evidence, "ROOT", tmp_path)
    with pytest.raises(PartError, match="exit code 2"):
        run("toy", Part("python -c 'print(4); raise SystemExit(2)'", 1))
    assert read("toy")["result"] == 3
    assert (tmp_path / ".cache/evidence/toy.out").read_text() == "4\n"


def test_only_what_this_release_has_not_is_run_and_what_is_named(folder, monkeypatch, capsys):
    parts = {name: Part(f"python -c 'print(\"{name}\")'", 1) for name in ("a", "b")}
    monkeypatch.setattr(evidence, "PARTS", parts)
    (folder / "a.json").write_text(json.dumps({"version": "0.0.1", "date": "2026-01-01"}))
    run("b", parts["b"])
    before = (folder / "b.json").stat().st_mtime_ns
    assert main([]) == 0
    assert read("a")["version"] == version("utank-hil")
    assert (folder / "b.json").stat().st_mtime_ns == before
    assert main(["b"]) == 0
    assert (folder / "b.json").stat().st_mtime_ns > before
    assert main(["--list"]) == 0
    assert version("utank-hil") in capsys.readouterr().out
    with pytest.raises(SystemExit):
        main(["nothing"])
