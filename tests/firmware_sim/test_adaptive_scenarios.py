"""The shipped adaptive scenarios, whole, in lockstep."""

from functools import cache
from pathlib import Path

import numpy as np
import pytest

from firmware_sim.bench import jobs_of
from firmware_sim.retuning_figures import retuning_figures
from firmware_sim.run import Run, run_lockstep
from firmware_sim.scenario import Scenario
from utank_hil.canbus import RetuningState
from utank_hil.config_files import load_config

SCENARIOS = Path("configs/scenarios")
IDENTIFY, DESIGN, TRIAL, RETUNED = list(RetuningState)[1:5]


class Unwatched:
    def stopped(self, done_s: float) -> bool:
        return False


@cache
def scenario(name: str) -> Scenario:
    return load_config(SCENARIOS / name, Scenario)


def run_of(name: str, controller: str, seed: int = 1) -> Run:
    loaded = scenario(name)
    jobs = {job.name: job for job in jobs_of(loaded, seed, loaded.duration_s)}
    return run_lockstep(jobs[controller], Unwatched())


@cache
def cached_run_of(name: str, controller: str) -> Run:
    return run_of(name, controller)


@pytest.mark.slow
@pytest.mark.parametrize("controller", ["dpc", "dpc-roll", "gpc-roll"])
def test_retuned_after_the_loading_changed_the_ship_rolls_a_third_less(controller: str) -> None:
    run = cached_run_of("adaptive.yaml", controller)
    assert [event.state for event in run.retuning] == [IDENTIFY, DESIGN, TRIAL, RETUNED]
    figures = retuning_figures(run, 60.0)
    assert figures is not None
    assert figures["roll_after_below_before"] > 0.33  # thesis 3.8: about 40 %
    assert run.refused_commands == 0


@pytest.mark.slow
def test_swap_makes_no_larger_steps_than_the_rate_limit_lets() -> None:
    run = cached_run_of("adaptive.yaml", "dpc")
    rate = scenario("adaptive.yaml").controllers["dpc"].limits.rate_pa_s
    time_s, command = run.column("time_s"), run.column("pressure_command_pa")
    swap_ns = run.retuning[2].time_ns
    around = np.abs(time_s - swap_ns * 1e-9) < 5.0
    slope = np.abs(np.diff(command[around])) / np.diff(time_s[around])
    assert slope.max() <= rate * (1 + 1e-9)
    # and it is no bump: not steeper than the old law at its steepest
    before = np.abs(np.diff(command[(time_s > 100) & (time_s < 190)])) / 0.05
    assert slope.max() <= before.max() * (1 + 1e-9)


@pytest.mark.slow
def test_retuning_in_lockstep_is_the_same_bit_for_bit() -> None:
    first, second = cached_run_of("adaptive.yaml", "gpc-roll"), run_of("adaptive.yaml", "gpc-roll")
    assert first.retuning == second.retuning
    assert np.array_equal(first.rows, second.rows, equal_nan=True)


@pytest.mark.slow
def test_load_change_in_a_storm_is_noticed_and_retuned_for() -> None:
    run = cached_run_of("load_change.yaml", "gpc")
    changed_ns = scenario("load_change.yaml").actual_from_s * 1e9
    states = [event.state for event in run.retuning]
    assert states[:4] == [IDENTIFY, DESIGN, TRIAL, RETUNED]
    assert "ship has changed" in run.retuning[0].reasons[0]
    assert changed_ns < run.retuning[0].time_ns < changed_ns + 900e9
    assert run.refused_commands == 0


def test_run_without_retuning_has_no_figures_of_it() -> None:
    run = Run("x", np.zeros((5, 3)), 0.0, 0, 0.0)
    assert retuning_figures(run, 60.0) is None
