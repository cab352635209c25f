"""The main job: the storm hour through all nodes, bus and pump, as ``make bench`` runs it."""

from pathlib import Path

import numpy as np
import pytest

from firmware_sim.bench import jobs_of
from firmware_sim.run import RECORD_S, Run, run_lockstep
from firmware_sim.scenario import Scenario
from utank_hil.canbus import Mode
from utank_hil.configuration import load_config

pytestmark = [pytest.mark.evidence, pytest.mark.timeout(900)]

SCENARIO = load_config(Path("configs/scenarios/storm.yaml"), Scenario)


@pytest.fixture(scope="module")
def runs() -> dict[str, Run]:
    """The whole hour."""
    assert SCENARIO.duration_s == 3600
    jobs = jobs_of(SCENARIO, SCENARIO.seed, SCENARIO.duration_s)
    return {job.name: run_lockstep(job) for job in jobs if job.name in ("passive", "dpc", "gpc")}


def judged(run: Run, column: str) -> np.ndarray:
    return run.column(column)[round(SCENARIO.settle_s / RECORD_S) :]


def roll_rms(run: Run) -> float:
    return float(np.sqrt(np.mean(judged(run, "true_roll_rad") ** 2)))


@pytest.mark.parametrize("name", ["dpc", "gpc"])
def test_armed_controller_rolls_a_quarter_less_than_the_passive_tank(
    runs: dict[str, Run], name: str
) -> None:
    assert roll_rms(runs[name]) <= 0.75 * roll_rms(runs["passive"])
    # in charge all the time, within what the pump may do
    assert (judged(runs[name], "mode") == Mode.ACTIVE).all()
    limits = SCENARIO.controllers[name].limits
    command_pa = runs[name].column("pressure_command_pa")
    assert np.abs(command_pa).max() <= limits.pressure_pa
    assert np.abs(np.diff(command_pa)).max() <= limits.rate_pa_s * RECORD_S * (1 + 1e-9) + 8.0
    assert runs[name].refused_commands == 0


def test_passive_tank_rolls_as_linear_theory_says(runs: dict[str, Run]) -> None:
    # from the bands of the spectrum; one hour of a lightly damped ship scatters by some 5 %
    assert np.rad2deg(roll_rms(runs["passive"])) == pytest.approx(2.210, rel=0.12)
    assert not runs["passive"].column("pressure_command_pa").any()
