"""Compiled copies of modules: used while they are of this source, and only then."""

import json
import os
import subprocess
import sys
from importlib.machinery import EXTENSION_SUFFIXES
from pathlib import Path

import pytest

from utank_hil.base import compiled

RUN = """
import hashlib, json, pickle
from pathlib import Path
from firmware_sim.bench import jobs_of
from firmware_sim.lockstep_run import run_lockstep
from firmware_sim.scenario import Scenario
from utank_hil.base.compiled import in_use
from utank_hil.configuration import load_config
from utank_hil.runners import lockstep

scenario = load_config(Path("configs/scenarios/storm.yaml"), Scenario)
# the bench sends its jobs to other processes
assert pickle.loads(pickle.dumps(scenario)) == scenario
digests = {
    job.name: hashlib.sha256(run_lockstep(job).rows.tobytes()).hexdigest()
    for job in jobs_of(scenario, 1, 60.0)
}
print(json.dumps([in_use(), Path(lockstep.__file__).suffix, digests]))
"""


def test_the_folder_follows_every_source_file(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    source = tmp_path / "utank_hil" / "module.py"
    source.parent.mkdir()
    source.write_text("ANSWER = 1\n")
    monkeypatch.setattr(compiled, "ROOT", tmp_path)
    before = compiled.folder()
    assert compiled.folder() == before
    source.write_text("ANSWER = 2\n")
    assert compiled.folder() != before
    source.write_text("ANSWER = 1\n")
    assert compiled.folder() == before
    (source.parent / "another.py").write_text("")
    assert compiled.folder() != before


@pytest.mark.parametrize(("wanted", "current"), [("", True), ("0", True), ("", False)])
def test_modules_are_found_only_if_current_and_not_switched_off(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, wanted: str, current: bool
) -> None:
    made = compiled.folder() if current else Path("0123456789abcdef")
    module = tmp_path / made.name / "utank_hil" / "base" / f"tick{EXTENSION_SUFFIXES[0]}"
    module.parent.mkdir(parents=True)
    module.touch()
    monkeypatch.setattr(compiled, "_MADE", tmp_path)
    monkeypatch.setattr(sys, "meta_path", list(sys.meta_path))
    monkeypatch.setenv("UTANK_HIL_COMPILED", wanted)
    compiled.use_if_current()
    assert compiled.in_use() == (current and wanted != "0")
    if compiled.in_use():
        spec = sys.meta_path[0].find_spec("utank_hil.base.tick", None)
        assert spec.origin == str(module)
        assert sys.meta_path[0].find_spec("utank_hil.base.arrays", None) is None


@pytest.mark.evidence
@pytest.mark.timeout(1200)
def test_a_compiled_run_equals_the_plain_one_and_codecs_pass_their_tests() -> None:
    def run(compiled: str) -> list[object]:
        environment = {**os.environ, "UTANK_HIL_COMPILED": compiled}
        done = subprocess.run(
            [sys.executable, "-c", RUN], env=environment, capture_output=True, text=True, check=True
        )
        return list(json.loads(done.stdout))

    subprocess.run([sys.executable, "-m", "tools.compiled"], check=True)
    plain, fast = run("0"), run("1")
    assert plain[:2] == [False, ".py"]
    assert fast[:2] == [True, ".so"]
    assert fast[2] == plain[2]
    run_compiled = [sys.executable, "-m", "pytest", "-q", "tests/canbus", "tests/replay"]
    subprocess.run(run_compiled, env={**os.environ, "UTANK_HIL_COMPILED": "1"}, check=True)
