import json
import os
import re
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
import typer
from typer.testing import CliRunner

import firmware_sim.report_page
from firmware_sim.cli import app as ship_app
from utank_hil.cli import app
from utank_hil.cli import commands as entry_points
from utank_hil.console.exit_codes import ExitCode
from utank_hil.telemetry.recording_reader import read_recording

CONFIGS = Path("configs").resolve()
SHIPPED = sorted((CONFIGS / "controllers").glob("*.yaml"))
BIN = Path(sys.executable).parent
RESULTS = ("out/bench.rrd", "out/gpc.frames", "out/run-20261122T093000Z.frames")
"""Of `utank-hil bench --frames` and `run --out`, for the examples."""
PLAIN = {"TERM": "dumb", "COLUMNS": "200", "NO_COLOR": "1"}


def invoke(application, *arguments):
    return CliRunner(env=PLAIN).invoke(application, [str(argument) for argument in arguments])


def said(result):
    """Text without the lines and boxes that the help is framed in."""
    return re.sub(r"[\s│]+", " ", result.output)


def commands():
    words = [("design",), ("identify",)]
    for name, point in entry_points().items():
        loaded = point.load()
        if isinstance(loaded, typer.Typer):
            words += [(name, each.name or each.callback.__name__)
                      for each in loaded.registered_commands]  # fmt: skip
        else:
            words.append((name,))
    return [
        (ship_app, (), "firmware-sim"),
        *((app, each, " ".join(("utank-hil", *each))) for each in words),
    ]


@pytest.mark.parametrize(("application", "words", "name"), commands(), ids=lambda v: str(v)[:20])
def test_help_of_every_command_has_an_example_that_parses(application, words, name):
    result = invoke(application, *words, "--help")
    assert result.exit_code == 0
    example = re.search(rf"Example: ({re.escape(name)} [^│]*?)(?= {{2}}| In real time|$| ╭|\n)",
                        said(result).split("╭")[0])  # fmt: skip
    assert example, said(result)
    for word in example[1].split():
        if word.endswith(".yaml"):
            assert Path(word).is_file()
        if word.endswith((".rrd", ".frames")):
            assert word in RESULTS
        if word.startswith("--"):
            assert word in said(result).replace(example[0], "")
    assert "--json" in said(result) or words in (("design",), ("identify",))  # of several commands
    narrow = CliRunner(env=PLAIN | {"COLUMNS": "80"}).invoke(application, [*words, "--help"])
    assert "…" not in narrow.stdout  # cut


@pytest.mark.evidence(
    "naval_self_tuning",
    "patti_b_self_tuning",
    "self_tuned",
    "self_tuning",
    "adaptive_gpc_storm",
    "adaptive_gpc",
    "adaptive_dpc_roll",
    "adaptive_dpc",
    "dpc",
)
@pytest.mark.slow
@pytest.mark.parametrize("path", SHIPPED, ids=lambda path: path.stem)
def test_shipped_controllers_pass_their_check(path):
    result = invoke(app, "check", path, "--json")
    assert result.exit_code == 0
    report = json.loads(result.stdout)
    assert report["accepted"]
    assert report["failures"] == []
    if report["robustness"] is not None:  # a law that is not linear has none
        assert report["robustness"]["nominal"]["peak_sensitivity"] <= 2.0


def controller_file(folder, changes="", law="{kind: passive}"):
    path = folder / "controller.yaml"
    vessel = CONFIGS / "ships" / "thesis_first.yaml"
    path.write_text(f"name: test\nvessel: {vessel}\nlaw: {law}\n{changes}", encoding="utf-8")
    return path


def test_check_lists_every_error_with_file_key_and_reason(tmp_path):
    ship = tmp_path / "ship.yaml"
    good = (CONFIGS / "ships" / "thesis_first.yaml").read_text()
    painted = good.replace("lag_s: 0.1", "lag_s: 0.1\n  colour: red")
    ship.write_text(painted.replace("width_m: 17.1", "width_m: wide"))
    path = tmp_path / "controller.yaml"
    path.write_text(
        "name: test\nvessel: ship.yaml\nlaw: {kind: gpc, control_horizon: many}\n"
        "bit_rate: -5\nsafety: {roll_limit: 3}\nname_of_captain: nobody\n"
    )
    result = invoke(app, "check", path)
    assert result.exit_code == 2
    assert result.stdout == ""
    errors = re.sub(r"\s+", " ", result.stderr)
    for place in (
        f"{ship}: tank.width_m: ",
        f"{ship}: pump.colour: is not a known key",
        f"{path}: law.predictor: is required but missing",
        f"{path}: law.control_horizon: ",
        f"{path}: bit_rate: ",
        f"{path}: safety.roll_limit: is not a known key",
        f"{path}: name_of_captain: is not a known key",
    ):
        assert place in errors
    assert errors.count("error:") == result.stderr.count("error:") >= 7


@pytest.mark.parametrize(
    ("changes", "reason"),
    [
        ("limits: {pressure_pa: 60000.0}", "the vessel's pump gives 50000 at most"),
        ("limits: {level_m: 6.0}", "the vessel's tank is full or empty at 4.88"),
        ("safety: {motion_age_ms: -1.0}", "safety.motion_age_ms: must be above 0"),
        ("safety: {motion_age_ms: .inf}", "finite"),
        (
            "safety: {bus_load_limit: 80.0}",
            "safety.bus_load_limit: must be above 0 and at most 0.85",
        ),
        ("command_timeout_ms: 500", "100"),
        ("bit_rate: '[/oops] [red]'", "[/oops] [red]"),
    ],
)
def test_check_refuses_what_can_not_be_meant(tmp_path, changes, reason):
    result = invoke(app, "check", controller_file(tmp_path, changes))
    assert result.exit_code == 2
    assert reason in re.sub(r"\s+", " ", result.stderr)


def test_check_of_the_passive_tank_has_no_margins(tmp_path):
    path = controller_file(tmp_path)
    result = invoke(app, "check", path, "--json")
    assert result.exit_code == 0
    assert json.loads(result.stdout)["robustness"] is None
    assert "no margins" in invoke(app, "check", path).stdout


FRAGILE = (
    "{kind: gpc, predictor: {measured: [roll_rad], measurement_std: [1.0e-6], order: 4, "
    "wave_peak_rad_s: 0.6, wave_damping_ratio: 0.1, wave_slope_rad: 0.05, "
    "pressure_noise_pa_rt_s: 1.0e-3}, control_horizon: 50, prediction_horizon: 50, "
    "output_weight: [1.0e+16]}"
)


def test_law_without_margins_is_refused_unless_the_configuration_accepts_it(tmp_path):
    refused = invoke(app, "check", controller_file(tmp_path, law=FRAGILE), "--json")
    assert refused.exit_code == 1
    report = json.loads(refused.stdout)
    assert report["failures"]
    assert not report["accepted"]
    path = controller_file(tmp_path, "accept_low_margins: true\n", law=FRAGILE)
    accepted = invoke(app, "check", path)
    assert accepted.exit_code == 0
    assert "missed: " in accepted.stdout
    assert "accepted by the configuration" in accepted.stdout


def test_controller_without_margins_does_not_run(tmp_path):
    path = controller_file(tmp_path, law=FRAGILE)
    result = invoke(app, "run", path, "--bus", "nowhere0")
    assert result.exit_code == 2
    assert "misses its margins" in result.stderr


@pytest.mark.slow
@pytest.mark.parametrize(
    ("application", "arguments"),
    [
        (app, ("run", CONFIGS / "controllers" / "gpc.yaml", "--bus", "nowhere0")),
        (app, ("panel", CONFIGS / "ships" / "thesis_first.yaml", "--bus", "nowhere0")),
        (ship_app, (CONFIGS / "scenarios" / "storm.yaml", "--bus", "nowhere0")),
    ],
)
def test_missing_interface_is_named_and_has_a_code_of_its_own(application, arguments):
    result = invoke(application, *arguments, *(() if "panel" in arguments else ("--json",)))
    assert result.exit_code == ExitCode.NO_BUS
    assert "nowhere0" in result.stderr
    assert result.stdout == ""
    assert "Traceback" not in result.output


@pytest.mark.parametrize("names", ["motor", "sensors,motor", "sensors,drive,panel,truth"])
def test_unknown_node_to_leave_out_is_refused_with_those_that_there_are(names):
    storm = CONFIGS / "scenarios" / "storm.yaml"
    result = invoke(ship_app, storm, "--bus", "nowhere0", "--without", names)
    assert result.exit_code == 2
    unknown = names.split(",")[-1]
    expected = f"--without: no node '{unknown}' to leave out; there are sensors, drive, panel"
    assert expected in said(result)


@pytest.mark.parametrize(
    "arguments",
    [
        ("bench", "--bus", "vcan0"),
        ("bench", "nowhere.yaml"),
        ("bench", "--duration", "-3"),
        ("bench", "--duration", "inf"),
        ("check",),
        ("check", "nowhere.yaml"),
        ("conquer",),
    ],
)
def test_wrong_use_ends_with_code_2_and_an_error(arguments):
    result = invoke(app, *arguments)
    assert result.exit_code == 2
    assert isinstance(result.exception, SystemExit)
    assert re.search("error", result.stderr, re.IGNORECASE) or "Usage" in result.stderr


@pytest.mark.parametrize(
    "arguments",
    [
        ("bench", "--out", ""),
        ("campaign", CONFIGS / "studies" / "storm_seeds.yaml", "--out="),
        ("identify", "sea", "a.csv", "--out", ""),
    ],
)
def test_a_folder_of_no_letters_is_not_the_present_one(arguments, tmp_path, monkeypatch):
    """As a script has it whose variable is empty."""
    monkeypatch.chdir(tmp_path)
    result = invoke(app, *arguments)
    assert result.exit_code == 2
    assert "--out is empty; name a folder" in result.stderr
    assert list(tmp_path.iterdir()) == []


STORM_ALL = CONFIGS / "scenarios" / "storm_all.yaml"
"""Several laws, none of which takes long to design."""


def bench_process(*arguments):
    """The command in a process group of its own, as a terminal would start it."""
    return subprocess.Popen(
        [BIN / "utank-hil", "bench", STORM_ALL, *arguments],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
    )


def wait_for_workers(process, cpu_s):
    """Wait until the bench's processes have computed for so long."""
    deadline = time.monotonic() + 120
    tasks = Path(f"/proc/{process.pid}/task/{process.pid}/children")
    used_s = -1.0
    while used_s < cpu_s:
        assert time.monotonic() < deadline
        assert process.poll() is None
        time.sleep(0.02)
        used_s = -1.0
        for child in tasks.read_text().split():
            try:
                fields = Path(f"/proc/{child}/stat").read_text().rpartition(")")[2].split()
            except OSError:
                continue
            ticks = int(fields[11]) + int(fields[12])
            used_s = max(used_s, ticks / os.sysconf("SC_CLK_TCK"))


@pytest.mark.evidence
def test_interrupted_bench_reports_what_it_has_and_leaves_a_readable_recording(tmp_path):
    with bench_process("--duration", "36000", "--out", str(tmp_path), "--json") as process:
        wait_for_workers(process, 4.0)
        os.killpg(process.pid, signal.SIGINT)
        output, errors = process.communicate(timeout=120)
    assert process.returncode == ExitCode.INTERRUPTED, errors
    assert "Traceback" not in errors
    report = json.loads(output)
    assert report["interrupted"]
    assert report["exit_code"] == ExitCode.INTERRUPTED
    assert report["duration_s"] == 36000
    assert 0 < report["end_s"] < 36000
    run = [each["name"] for each in report["runs"]]
    assert run[0] == "passive"
    assert sorted(run + report["not_run"]) == [
        *("constrained", "dpc", "gpc", "lqg", "passive", "pd")
    ]
    recording = read_recording(tmp_path / "bench.rrd")
    assert list(recording) == run
    assert min(each["time_s"][-1] for each in recording.values()) < report["end_s"] + 0.05


@pytest.mark.evidence
def test_bench_interrupted_at_once_says_so(tmp_path):
    with bench_process("--duration", "36000", "--out", str(tmp_path / "out")) as process:
        wait_for_workers(process, 0.0)  # as soon as there is one
        os.killpg(process.pid, signal.SIGINT)
        output, errors = process.communicate(timeout=120)
    assert process.returncode == ExitCode.INTERRUPTED
    assert "Traceback" not in errors
    # a signal before the runs begin ends it without a word; on a busy machine one may come late
    if "ended at" not in output:
        assert errors == "" or "ended before the first sample" in errors
        out = tmp_path / "out"
        assert not out.exists() or not list(out.iterdir())


@pytest.mark.slow
@pytest.mark.parametrize("place", ["file", "/proc/nowhere", "taken"])
def test_bench_that_could_not_write_its_results_does_not_begin(tmp_path, place):
    (tmp_path / "file").write_text("mine")
    (tmp_path / "taken" / "bench.png").mkdir(parents=True)
    out = tmp_path / place
    result = invoke(app, "bench", "--duration", "3600", "--out", out)
    assert result.exit_code == 2
    assert isinstance(result.exception, SystemExit)
    assert str(out) in said(result).replace(" ", "")
    assert "choose another folder with --out" in said(result)
    assert (tmp_path / "file").read_text() == "mine"


@pytest.mark.slow
@pytest.mark.usefixtures("one_process")
def test_bench_whose_results_can_not_be_written_prints_them_all_the_same(tmp_path, monkeypatch):
    def full(*_arguments, **_more):
        raise OSError(28, "No space left on device")

    for name in ("_draw", "_record"):
        monkeypatch.setattr(firmware_sim.report_page, name, full)
    result = invoke(
        app, "bench", CONFIGS / "scenarios" / "storm_day.yaml", "--duration", "4", "--out", tmp_path
    )
    assert result.exit_code == 2
    assert "signif." in result.stdout
    for name in ("picture", "recording"):
        assert f"the {name} could not be written: No space left" in said(result)
    assert (tmp_path / "bench.json").is_file()
    assert "utank-hil monitor" not in result.stdout  # there is nothing to watch


@pytest.mark.parametrize("command", ["design", "identify"])
def test_other_commands_try_their_folder_first_too(tmp_path, command):
    (tmp_path / "out").write_text("mine")
    gpc = CONFIGS / "controllers" / "gpc.yaml"
    words = (
        ("design", "tank", CONFIGS / "ships" / "naval_vessel.yaml")
        if command == "design"
        else ("identify", "no.rrd", gpc)
    )
    result = invoke(app, *words, "--out", tmp_path / "out")
    assert result.exit_code == 2
    assert "is not a folder" in said(result)
    assert (tmp_path / "out").read_text() == "mine"


def test_bench_refuses_a_controller_without_margins(tmp_path):
    controller_file(tmp_path, law=FRAGILE)
    storm = Path("configs/scenarios/storm.yaml").resolve()
    scenario = tmp_path / "scenario.yaml"
    text = storm.read_text().replace("../", f"{storm.parent.parent}/")
    kept = [line for line in text.splitlines() if not line.startswith("  gpc:")]
    scenario.write_text(
        "\n".join(kept).replace(f"{storm.parent.parent}/controllers/dpc.yaml", "controller.yaml")
    )
    result = invoke(app, "bench", scenario, "--duration", "5", "--out", tmp_path)
    assert result.exit_code == 2
    assert "misses its margins" in said(result)
