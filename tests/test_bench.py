import json
import math
from pathlib import Path

import numpy as np
import pytest

from firmware_sim.bench import BenchOptions, BenchResult, jobs_of, run_bench
from firmware_sim.report import as_json, figures, write_report
from firmware_sim.run import COLUMNS, RECORD_S, run_lockstep
from firmware_sim.scenario import Scenario
from utank_hil.canbus import Mode
from utank_hil.config_files import load_config
from utank_hil.telemetry import read_recording

STORM = load_config(Path("configs/scenarios/storm.yaml"), Scenario)
DURATION_S = 120.0
SETTLE_S = 40.0


@pytest.fixture(scope="module")
def storm() -> tuple[BenchResult, list[tuple[str, float]]]:
    progress: list[tuple[str, float]] = []
    result = run_bench(
        STORM.model_copy(update={"settle_s": SETTLE_S}),
        BenchOptions(duration_s=DURATION_S),
        lambda name, done_s: progress.append((name, done_s)),
    )
    return result, progress


def test_every_run_has_its_rows_on_one_grid_and_the_passive_one_comes_first(storm) -> None:
    result, progress = storm
    assert [run.name for run in result.runs] == ["passive", *STORM.controllers]
    for run in result.runs:
        assert run.rows.shape == (round(DURATION_S / RECORD_S), len(COLUMNS))
        np.testing.assert_allclose(np.diff(run.column("time_s")), RECORD_S, atol=1e-9)
        assert np.isfinite(run.rows).all()
        assert run.refused_commands == 0
    assert result.duration_s == DURATION_S
    assert {name for name, _ in progress} == {run.name for run in result.runs}
    assert max(done_s for _, done_s in progress) <= DURATION_S


def test_all_runs_are_in_the_same_waves_and_those_are_the_scenarios(storm) -> None:
    result, _ = storm
    time_s = result.runs[0].column("time_s")
    moment = STORM.wave_moment(STORM.seed).at(time_s)
    for run in result.runs:
        np.testing.assert_allclose(
            run.column("wave_moment_nm"), moment, rtol=0, atol=1e-9 * np.abs(moment).max()
        )


def test_measurements_stand_beside_the_truth_they_were_taken_of(storm) -> None:
    result, _ = storm
    for run in result.runs:
        roll, true = run.column("roll_rad")[10:], run.column("true_roll_rad")[10:]
        # 20 ms of sensor, 10 ms of bus, noise of 2e-4: the error is roll rate times age, and noise
        rate = np.abs(run.column("roll_rate_rad_s")[10:]).max()
        assert np.abs(roll - true).max() < rate * 0.04 + 5 * 2e-4
        level = (run.column("starboard_level_m") - run.column("port_level_m"))[10:] / 2
        assert np.abs(level - run.column("true_level_m")[10:]).max() < 0.1


def test_armed_runs_quiet_the_ship_and_the_passive_one_holds_zero_pressure(storm) -> None:
    result, _ = storm
    _, (passive, *controlled) = figures(result)
    assert passive.mode == "PASSIVE"
    assert passive.active_share == 0.0
    assert (result.runs[0].column("pressure_command_pa") == 0.0).all()
    assert passive.pump.pressure_peak_pa < 1e3  # what the loop lets through at zero
    for run in controlled:
        assert (run.mode, run.fault) == ("ACTIVE", "NONE")
        assert run.active_share == 1.0
        assert run.roll_below_passive > 0.1
        assert run.pump.power_mean_w > 0


def test_figures_follow_from_the_rows(storm) -> None:
    result, _ = storm
    bare, runs = figures(result)
    skip = round(SETTLE_S / RECORD_S)
    without = result.without_tank_rad[skip:]
    assert bare.rms_rad == pytest.approx(math.sqrt(np.mean(without**2)), rel=1e-12)
    first = result.runs[0].column("true_roll_rad")[skip:]
    for run, told in zip(result.runs, runs, strict=True):
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
    result, _ = storm
    files = write_report(result, tmp_path / "out")
    assert files["picture"].read_bytes().startswith(b"\x89PNG")
    recording = read_recording(files["recording"])
    assert list(recording) == [run.name for run in result.runs]
    for run in result.runs:
        for name in COLUMNS:
            np.testing.assert_allclose(
                recording[run.name][name], run.column(name), rtol=1e-6, atol=1e-6, err_msg=name
            )
    told = json.loads(files["figures"].read_text(), parse_constant=pytest.fail)
    assert told == json.loads(json.dumps(as_json(result, files), allow_nan=False))
    assert [run["name"] for run in told["runs"]] == list(recording)
    assert told["files"]["picture"] == str(files["picture"])


class Unwatched:
    def stopped(self, done_s: float) -> bool:
        return False


def test_same_seed_same_rows_in_any_process_and_another_seed_another_sea(storm) -> None:
    result, _ = storm
    for job, run in zip(jobs_of(STORM, STORM.seed, 20.0), result.runs, strict=True):
        again = run_lockstep(job, Unwatched())
        assert again.rows.tobytes() == run.rows[: len(again.rows)].tobytes()
    other = run_lockstep(jobs_of(STORM, 99, 5.0)[0], Unwatched())
    assert not np.array_equal(
        other.column("wave_moment_nm"), result.runs[0].column("wave_moment_nm")[:100]
    )


def test_unfinished_runs_are_compared_over_the_time_they_had(storm) -> None:
    result, _ = storm
    *whole, last = result.runs
    cut = last.__class__(last.name, last.rows[:1200], last.bus_load, 0, last.energy_j)
    shortened = BenchResult(
        result.scenario, result.mode, result.seed, result.duration_s, result.settle_s,
        result.without_tank_rad, (*whole, cut), result.wall_s,
    )  # fmt: skip
    skip = round(SETTLE_S / RECORD_S)
    passive = result.runs[0].column("true_roll_rad")[skip:1200]
    told = figures(shortened)[1][-1]
    expected = 1 - told.roll.rms_rad / math.sqrt(np.mean(passive**2))
    assert told.roll_below_passive == pytest.approx(expected, rel=1e-9)
