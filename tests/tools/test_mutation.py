import json
import subprocess
from pathlib import Path
from types import CodeType
from typing import Any

import pytest

from tools.evidence.sources import ROOT
from tools.mutation import changes
from tools.mutation.mutants import mutants_of
from tools.mutation.targets import NO_DIFFERENCE, TARGETS, Target

SOURCE = '''
"""A docstring is no statement."""
LIMIT: float = 2.0


def limited(value: float, most: int = 3) -> float:
    """Nor is this."""
    if value > LIMIT and not most == 0:
        value -= min(value, 1.5)
    return -value
'''


def changes_of(source: str, tmp_path: Path) -> list[tuple[str, str, str]]:
    file = tmp_path / "mutated.py"
    file.write_text(source, encoding="utf-8")
    _, mutants = mutants_of(file)
    return [(mutant.where, mutant.before, mutant.after) for mutant in mutants]


def test_every_kind_of_change_is_made_once(tmp_path: Path) -> None:
    condition = "if value > LIMIT and (not most == 0):"
    difference = "value -= min(value, 1.5)"
    assert sorted(changes_of(SOURCE, tmp_path)) == sorted([
        ("", "LIMIT: float = 2.0", "LIMIT: float = 2.5"),
        ("limited", "def limited(value: float, most: int=3) -> float:",
         "def limited(value: float, most: int=4) -> float:"),
        *(("limited", condition, changed) for changed in (
            "if True:",
            "if False:",
            "if value > LIMIT or not most == 0:",
            "if not most == 0:",
            "if value > LIMIT:",
            "if value >= LIMIT and (not most == 0):",
            "if value <= LIMIT and (not most == 0):",
            "if value > LIMIT and most == 0:",
            "if value > LIMIT and (not most != 0):",
            "if value > LIMIT and (not most == 1):",
        )),
        *(("limited", difference, changed) for changed in (
            "", "value += min(value, 1.5)", "value -= max(value, 1.5)",
            "value -= min(value, 1.875)",
        )),
        *(("limited", "return -value", changed) for changed in ("", "return None", "return value")),
    ])  # fmt: skip


def test_code_is_changed_and_the_file_is_not(tmp_path: Path) -> None:
    file = tmp_path / "mutated.py"
    file.write_text(SOURCE, encoding="utf-8")
    unchanged, mutants = mutants_of(file)

    def answers(code: CodeType) -> list[float]:
        scope: dict[str, Any] = {}
        exec(code, scope)
        return [scope["limited"](value, 1) for value in (1.0, 2.0, 3.0)]

    assert answers(unchanged) == [-1.0, -2.0, -1.5]
    changed = {mutant.after: mutant.code for mutant in mutants}
    assert answers(changed["if True:"]) == [-0.0, -0.5, -1.5]
    assert answers(changed["if value <= LIMIT and (not most == 0):"]) == [-0.0, -0.5, -3.0]
    assert answers(changed["return value"]) == [1.0, 2.0, 1.5]
    assert answers(changed["value -= max(value, 1.5)"]) == [-1.0, -2.0, -0.0]
    assert file.read_text(encoding="utf-8") == SOURCE


@pytest.mark.evidence
@pytest.mark.parametrize("target", TARGETS, ids=lambda target: target.file)
def test_what_is_explained_is_a_mutant_and_every_test_file_is_there(target: Target) -> None:
    _, mutants = mutants_of(ROOT / target.file)
    keys = {mutant.key for mutant in mutants}
    assert NO_DIFFERENCE.get(target.file, {}).keys() <= keys
    for file in (*target.tests, *target.behind):
        assert (ROOT / file).is_file(), file


def test_mutants_of_equal_words_are_told_apart(tmp_path: Path) -> None:
    file = tmp_path / "mutated.py"
    file.write_text("def f(x):\n    x += 1\n    x += 1\n", encoding="utf-8")
    keys = [mutant.key for mutant in mutants_of(file)[1]]
    assert len(set(keys)) == len(keys) == 6
    assert {"f: x += 1 -> x -= 1", "f: x += 1 -> x -= 1 (2)"} <= set(keys)


def test_what_runs_at_import_is_known(tmp_path: Path) -> None:
    file = tmp_path / "mutated.py"
    file.write_text(
        "def made():\n    return inner() + 1\n"
        "def inner():\n    return 2\n"
        "def later():\n    return made() + 3\n"
        "VALUE = made()\n",
        encoding="utf-8",
    )
    found = {mutant.where: mutant.at_import for mutant in mutants_of(file)[1]}
    assert found == {"made": True, "inner": True, "later": False}


@pytest.fixture
def judged_before(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> dict[str, Any]:
    """A repository with a file that evidence judged; its entry in the record."""
    monkeypatch.setattr(changes, "ROOT", tmp_path)
    monkeypatch.setattr(changes, "RECORD", tmp_path / "mutation.json")
    file = tmp_path / "mutated.py"
    file.write_text(SOURCE, encoding="utf-8")
    for words in (["init", "-q"], ["add", "."],
                  ["-c", "user.name=x", "-c", "user.email=x@x", "commit", "-qm", "x"]):  # fmt: skip
        subprocess.run(["git", *words], cwd=tmp_path, check=True)
    return {"file": "mutated.py", "blob": changes.blob_of("mutated.py"), "not_tried": []}


def not_judged_of(entry: dict[str, Any], source: str) -> set[str]:
    (changes.ROOT / "mutated.py").write_text(source, encoding="utf-8")
    changes.RECORD.write_text(json.dumps({"result": {"files": [entry]}}), encoding="utf-8")
    _, mutants = mutants_of(changes.ROOT / "mutated.py")
    return {mutant.key for mutant in changes.not_judged("mutated.py", mutants)}


def every_key() -> set[str]:
    return {mutant.key for mutant in mutants_of(changes.ROOT / "mutated.py")[1]}


def test_what_the_evidence_judged_is_not_tried_again(judged_before: dict[str, Any]) -> None:
    assert not_judged_of(judged_before, SOURCE) == set()
    assert not_judged_of(judged_before, SOURCE.replace('"""Nor is this."""', "# nor this")) == set()


def test_lines_changed_since_the_evidence_are_tried_however_many_commits_ago(
    judged_before: dict[str, Any],
) -> None:
    changed = SOURCE.replace("min(value, 1.5)", "min(value, 1.6)")
    (changes.ROOT / "mutated.py").write_text(changed, encoding="utf-8")
    for _ in range(2):
        subprocess.run(["git", "-c", "user.name=x", "-c", "user.email=x@x", "commit", "-qam", "y",
                        "--allow-empty"], cwd=changes.ROOT, check=True)  # fmt: skip
    found = not_judged_of(judged_before, changed)
    assert found == {key for key in every_key() if "value -= min(value, 1.6)" in key}
    assert len(found) == 4


def test_what_there_was_no_time_for_is_not_judged(judged_before: dict[str, Any]) -> None:
    key = "limited: return -value -> return value"
    assert not_judged_of({**judged_before, "not_tried": [key]}, SOURCE) == {key}


@pytest.mark.parametrize("other", [{"file": "other.py"}, {"blob": "0" * 40}])
def test_without_the_judged_code_nothing_is_judged(
    judged_before: dict[str, Any], other: dict[str, str]
) -> None:
    assert not_judged_of({**judged_before, **other}, SOURCE) == every_key()


def test_without_evidence_nothing_is_judged(judged_before: dict[str, Any]) -> None:
    _, mutants = mutants_of(changes.ROOT / "mutated.py")
    assert changes.not_judged("mutated.py", mutants) == mutants
