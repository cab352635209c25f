"""The roll budget of docs/monitors.md: how soon a fault has to be found, from the ship alone."""

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import yaml
from judged_rows import CAMPAIGN, GOOD, said

from firmware_sim.fault_campaign.own_ship import RollBudget
from firmware_sim.fault_campaign.verdict import judged
from utank_hil.configuration import ControllerConfig, load_config
from utank_hil.dynamics.linear import state_matrices
from utank_hil.dynamics.sampling import transition_and_step
from utank_hil.safety.monitors.thresholds import thresholds_of

ROOT = Path(__file__).resolve().parents[2]
STEP_S, HORIZON_S, RAMP_S, SHARE = 0.02, 60.0, 1.0, 0.25
BUDGET_S = 7.5
FOUND_BY_BUDGET = {"rate-stuck", "roll-stuck", "motion-stuck", "one-gauge-stuck", "levels-stuck",
                   "roll-sign-flipped", "rate-sign-flipped", "replay-160-ms", "replay-1600-ms",
                   "naval-roll-sign-flipped", "naval-levels-stuck"}  # fmt: skip


def time_to_find_s(name, *, unconfirmed=False):
    """After which pressure at its limit, in the worst phase, has spent the budget."""
    config = load_config(ROOT / f"configs/controllers/{name}.yaml", ControllerConfig)
    a, b = state_matrices(config.vessel.ship, config.vessel.tank)
    transition, step = transition_and_step(a, b[:, :1], STEP_S)
    answers, state = [], step[:, 0]
    for _ in range(round(HORIZON_S / STEP_S)):
        answers.append(abs(state[0]))
        state = transition @ state
    pressure_pa = config.limits.pressure_pa
    if unconfirmed:
        found = thresholds_of(config.plant, config.safety.roll_limit_rad, config.sensors)
        pressure_pa *= found.unconfirmed_share
    sums_rad = pressure_pa * np.concatenate([[0.0], np.cumsum(answers)])
    within = (
        k
        for k in range(1, len(sums_rad))
        if np.max(sums_rad[k:] - sums_rad[:-k]) > SHARE * config.safety.roll_limit_rad
    )
    return next(within, math.inf) * STEP_S - RAMP_S / 2


@pytest.mark.parametrize(
    ("name", "least_s", "most_s"),
    [
        ("gpc", BUDGET_S, 8.5),
        ("naval_constrained_gpc", BUDGET_S, 8.5),
        ("patti_b_constrained_gpc", -0.5, 0.0),  # no monitor is fast enough
    ],
)
def test_the_budget_is_what_the_page_says(name, least_s, most_s):
    assert least_s <= time_to_find_s(name) <= most_s


@pytest.mark.parametrize("name", ["gpc", "naval_constrained_gpc"])
def test_a_fault_that_halves_the_pressure_may_be_found_later(name):
    """By the convolution of the answer with the pressure that is allowed."""
    config = load_config(ROOT / f"configs/controllers/{name}.yaml", ControllerConfig)
    budget = RollBudget.of(config)
    assert budget.found_s(math.inf) == pytest.approx(time_to_find_s(name), abs=2 * STEP_S)
    a, b = state_matrices(config.vessel.ship, config.vessel.tank)
    transition, step = transition_and_step(a, b[:, :1], STEP_S)
    answers, state = [], step[:, 0]
    for _ in range(round(HORIZON_S / STEP_S)):
        answers.append(abs(state[0]))
        state = transition @ state

    def added_share(full_s, found_s):
        steps = [round(each / STEP_S) for each in (full_s, found_s - full_s + RAMP_S / 2)]
        pressure_pa = np.repeat([1.0, 0.5], steps) * config.limits.pressure_pa
        return np.convolve(answers, pressure_pa).max() / (SHARE * config.safety.roll_limit_rad)

    for full_s in (0.0, 1.0, 4.0):
        found_s = budget.found_s(full_s)
        assert found_s > time_to_find_s(name) + 1
        assert added_share(full_s, found_s - STEP_S) <= 1 < added_share(full_s, found_s + STEP_S)


def test_an_own_ship_has_the_time_of_her_own_budget():
    rows = CAMPAIGN.on(CAMPAIGN.setups["pump"].scenario, CAMPAIGN.setups["pump"].controller)
    row = next(each for each in rows.rows if each.id == "rate-stuck")
    ramp = said("rate-stuck", replace(GOOD, code="DRIFT", found=9000.0, zero=9500.0, full=900.0))
    assert judged(rows, row, [ramp])["verdict"] == "pass"
    for late in (replace(ramp, full=8900.0), replace(ramp, found=18.5e3, zero=19e3)):
        told = judged(rows, row, [late])
        assert told["verdict"] == "fail"
        limit_ms = 1e3 * RollBudget.of(rows.setups["pump"].config).found_s(late.full / 1e3)
        assert told["limit_ms"] == limit_ms
        assert f"found after {late.found:.0f} ms, {limit_ms:.0f} allowed" in told["problems"][0]


@pytest.mark.parametrize(
    ("name", "least_s"),
    [("gpc", 50.0), ("naval_constrained_gpc", HORIZON_S), ("patti_b_constrained_gpc", HORIZON_S)],
)
def test_signs_that_were_wrong_from_the_start_have_time(name, least_s):
    """Eleven seconds are the longest that they take to be found."""
    assert time_to_find_s(name, unconfirmed=True) >= least_s


def test_the_rows_that_no_faster_monitor_watches_have_the_limit_of_the_budget():
    campaign = yaml.safe_load((ROOT / "configs/faults/campaign.yaml").read_text())
    limits = {row["id"]: row["limit"].get("found_ms") for row in campaign["rows"] if "limit" in row}
    assert {limits[row] for row in FOUND_BY_BUDGET} == {1e3 * BUDGET_S}
    follow = {row.id for row in CAMPAIGN.rows if row.limit.follows == "roll_budget"}
    assert follow == {"motion-zero", *(row for row in FOUND_BY_BUDGET if "naval" not in row)}
