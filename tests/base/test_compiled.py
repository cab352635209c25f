"""Compiled copies of modules: used while they are of this source, and only then."""

import ast
import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

import tools.compiled
from tools.compiled import PATTERNS
from utank_hil.base import compiled

RUN = """
import hashlib, json, pickle
from pathlib import Path
from firmware_sim.bench import jobs_of
from firmware_sim.run import run_lockstep
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


def test_the_digest_follows_every_source_file(tmp_path, monkeypatch):
    source = tmp_path / "utank_hil" / "module.py"
    source.parent.mkdir()
    source.write_text("ANSWER = 1\n")
    monkeypatch.setattr(compiled, "ROOT", tmp_path)
    before = compiled.source_digest()
    assert compiled.source_digest() == before
    source.write_text("ANSWER = 2\n")
    assert compiled.source_digest() != before
    source.write_text("ANSWER = 1\n")
    assert compiled.source_digest() == before
    (source.parent / "another.py").write_text("")
    assert compiled.source_digest() != before


def test_a_library_is_used_only_if_whole_and_of_the_present_source(tmp_path, monkeypatch):
    monkeypatch.setattr(compiled, "FOLDER", tmp_path / "none")
    assert compiled.current_library() is None
    monkeypatch.setattr(compiled, "FOLDER", tmp_path)
    (tmp_path / compiled.name_of_library("0123456789abcdef", b"of another source")).write_bytes(
        b"of another source"
    )
    assert compiled.current_library() is None
    library = tmp_path / compiled.name_of_library(compiled.source_digest(), b"whole")
    library.write_bytes(b"whole")
    assert compiled.current_library() == library
    library.write_bytes(b"whol")
    assert compiled.current_library() is None


@pytest.mark.parametrize("wanted", ["", "0"])
def test_a_library_that_does_not_load_leaves_plain_python_with_a_line(
    tmp_path, monkeypatch, capsys, wanted
):
    name = compiled.name_of_library(compiled.source_digest(), b"no library")
    (tmp_path / name).write_bytes(b"no library")
    monkeypatch.setattr(compiled, "FOLDER", tmp_path)
    monkeypatch.setattr(sys, "meta_path", list(sys.meta_path))
    monkeypatch.setenv("UTANK_HIL_COMPILED", wanted)
    compiled.use_if_current()
    assert not compiled.in_use()
    said = capsys.readouterr().err
    assert ("plain Python runs" in said and name in said) == (wanted != "0")


@pytest.mark.parametrize("compiler", ["no-such-compiler", "false", "latin-1"])
def test_without_a_compiler_that_works_one_line_is_said(tmp_path, compiler):
    if compiler == "latin-1":
        compiler = str(tmp_path / "cc")
        Path(compiler).write_text("#!/bin/sh\nprintf 'x.c: \\351rreur\\n' >&2; exit 1\n")
        Path(compiler).chmod(0o755)
    code = (
        "from pathlib import Path; import tools.compiled as made;"
        f"made.current_library = lambda: None; made.CC = {compiler!r};"
        "made.build = lambda: 1 / 0 if 'no-such' in made.CC else made._run([]); made.main()"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert len(done.stdout.splitlines()) == 1
    assert "plain Python runs" in done.stdout
    assert not done.stderr


def test_a_library_that_does_not_load_is_made_anew_and_one_made_so_is_not_kept(
    tmp_path, monkeypatch
):
    for module in (compiled, tools.compiled):
        monkeypatch.setattr(module, "FOLDER", tmp_path)
    before = tmp_path / compiled.name_of_library(compiled.source_digest(), b"of another machine")
    before.write_bytes(b"of another machine")
    monkeypatch.setattr(tools.compiled, "c_sources", lambda scratch: ([], []))
    monkeypatch.setattr(tools.compiled, "_compiled", lambda *_: b"no library")
    with pytest.raises(OSError, match="file too short"):
        tools.compiled.build()
    assert list(tmp_path.iterdir()) == [before]


def test_no_module_that_is_compiled_has_a_dataclass_that_its_own_init_could_not_fill():
    files = {file for each in PATTERNS for file in compiled.ROOT.glob(each)}
    classes = [
        (file.name, node)
        for file in files
        for node in ast.walk(ast.parse(file.read_text()))
        if isinstance(node, ast.ClassDef)
    ]
    assert len(classes) > 50
    unfit = [
        f"{name}: {node.name}"
        for name, node in classes
        if any("dataclass" in ast.unparse(each) for each in node.decorator_list)
        and any(
            "Final" in ast.unparse(part) for part in node.body if isinstance(part, ast.AnnAssign)
        )
    ]
    assert not unfit


@pytest.mark.evidence
@pytest.mark.timeout(1200)
def test_a_compiled_run_equals_the_plain_one_and_codecs_pass_their_tests():
    def run(compiled):
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


@pytest.mark.slow
def test_the_tick_translates_to_c_without_a_cache_from_before(tmp_path):
    translate = (
        "from pathlib import Path; from tools.compiled import c_sources; c_sources(Path('{}'))"
    )
    subprocess.run(
        [sys.executable, "-c", translate.format(tmp_path)], check=True, cwd=compiled.ROOT
    )
    assert list(tmp_path.glob("**/*controller*.c"))
