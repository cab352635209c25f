"""A run of the bench leaves a frame log, and does the same as without one."""

import errno
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import yaml
from pydantic import TypeAdapter
from typer.testing import CliRunner

from firmware_sim import comparison
from firmware_sim.bench import jobs_of
from firmware_sim.fault_injection.kinds import AnyFault
from firmware_sim.run import Job, run_in_one_process, run_lockstep
from firmware_sim.scenario import Scenario
from utank_hil.cli import app
from utank_hil.configuration import load_config
from utank_hil.telemetry.frame_comparison import ReplayResult
from utank_hil.telemetry.frame_log import FrameLog, FrameLogWriter
from utank_hil.telemetry.replay import replay_log
from utank_hil.telemetry.replay_head import recorded_config

STORM = Path("configs/scenarios/storm.yaml")


def job_of(name: str, seconds: float, faults: list[dict[str, object]]) -> Job:
    scenario = load_config(STORM, Scenario)
    broken = TypeAdapter(tuple[AnyFault, ...]).validate_python(faults)
    jobs = jobs_of(scenario.model_copy(update={"faults": broken}), 3, seconds)
    return next(job for job in jobs if job.name == name)


def replayed(file: Path) -> ReplayResult:
    """The log, replayed by the configuration in it."""
    log = FrameLog(file)
    assert log.head["about"]["seed"] == 3
    with recorded_config(log.head) as config:
        result, why, law = replay_log(log, config, file.parent)
    assert (why, law.why_not_recorded, law.differences) == ([], "", [])
    return result


@pytest.mark.evidence("passive-faults0", "dpc-faults1")
@pytest.mark.parametrize(
    ("name", "faults"),
    [
        ("passive", []),
        ("dpc", []),
        (
            "dpc",
            [
                {
                    "kind": "offset",
                    "message": "SENSOR_MOTION",
                    "signals": ["roll_rad"],
                    "at_s": 15,
                    "for_s": 1,
                    "by": 0.3,
                },
                {"kind": "hangs", "node": "controller", "at_s": 20, "for_s": 0.2},
                {"kind": "link", "node": "controller", "at_s": 22, "for_s": 0.1, "reason": "down"},
            ],
        ),
    ],
)
def test_a_run_is_the_same_with_a_frame_log_which_is_replayed_exactly(
    tmp_path: Path, name: str, faults: list[dict[str, object]]
) -> None:
    job = job_of(name, 25.0, faults)
    file = tmp_path / f"{name}.frames"
    logged = run_lockstep(replace(job, frames=file))
    np.testing.assert_array_equal(logged.rows, run_lockstep(job).rows)
    result = replayed(file)
    assert (result.first, result.ticks) == (None, 2480 if faults else 2500)


def test_logs_of_one_bench_are_compared_in_the_same_waves_without_the_beginning(
    tmp_path: Path,
) -> None:
    files = [tmp_path / f"{name}.frames" for name in ("passive", "dpc")]
    for file in files:
        job = job_of(file.stem, 4.0, [])
        scenario = job.scenario.model_copy(update={"settle_s": 1.0})
        run_lockstep(replace(job, scenario=scenario, frames=file))
    assert FrameLog(files[0]).head["files"] == {}  # a replay needs no sea
    (each,) = comparison.compare_records(files[0], files[1:])
    assert all(figure.paired for figure in each.figures.values())
    record = comparison.read_record(files[0])
    assert record.columns("passive")["time_s"][0] == pytest.approx(1.0)


def test_a_run_in_real_time_leaves_a_log_that_is_replayed_exactly(tmp_path: Path) -> None:
    file = tmp_path / "dpc.frames"
    run = run_in_one_process(replace(job_of("dpc", 2.0, []), frames=file))
    result = replayed(file)
    assert (result.first, result.ticks) == (None, run.loop.ticks)


@pytest.mark.parametrize(
    "fault", [{"kind": "killed", "for_s": 1}, {"kind": "law", "fails": "leans"}]
)
def test_a_fault_of_the_controller_itself_can_t_be_logged(
    tmp_path: Path, fault: dict[str, object]
) -> None:
    content = yaml.safe_load(STORM.read_text().replace("../", f"{STORM.resolve().parents[1]}/"))
    content["faults"] = [{"kind": "mute", "node": "drive"}, fault]
    file = tmp_path / "broken.yaml"
    file.write_text(yaml.safe_dump(content))
    result = CliRunner().invoke(app, ["bench", str(file), "--frames"])
    assert result.exit_code == 2
    assert f"faults.1: kind {fault['kind']} changes the controller itself" in result.stderr


def test_a_disk_that_fills_up_is_named_and_is_no_failure_of_the_controller(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    job = replace(job_of("passive", 3, []), frames=tmp_path / "passive.frames")

    def full(_writer: FrameLogWriter, _records: object) -> None:
        raise OSError(errno.ENOSPC, "No space left on device", str(job.frames))

    monkeypatch.setattr(FrameLogWriter, "write", full)
    monkeypatch.setattr("firmware_sim.run.FRAME_BLOCK_NS", 1)
    with pytest.raises(OSError, match=r"No space left on device: '.*passive\.frames'"):
        run_lockstep(job)
