from pathlib import Path
from types import CodeType
from typing import Any

import pytest

from tools.evidence.sources import ROOT
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


@pytest.mark.parametrize("target", TARGETS, ids=lambda target: target.file)
def test_what_is_explained_is_a_mutant_and_every_test_file_is_there(target: Target) -> None:
    _, mutants = mutants_of(ROOT / target.file)
    keys = {mutant.key for mutant in mutants}
    assert NO_DIFFERENCE.get(target.file, {}).keys() <= keys
    for file in (*target.tests, *target.behind):
        assert (ROOT / file).is_file(), file
