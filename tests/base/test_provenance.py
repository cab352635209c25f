"""Results say where they come from, and what they say can be run again."""

import json
import math
import os
import platform
import re
import socket
import subprocess
import sys
import zipfile
from datetime import UTC, datetime
from pathlib import Path

import pytest
from numpy._core._multiarray_umath import __cpu_dispatch__
from PIL import Image
from pydantic import BaseModel
from typer.testing import CliRunner

from firmware_sim.cli import app as ship_app
from firmware_sim.scenario import Scenario
from utank_hil.base import provenance
from utank_hil.base.provenance import commit, describe, headline, kernels, machine, version
from utank_hil.cli import app
from utank_hil.commands.recording import RunRecording
from utank_hil.configuration import ControllerConfig, Vessel, load_config
from utank_hil.telemetry.frame_log import FrameLog
from utank_hil.telemetry.recording_reader import read_about

CONFIGS = Path("configs")
PATTI_B = CONFIGS / "scenarios" / "patti_b.yaml"
ONE_LAW = CONFIGS / "scenarios" / "storm_day.yaml"
SHIPPED = [
    (path, model)
    for folder, model in (
        ("scenarios", Scenario),
        ("controllers", ControllerConfig),
        ("ships", Vessel),
    )
    for path in sorted((CONFIGS / folder).glob("*.yaml"))
]


def content(model, folder):
    return describe("test", model, folder, options={})["configuration"]


def values(part):
    """What a configuration says, to be compared: not by which keys or path the file said it."""
    if isinstance(part, BaseModel):
        return {name: values(getattr(part, name)) for name in type(part).model_fields}
    if isinstance(part, dict):
        return {name: values(each) for name, each in part.items()}
    if isinstance(part, tuple):
        return [values(each) for each in part]
    return part.resolve() if isinstance(part, Path) else part


def loaded_again(described, model, folder):
    path = folder / "again.yaml"
    path.write_text(json.dumps(described, allow_nan=False), encoding="utf-8")
    return load_config(path, model)


@pytest.mark.parametrize(("path", "model"), SHIPPED, ids=lambda v: getattr(v, "stem", ""))
def test_every_shipped_configuration_loads_again_from_what_is_said_of_it(path, model, tmp_path):
    ran = load_config(path, model)
    again = loaded_again(content(ran, tmp_path), model, tmp_path)
    assert content(again, tmp_path) == content(ran, tmp_path)
    assert values(again) == values(ran)


def test_measured_directions_load_again_too(tmp_path):
    seas = (CONFIGS / "seas").resolve()
    text = (CONFIGS / "scenarios" / "storm.yaml").read_text()
    text = text.replace("../seas", str(seas)).replace("../", f"{CONFIGS.resolve()}/")
    direction = f"direction_file: {seas}/ndbc_41010_2019-02_mean_direction.txt\n  course_deg: 30.0"
    path = tmp_path / "scenario.yaml"
    path.write_text(text.replace("  file: ", f"  {direction}\n  file: "), encoding="utf-8")
    ran = load_config(path, Scenario)
    assert ran.sea.direction_file is not None
    again = loaded_again(content(ran, tmp_path), Scenario, tmp_path)
    assert again.sea.sea(1).heading_rad.tolist() == ran.sea.sea(1).heading_rad.tolist()


def test_data_files_are_named_from_the_results_folder_with_their_hash(tmp_path):
    (tmp_path / "out").mkdir()
    told = describe("x", load_config(CONFIGS / "scenarios" / "storm.yaml", Scenario),
                    tmp_path / "out", options={})  # fmt: skip
    ((name, digest),) = told["data"].items()
    assert told["configuration"]["sea"]["file"] == name
    assert name.startswith("../")
    found = (tmp_path / "out" / name).resolve()
    assert found == (CONFIGS / "seas" / "ndbc_41010_2019-02_spectral_density.txt").resolve()
    done = subprocess.run(["sha256sum", found], capture_output=True, text=True, check=True)
    assert digest == done.stdout.split()[0]


def test_machine_and_program_are_said_and_nobodys_name(monkeypatch):
    before = datetime.now(UTC)
    home = Path("/home/somebody/ships/mine.yaml")
    options = {"config": home, "out": Path("out"), "seed": None}
    model = load_config(CONFIGS / "ships" / "patti_b.yaml", Vessel)
    told = describe("bench", model, Path("out"), options=options, seed=7)
    assert told["options"] == {"config": "mine.yaml", "out": "out", "seed": None}
    assert (told["command"], told["seed"], told["version"]) == ("bench", 7, version())
    assert abs(datetime.fromisoformat(told["date"]) - before).total_seconds() < 60
    assert set(told["machine"]) == {
        "platform", "python", "cpus", "processor", "numpy", "blas", "libm",
    }  # fmt: skip
    assert told["machine"]["python"] == platform.python_version()
    text = json.dumps(told, allow_nan=False)
    assert "somebody" not in text
    assert socket.gethostname() not in text
    assert told["configuration"]["pump"]["max_power_w"] == model.pump.max_power_w
    assert "headroom_m" not in told["configuration"]["tank"]  # without bound, as by default
    assert math.isinf(model.tank.headroom_m)


def test_commit_is_that_of_the_tree_and_unknown_where_there_is_none(tmp_path, monkeypatch):
    commit.cache_clear()
    head = subprocess.run(["git", "rev-parse", "HEAD"], capture_output=True, text=True, check=False)
    if head.returncode == 0:  # not so in an unpacked archive
        described = commit().removesuffix("-dirty").rpartition("-g")[2]
        assert head.stdout.startswith(described) or described.startswith("v")
    commit.cache_clear()
    monkeypatch.setattr(provenance, "_ROOT", tmp_path)
    assert commit() == "unknown"  # an editable installation has no commit of its own
    (tmp_path / ".git").mkdir()
    commit.cache_clear()
    assert commit() == "unknown"  # no repository
    (tmp_path / ".git").rmdir()
    (tmp_path / "utank_hil").mkdir()
    (tmp_path / "utank_hil" / "commit.txt").write_text("v1.2-3-g0123456789ab\n")
    commit.cache_clear()
    assert commit() == "v1.2-3-g0123456789ab"  # as a wheel brings it
    commit.cache_clear()


@pytest.mark.evidence
def test_a_wheel_brings_its_commit_configurations_and_pages(tmp_path):
    pip = [sys.executable, "-m", "pip", "--disable-pip-version-check", "wheel", "--quiet"]
    source = Path(__file__).parents[2]
    copy = tmp_path / "source"
    subprocess.run(["git", "clone", "--quiet", "--depth=1", f"file://{source}", copy], check=True)
    options = ["--no-deps", "--no-build-isolation", "-w", str(tmp_path), str(copy)]
    subprocess.run([*pip, *options], check=True)
    (wheel,) = tmp_path.glob("*.whl")
    with zipfile.ZipFile(wheel) as names:
        commit_of_wheel = names.read("utank_hil/commit.txt").decode().strip()
        found = {name.partition("/share/utank-hil/")[2] or name for name in names.namelist()}
    head = subprocess.run(
        ["git", "-C", copy, "rev-parse", "HEAD"], capture_output=True, text=True, check=True
    ).stdout
    assert head.startswith(commit_of_wheel.rpartition("-g")[2])
    assert found >= {
        "SECURITY.md",
        "configs/scenarios/storm.yaml",
        "docs/deployment.md",
        "docs/how-to/buy.md",
        "firmware_sim/guard/guard.c",
        "firmware_sim/guard/guard.h",
    }


@pytest.mark.parametrize("application", [app, ship_app], ids=["utank-hil", "firmware-sim"])
def test_both_commands_have_a_version(application):
    result = CliRunner().invoke(application, ["--version"])
    assert (result.exit_code, result.stdout) == (0, f"{headline()}\n{kernels(machine())}\n")
    assert re.fullmatch(r"utank-hil \d+\.\d+\.\d+\S*, commit \S+\n.+ libm .+\n", result.stdout)


@pytest.mark.evidence
@pytest.mark.usefixtures("one_process")
def test_figures_picture_and_recording_of_a_bench_hold_the_configuration_that_ran(tmp_path):
    words = ["bench", str(ONE_LAW), "--seed", "3", "--duration", "10", "--out", str(tmp_path)]
    result = CliRunner().invoke(app, [*words, "--json"])
    assert result.exit_code == 0, result.output
    told = json.loads((tmp_path / "bench.json").read_text())
    again = loaded_again(told["configuration"], Scenario, tmp_path)
    ran = load_config(ONE_LAW, Scenario)
    changes = {"seed": 3, "duration_s": 10.0, "settle_s": 5.0}
    assert values(again) == values(ran.model_copy(update=changes))
    assert told["options"]["seed"] == told["seed"] == 3
    picture = json.loads(Image.open(tmp_path / "bench.png").text["Description"])
    recording = read_about(tmp_path / "bench.rrd")
    assert picture == recording == {key: told[key] for key in picture}
    assert {"version", "commit", "date", "machine", "configuration"} <= set(picture)


@pytest.mark.slow
@pytest.mark.usefixtures("few_rolls")
def test_figures_and_picture_of_a_design_hold_ship_and_scenario(tmp_path):
    vessel = CONFIGS / "ships" / "patti_b.yaml"
    words = ["design", "tank", str(vessel), "--scenario", str(PATTI_B), "--out", str(tmp_path)]
    result = CliRunner().invoke(app, [*words, "--json"])
    assert result.exit_code == 0, result.output
    told = json.loads((tmp_path / "tank.json").read_text())
    assert json.loads(result.stdout) == told
    again = loaded_again(told["configuration"], Vessel, tmp_path)
    assert values(again) == values(load_config(vessel, Vessel))
    scenario = loaded_again(told["scenario_configuration"], Scenario, tmp_path)
    assert values(scenario) == values(load_config(PATTI_B, Scenario))
    picture = json.loads(Image.open(tmp_path / "tank.png").text["Description"])
    assert picture == {key: told[key] for key in picture}
    assert picture["command"] == "design tank"


@pytest.mark.slow
def test_recording_of_a_run_holds_where_it_comes_from(tmp_path):
    config = load_config(CONFIGS / "controllers" / "gpc.yaml", ControllerConfig)
    about = describe("run", config, tmp_path, options={})
    recording = RunRecording(tmp_path, about=about)
    recording.stop()
    assert recording.summary.file is not None
    assert FrameLog(Path(recording.summary.file)).head["about"] == about


def test_a_git_at_work_in_the_source_tree_is_not_disturbed(tmp_path, monkeypatch):
    def git(*words):
        who = ("-c", "user.name=x", "-c", "user.email=x@x")
        subprocess.run(["git", "-C", str(tmp_path), *who, *words], check=True)

    file, index = tmp_path / "file", tmp_path / ".git" / "index"
    file.write_text("text")
    git("init", "-q")
    git("add", "file")
    git("commit", "-q", "-m", "first")
    file.touch()  # git would note the time in its index, under a lock
    before = index.stat()
    monkeypatch.setattr(provenance, "_ROOT", tmp_path)
    clean = commit.__wrapped__()
    after = index.stat()
    assert (after.st_ino, after.st_mtime_ns) == (before.st_ino, before.st_mtime_ns)
    (tmp_path / "other").write_text("not of the program")
    assert commit.__wrapped__() == clean
    file.write_text("changed")
    assert commit.__wrapped__() == f"{clean}-dirty"
    git("tag", "-a", "v1", "-m", "v1")
    git("commit", "-q", "-a", "-m", "second")
    assert re.fullmatch("v1-1-g[0-9a-f]{12}", commit.__wrapped__())


def test_kernels_of_an_older_processor_are_said():
    vectors = " ".join(__cpu_dispatch__)  # numpy's names differ by its version
    older = {"NPY_DISABLE_CPU_FEATURES": vectors, "OPENBLAS_CORETYPE": "Nehalem"}
    code = (
        "import json; from utank_hil.base.provenance import machine; print(json.dumps(machine()))"
    )
    done = subprocess.run(
        [sys.executable, "-W", "ignore", "-c", code],
        env=os.environ | older, capture_output=True, text=True, check=True,
    )  # fmt: skip
    there = json.loads(done.stdout)
    assert there["processor"] == machine()["processor"]
    assert there["numpy"] == "baseline"
    assert there["blas"].endswith("openblas Nehalem")


def test_kernels_are_said_of_a_library_in_a_folder_of_any_name(tmp_path):
    """Of spaces, and of letters that are none in UTF-8."""
    folder = os.fsencode(tmp_path) + b"/Schiff \xd6l 2"
    os.mkdir(folder)
    code = f"""
import ctypes, os, shutil
import numpy
from utank_hil.base import provenance
mapped = open("/proc/self/maps", "rb").read().splitlines()
library = next(line.split(maxsplit=5)[-1] for line in mapped if b"openblas" in line)
shutil.copy(library, {folder!r})
copy = ctypes.CDLL(os.fsdecode(os.path.join({folder!r}, os.path.basename(library))))
lines = provenance._lines
provenance._lines = lambda path: [line for line in lines(path) if "Schiff" in line]
print(provenance._blas_core())
"""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert done.stderr == ""
    assert machine()["blas"].endswith(f"openblas {done.stdout.strip()}")


def test_a_log_that_says_nothing_of_its_machine_is_none_of_another():
    assert kernels({"platform": "Linux", "cpus": 2}) == ""
    assert machine()["libm"] in kernels(machine())
