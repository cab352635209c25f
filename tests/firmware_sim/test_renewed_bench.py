"""A self-tuned law is renewed on the bench, the same each time, and replayed frame by frame."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from firmware_sim.bench import jobs_of
from firmware_sim.run import Job, run_lockstep
from firmware_sim.scenario import Scenario
from firmware_sim.scenario_sea import JonswapSea
from utank_hil.canbus import Mode, RetuningState
from utank_hil.configuration import ControllerConfig, load_config
from utank_hil.retuning import EstimateSettings
from utank_hil.telemetry.frame_log import FrameLog
from utank_hil.telemetry.replay import replay_log
from utank_hil.telemetry.replay_head import recorded_config

pytestmark = pytest.mark.slow

DESIGN, TRIAL = RetuningState.DESIGN, RetuningState.TRIAL
SCENARIO = load_config(Path("configs/scenarios/storm.yaml"), Scenario)


def job_of(duration_s: float, scenario: Scenario = SCENARIO) -> Job:
    """The shipped configuration, which estimates more often."""
    config = load_config(Path("configs/controllers/self_tuning.yaml"), ControllerConfig)
    often = EstimateSettings(every_s=30.0, renew=True)
    config = config.model_copy(update={"sea_estimate": often})
    scenario = scenario.model_copy(update={"controllers": {"renewed": config}})
    return jobs_of(scenario, scenario.seed, duration_s)[1]


@pytest.mark.evidence
def test_a_renewal_is_the_same_each_time_and_is_replayed_exactly(tmp_path: Path) -> None:
    job = job_of(240.0)
    file = tmp_path / "renewed.frames"
    logged = run_lockstep(replace(job, frames=file))
    assert [event.state for event in logged.retuning] == [DESIGN, TRIAL]
    assert "renewed for Hs" in logged.retuning[-1].reasons[0]
    np.testing.assert_array_equal(logged.rows, run_lockstep(job).rows)
    log = FrameLog(file)
    with recorded_config(log.head) as config:
        result, why, law = replay_log(log, config, tmp_path)
    assert (result.first, result.ticks, why) == (None, 24_000, [])
    assert (law.why_not_recorded, law.differences) == ("", [])


@pytest.mark.evidence
def test_a_peak_of_the_waves_is_not_taken_for_a_ship_of_twice_the_stiffness() -> None:
    """Patti-B in mild waves looked 2.5 times as stiff; the law for that capsized her."""
    scenario = load_config(Path("configs/scenarios/patti_b.yaml"), Scenario)
    sea = scenario.sea
    mild = replace(sea.effective_slope, coefficient=sea.effective_slope.coefficient / 2)
    scenario = scenario.model_copy(update={"sea": sea.model_copy(update={"effective_slope": mild})})
    jobs = jobs_of(scenario, scenario.seed, 640.0)
    passive, law = (run_lockstep(jobs[k]) for k in (0, -1))
    trials = [event for event in law.retuning if event.state is TRIAL]
    assert len(trials) == 3  # the last one by a record that could tell a ship
    assert all("roll period 10.70 s" in event.reasons[0] for event in trials)
    tried = law.between(trials[0].time_ns * 1e-9 + 10.0, 640.0)  # 43 rolls
    assert set(law.column("mode")[tried]) == {Mode.ACTIVE}
    roll, without = (run.column("true_roll_rad")[tried].std() for run in (law, passive))
    assert roll < 0.8 * without


@pytest.mark.evidence
def test_the_first_waves_of_a_swell_condemn_no_law() -> None:
    """Over the first two roll periods it rolls her 1.2 times as much, after that less."""
    swell = JonswapSea(
        kind="jonswap",
        hs_m=2.0,
        tp_s=18.0,
        gamma=6.0,
        effective_slope=SCENARIO.sea.effective_slope,
    )
    scenario = SCENARIO.model_copy(update={"sea": swell, "seed": 4})
    passive = run_lockstep(jobs_of(scenario, 4, 180.0)[0])
    law = run_lockstep(job_of(180.0, scenario))
    assert not law.retuning
    assert set(law.column("mode")[law.between(10.0, 180.0)]) == {Mode.ACTIVE}
    roll, without = (
        run.column("true_roll_rad")[run.between(60.0, 180.0)].std() for run in (law, passive)
    )
    assert roll < 0.85 * without
