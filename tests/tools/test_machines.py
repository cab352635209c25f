"""The comparison of machines runs what is kept, and sees another bit."""

import json

import pytest

from tools import machines
from utank_hil.telemetry.law_values import decoded, encoded


@pytest.fixture
def kept(tool, monkeypatch, tmp_path):
    """Run 8 s of a scenario; exit code and the table's row. The first call makes kept.json."""
    monkeypatch.setattr(machines, "LOGS", tmp_path)  # the recordings have their own tests
    words = (str(tmp_path / "kept.json"), "--seconds", "8", "--only", "semi_active/")

    def run():
        ended = tool("machines", *words)
        return ended.code, ended.output

    assert run()[0] == 0
    return run


def test_the_same_machine_is_equal_and_another_law_is_not(kept, tmp_path):
    code, row = kept()
    assert (code, row.split("|")[-4:-1]) == (0, [" 0 and 5 ", " none ", " 0e+00 "])
    file = tmp_path / "kept.json"
    content = json.loads(file.read_text())
    law = decoded(content["semi_active/pump_with_valve"]["law"])
    content["semi_active/pump_with_valve"]["law"] = encoded(
        {name: x * (1 + 1e-6) if x.ndim and x.dtype.kind == "f" else x for name, x in law.items()}
    )
    content["semi_active/no tank"]["digest"] = "of another sea"
    file.write_text(json.dumps(content))
    code, row = kept()
    assert (code, row.split("|")[-3:-1]) == (
        1, [" semi_active/no tank, semi_active/pump_with_valve ", " 1e-06 "],
    )  # fmt: skip


def test_each_setting_is_a_process_of_its_own(tmp_path, monkeypatch, capfd):
    asked = []

    class Done:
        returncode = 0

    def run(words, env, check):
        asked.append((words[-1], env.get("OPENBLAS_CORETYPE"), env.get("UTANK_HIL_COMPILED")))
        return Done()

    monkeypatch.setattr("subprocess.run", run)
    monkeypatch.setenv("UTANK_HIL_COMPILED", "1")
    monkeypatch.setattr("sys.argv", ["machines", str(tmp_path / "kept.json"), "--kernels", "Nehal"])
    assert machines.main() == 0
    assert asked == [
        ("Nehalem, BLAS alone", "Nehalem", "1"),
        ("Nehalem, all", "Nehalem", "1"),
        ("Nehalem, all, two threads", "Nehalem", "1"),
        ("Nehalem, all, plain Python", "Nehalem", "0"),
    ]
