import dataclasses
import json
import math
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from integrated_roll import integrated_roll
from one_process import in_one_process

from firmware_sim import report_page as report
from firmware_sim.bench import (
    BenchOptions,
    BenchResult,
    jobs_of,
    run_bench,
    run_in_turn,
    window_s,
)
from firmware_sim.figures import figures
from firmware_sim.report_page import write_files
from firmware_sim.report_tables import motion_table
from firmware_sim.run import COLUMNS, RECORD_S, Run, run_lockstep
from firmware_sim.scenario import Scenario
from utank_hil.assembly import build_law
from utank_hil.base.parameters import ParameterError
from utank_hil.base.provenance import describe
from utank_hil.canbus import Mode
from utank_hil.configuration import load_config
from utank_hil.console.exit_codes import ExitCode
from utank_hil.control import PassiveDesign
from utank_hil.nodes.signals import SIGNALS
from utank_hil.pictures import BenchCurve
from utank_hil.telemetry.recording_reader import read_recording

pytestmark = pytest.mark.slow

SHIPPED = load_config(Path("configs/scenarios/storm.yaml"), Scenario)
# the law that designs itself takes longer to design than all else here, and is like any other
STORM = SHIPPED.model_copy(
    update={"controllers": {name: SHIPPED.controllers[name] for name in ("dpc", "gpc")}}
)
DURATION_S = 120.0
ESTIMATED = SIGNALS[SIGNALS.index("significant_height_m") :]
SETTLE_S = 40.0


@pytest.fixture(scope="module")
def storm() -> BenchResult:
    scenario = STORM.model_copy(update={"settle_s": SETTLE_S})
    with in_one_process():
        return run_bench(scenario, BenchOptions(duration_s=DURATION_S), lambda *_: None)


def test_a_law_that_its_process_can_not_be_given_is_refused_by_its_key() -> None:
    laws = {name: build_law(each) for name, each in STORM.controllers.items()}
    made = laws["gpc"].controller
    laws["gpc"] = dataclasses.replace(laws["gpc"], controller=lambda: made())
    with pytest.raises(ParameterError, match=r"controllers\.gpc\.law can't be given .*lambda"):
        run_bench(STORM, BenchOptions(duration_s=1.0), lambda *_: None, laws)


def about(result: BenchResult, folder: Path) -> dict[str, Any]:
    return describe("bench", result.scenario, folder, options={}, seed=result.seed)


def test_every_run_has_its_rows_on_one_grid_and_the_passive_one_comes_first(storm) -> None:
    assert [run.name for run in storm.runs] == ["passive", *STORM.controllers]
    for run in storm.runs:
        assert run.rows.shape == (round(DURATION_S / RECORD_S), len(COLUMNS))
        np.testing.assert_allclose(np.diff(run.column("time_s")), RECORD_S, atol=1e-9)
        told = [name not in ESTIMATED for name in COLUMNS]
        assert np.isfinite(run.rows[:, told]).all()
        assert run.refused_commands == 0
    assert (storm.duration_s, storm.not_run, storm.interrupted) == (DURATION_S, (), False)
    assert (storm.settle_s, storm.end_s) == pytest.approx((SETTLE_S, DURATION_S))
    assert len(storm.without_tank_rad) == len(storm.runs[0].rows)
    assert figures(storm).endings == ()
    assert figures(storm).exit_code == ExitCode.OK


def test_plans_that_were_not_found_in_time_are_told() -> None:
    path = Path("configs/scenarios/patti_b.yaml")
    scenario = load_config(path, Scenario)
    hurried = scenario.controllers["constrained"]
    starved = hurried.model_copy(
        update={"law": dataclasses.replace(hurried.law, iteration_limit=1)}
    )
    changes = {"controllers": {"starved": starved}, "settle_s": 5.0, "duration_s": 20.0}
    result = run_in_turn(scenario.model_copy(update=changes), scenario.seed)
    passive, run = result.runs
    assert passive.fallbacks is None
    assert run.fallbacks is not None
    assert run.fallbacks > 0
    assert [each["fallbacks"] for each in figures(result).as_json({}, {})["runs"]] == [
        None,
        run.fallbacks,
    ]
    assert f"starved: {run.fallbacks} plans were not found in time" in " ".join(
        figures(result).endings
    )


def test_all_runs_are_in_the_same_waves_and_those_are_the_scenarios(storm) -> None:
    time_s = storm.runs[0].column("time_s")
    moment = STORM.wave_moment(STORM.seed).at(time_s)
    for run in storm.runs:
        np.testing.assert_allclose(
            run.column("wave_moment_nm"), moment, rtol=0, atol=1e-9 * np.abs(moment).max()
        )


def test_measurements_stand_beside_the_truth_they_were_taken_of(storm) -> None:
    for run in storm.runs:
        roll, true = run.column("roll_rad")[10:], run.column("true_roll_rad")[10:]
        # 20 ms of sensor, 10 ms of bus, noise of 2e-4: the error is roll rate times age, and noise
        rate = np.abs(run.column("roll_rate_rad_s")[10:]).max()
        assert np.abs(roll - true).max() < rate * 0.04 + 5 * 2e-4
        level = (run.column("starboard_level_m") - run.column("port_level_m"))[10:] / 2
        assert np.abs(level - run.column("true_level_m")[10:]).max() < 0.1


def test_armed_runs_quiet_the_ship_and_the_passive_one_holds_zero_pressure(storm) -> None:
    passive, *controlled = figures(storm).compared
    assert passive.mode == "PASSIVE"
    assert passive.active_share == 0.0
    assert (storm.runs[0].column("pressure_command_pa") == 0.0).all()
    assert passive.pump.pressure_peak_pa < 1e3  # what the loop lets through at zero
    for run in controlled:
        assert (run.mode, run.fault) == ("ACTIVE", "NONE")
        assert run.active_share == 1.0
        assert run.roll_below_passive > 0.25
        assert run.pump.power_mean_w > 0
    for run in storm.runs[1:]:
        command_pa, limits = run.column("pressure_command_pa"), STORM.controllers[run.name].limits
        assert np.abs(command_pa).max() <= limits.pressure_pa
        assert np.abs(np.diff(command_pa)).max() <= limits.rate_pa_s * RECORD_S * (1 + 1e-9) + 8.0


def test_figures_follow_from_the_rows(storm) -> None:
    bare, runs = figures(storm).no_tank, figures(storm).compared
    skip = round(SETTLE_S / RECORD_S)
    without = storm.without_tank_rad[skip:]
    assert bare.rms_rad == pytest.approx(math.sqrt(np.mean(without**2)), rel=1e-12)
    first = storm.runs[0].column("true_roll_rad")[skip:]
    for run, told in zip(storm.runs, runs, strict=True):
        roll = run.column("true_roll_rad")[skip:]
        rms = math.sqrt(np.mean(roll**2))
        assert told.roll.rms_rad == pytest.approx(rms, rel=1e-12)
        assert told.roll.maximum_rad == np.abs(roll).max()
        assert told.roll_below_no_tank == pytest.approx(1 - rms / bare.rms_rad, rel=1e-9)
        assert told.roll_below_passive == pytest.approx(
            1 - rms / math.sqrt(np.mean(first**2)), rel=1e-9, abs=1e-12
        )
        assert told.pump.level_peak_m == np.abs(run.column("true_level_m")[skip:]).max()
        assert told.active_share == np.mean(run.column("mode")[skip:] == Mode.ACTIVE)
        # what the controller thinks of the bus's load, and what the bus knows
        assert run.column("bus_load")[-1] == pytest.approx(told.bus_load, rel=0.05)
        assert 0.15 < told.bus_load < 0.3


def test_report_leaves_picture_recording_and_figures_behind(storm, tmp_path: Path) -> None:
    files, failures = write_files(storm, figures(storm), tmp_path, about(storm, tmp_path))
    assert failures == []
    assert files["picture"].read_bytes().startswith(b"\x89PNG")
    recording = read_recording(files["recording"])
    assert list(recording) == [run.name for run in storm.runs]
    for run in storm.runs:
        for name in COLUMNS:
            np.testing.assert_allclose(
                recording[run.name][name], run.column(name), rtol=1e-6, atol=1e-6, err_msg=name
            )
    told = json.loads(files["figures"].read_text(), parse_constant=pytest.fail)
    known = {name: path for name, path in files.items() if name != "report"}
    expected = figures(storm).as_json(known, about(storm, tmp_path))
    assert told | {"date": ""} == json.loads(json.dumps(expected, allow_nan=False)) | {"date": ""}
    assert [run["name"] for run in told["runs"]] == list(recording)
    assert told["files"]["picture"] == str(files["picture"])
    page = files["report"].read_text(encoding="utf-8")
    for run in told["runs"]:
        assert f"<td>{run['name']}</td>" in page
        assert f"<td>{math.degrees(run['roll']['rms_rad']):.2f}</td>" in page
    assert all(run["compared"] and run["rows"] == run["expected_rows"] for run in told["runs"])
    # the page that is made later of the files is the same, pictures of rounded rolls apart
    again = report.report_page.write_report_page(tmp_path / "a.html", *report.read_bench(tmp_path))
    pictures = re.compile('base64,[^"]*')
    assert len(pictures.findall(page)) == 2
    assert pictures.sub("", again.read_text(encoding="utf-8")) == pictures.sub("", page)
    files["figures"].write_text(files["figures"].read_text().replace('"bus_load"', '"load"'))
    with pytest.raises(ValueError, match="bus_load that can be used"):
        report.read_bench(tmp_path)


def test_picture_says_the_same_figures_as_the_table(storm, tmp_path: Path, monkeypatch) -> None:
    drawn: list[BenchCurve] = []
    monkeypatch.setattr(report, "draw_bench", lambda curves, *_, **__: drawn.extend(curves))
    report._draw(storm, figures(storm), about(storm, tmp_path), tmp_path / "bench.png")
    cells = [list(column.cells) for column in motion_table(figures(storm)).columns]
    table = {row[0]: row for row in zip(*cells, strict=True)}
    for run, curve in zip(storm.runs, drawn, strict=True):
        name, rms, _, _, _, below, _, _ = table[run.name]
        assert f"{name}: roll {rms}° RMS" in curve.label
        if below:
            share = re.search(r"\((−|\+)(\d+)%\)", curve.label)
            assert share
            sign = -1 if share[1] == "+" else 1
            assert sign * int(share[2]) == pytest.approx(float(below.rstrip("%")), abs=0.01)


@pytest.mark.evidence
def test_what_can_not_be_written_is_named_and_the_rest_is_there(storm, tmp_path: Path) -> None:
    (tmp_path / "bench.rrd").mkdir()
    files, failures = write_files(storm, figures(storm), tmp_path, about(storm, tmp_path))
    assert set(files) == {"picture", "figures", "report"}
    assert [failure.split()[1] for failure in failures] == ["recording"]
    assert set(json.loads(files["figures"].read_text())["files"]) == {"picture", "figures"}


def test_same_seed_same_rows_and_another_seed_another_sea(storm) -> None:
    for job, run in zip(jobs_of(STORM, STORM.seed, 20.0), storm.runs, strict=True):
        again = run_lockstep(job)
        assert again.rows.tobytes() == run.rows[: len(again.rows)].tobytes()
    other = run_lockstep(jobs_of(STORM, 99, 5.0)[0])
    assert not np.array_equal(
        other.column("wave_moment_nm"), storm.runs[0].column("wave_moment_nm")[:100]
    )


@pytest.mark.evidence
def test_processes_tell_how_far_they_are_and_give_the_same_rows(storm) -> None:
    progress: list[tuple[str, float]] = []
    result = run_bench(
        STORM, BenchOptions(duration_s=20.0), lambda name, done_s: progress.append((name, done_s))
    )
    assert {name for name, _ in progress} == {run.name for run in storm.runs}
    assert max(done_s for _, done_s in progress) <= 20.0
    for run, alone in zip(result.runs, storm.runs, strict=True):
        assert run.rows.tobytes() == alone.rows[: len(run.rows)].tobytes()


def cut(run: Run, rows: slice) -> Run:
    return dataclasses.replace(run, rows=run.rows[rows])


def test_unfinished_runs_are_all_compared_over_the_time_they_share(storm) -> None:
    *whole, last = storm.runs
    runs = (*whole, cut(last, slice(1800)))
    settle_s, end_s = window_s(runs, SETTLE_S)
    assert (settle_s, end_s) == pytest.approx((SETTLE_S, 90.0))
    shortened = dataclasses.replace(
        storm,
        runs=runs,
        end_s=end_s,
        without_tank_rad=storm.without_tank_rad[:1800],
        interrupted=True,
        not_run=("lqg",),
    )
    skip = round(SETTLE_S / RECORD_S)
    bare, told = figures(shortened).no_tank, figures(shortened).compared
    rms = [
        math.sqrt(np.mean(roll[skip:1800] ** 2))
        for roll in (storm.without_tank_rad, *(run.column("true_roll_rad") for run in runs))
    ]
    assert bare.rms_rad == pytest.approx(rms[0], rel=1e-12)
    for run, own in zip(told, rms[1:], strict=True):
        assert run.roll.rms_rad == pytest.approx(own, rel=1e-12)
        assert run.roll_below_no_tank == pytest.approx(1 - own / rms[0], rel=1e-9)
        assert run.roll_below_passive == pytest.approx(1 - own / rms[1], abs=1e-9)
    assert figures(shortened).endings == ("ended at 90 of 120 s", "not run: lqg")
    assert figures(shortened).exit_code == ExitCode.INTERRUPTED
    assert "40 s to 90 s" in str(motion_table(figures(shortened)).caption)
    as_told = figures(shortened).as_json({}, {})
    assert (as_told["interrupted"], as_told["not_run"]) == (True, ("lqg",))
    assert (as_told["duration_s"], as_told["end_s"]) == (DURATION_S, pytest.approx(90.0))


@pytest.mark.evidence("rows0-ended at 10 s with 0 of the 1600 rows from 40 s to 120 s")
@pytest.mark.parametrize(
    ("rows", "why"),
    [
        (slice(200), "ended at 10 s with 0 of the 1600 rows from 40 s to 120 s"),
        (slice(None, None, 2), "ended at 119.95 s with 800 of the 1600 rows from 40 s to 120 s"),
        (slice(1000, None), "ended at 120 s with 1400 of the 1600 rows from 40 s to 120 s"),
    ],
)
def test_run_with_too_few_rows_is_told_and_not_compared(
    storm, rows: slice, why: str, tmp_path: Path
) -> None:
    *whole, last = storm.runs
    runs = (*whole, cut(last, rows))
    assert window_s(runs, SETTLE_S) == pytest.approx((SETTLE_S, DURATION_S), abs=RECORD_S)
    some = dataclasses.replace(storm, runs=runs)
    assert [run.name for run in figures(some).compared] == [run.name for run in whole]
    said = figures(some).endings
    assert len(said) == 1
    assert said[0].startswith(f"{last.name}: not ranked, not compared, ")
    assert why in said[0]
    assert figures(some).exit_code == ExitCode.NOT_RANKED
    told = figures(some).as_json({}, {})["runs"][-1]
    assert (told["name"], told["compared"]) == (last.name, False)
    assert told["roll"] is None
    if rows == slice(200):  # what it leaves of the picture and of the page is the least
        _, failures = write_files(some, figures(some), tmp_path, about(some, tmp_path))
        assert failures == []
    # without the passive run, nothing is said to be below it
    lone = dataclasses.replace(storm, runs=(cut(whole[0], rows), *whole[1:], last))
    assert all(run.roll_below_passive is None for run in figures(lone).compared)
    assert all(run.roll_below_no_tank is not None for run in figures(lone).compared)


def test_one_run_that_is_ended_early_does_not_leave_too_little_of_the_others(storm) -> None:
    for reach_s, end_s in ((59.0, DURATION_S), (61.0, 61.0)):
        runs = (*storm.runs[:-1], cut(storm.runs[-1], slice(round(reach_s / RECORD_S))))
        assert window_s(runs, 10.0) == pytest.approx((10.0, end_s))
    assert window_s(storm.runs, 500.0) == pytest.approx((DURATION_S / 2, DURATION_S))


def test_figure_that_can_not_be_told_is_an_empty_cell_and_null(storm) -> None:
    count = 40  # two seconds hold no cycle of the roll
    short = dataclasses.replace(
        storm,
        runs=tuple(cut(run, slice(count)) for run in storm.runs),
        settle_s=1.0,
        end_s=2.0,
        without_tank_rad=storm.without_tank_rad[:count],
    )
    significant = list(motion_table(figures(short)).columns[2].cells)
    assert significant == [""] * (1 + len(storm.runs))
    told = json.loads(json.dumps(figures(short).as_json({}, {}), allow_nan=False))
    assert told["no_tank"]["significant_rad"] is None


def test_bare_ship_is_loaded_differently_when_the_ship_is() -> None:
    first = next(iter(STORM.controllers.values()))
    passive = first.model_copy(update={"law": PassiveDesign()})
    change_s = 8.0
    changing = STORM.model_copy(
        update={
            "controllers": {"none": passive},
            "actual_ship": {"inertia_kg_m2": 1.2e9, "stiffness_nm_rad": 6.7e8},
            "actual_from_s": change_s,
            "duration_s": 20.0,
        }
    )
    result = run_in_turn(changing, STORM.seed)
    bare = result.without_tank_rad
    moment, time_s = STORM.wave_moment(STORM.seed), RECORD_S * np.arange(len(bare))
    before, after = time_s[time_s < change_s], time_s[time_s >= change_s]
    # up to the change with one ship, and from her angle and rate then with the other
    first = integrated_roll(STORM.vessel.ship, moment, np.append(before, change_s))
    second = integrated_roll(changing.sailing_ship, moment, after, change_s, first[:, -1])
    expected = np.concatenate([first[0, :-1], second[0]])
    np.testing.assert_allclose(bare, expected, rtol=0, atol=1e-9)


@pytest.mark.usefixtures("one_process")
def test_an_interface_that_is_not_there_ends_the_bench_with_its_name() -> None:
    options = BenchOptions(real_time=True, channel="nowhere0", duration_s=60.0)
    alone = STORM.model_copy(update={"controllers": {}})
    with pytest.raises(OSError, match="nowhere0"):
        run_bench(alone, options, lambda _name, _done: None)
