"""A run of the bench in lockstep leaves a frame log, and does the same as without one."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from firmware_sim.bench import jobs_of
from firmware_sim.run import run_lockstep
from firmware_sim.scenario import Scenario
from utank_hil.assembly import build_law
from utank_hil.cli import app
from utank_hil.configuration import load_config
from utank_hil.telemetry.frame_log import FrameLog
from utank_hil.telemetry.replay import entries_of, replay
from utank_hil.telemetry.replay_head import causes, recorded_config

STORM = Path("configs/scenarios/storm.yaml")


@pytest.mark.parametrize("name", ["passive", "dpc"])
def test_a_run_is_the_same_with_a_frame_log_which_is_replayed_exactly(
    tmp_path: Path, name: str
) -> None:
    (job,) = (job for job in jobs_of(load_config(STORM, Scenario), 3, 25.0) if job.name == name)
    file = tmp_path / f"{name}.frames"
    logged = run_lockstep(replace(job, frames=file))
    np.testing.assert_array_equal(logged.rows, run_lockstep(job).rows)
    log = FrameLog(file)
    assert log.head["about"]["seed"] == 3
    with recorded_config(log.head) as config:
        law = build_law(config)
        result = replay(entries_of(log.blocks()), config, law)
        assert causes(log.head, config, law, tmp_path) == []
    assert (result.first, result.ticks) == (None, 2500)


def test_in_real_time_the_frame_log_is_that_of_run() -> None:
    result = CliRunner().invoke(app, ["bench", str(STORM), "--realtime", "--frames"])
    assert result.exit_code == 2
    assert "--frames is for lockstep" in result.stderr
