"""The causal bound: exact where theory is, between clairvoyant and causal laws elsewhere."""

import dataclasses

import numpy as np
import pytest
from rolling_ship import SHIP, TANK
from scipy.linalg import solve_discrete_are

from tools.studies.causal_bound import CausalProblem, CausalRun, causal_bound
from utank_hil.analysis.loop.loop_simulation import SensorNoise
from utank_hil.control import DesignPlant, PumpLimits
from utank_hil.control.sea_model import SeaModel
from utank_hil.sea import jonswap

PLANT = DesignPlant(SHIP, TANK, limits=PumpLimits(level_m=4.0))
SPECTRUM = jonswap(4.7, 10.0)
SEA = SeaModel(tuple(SPECTRUM.frequency_hz), tuple(SPECTRUM.density))
PROBLEM = CausalProblem(PLANT, SEA)


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_without_limits_every_record_gives_the_cost_of_the_lqg_law(seed):
    known = PROBLEM.innovations
    a, b, c, d, _ = known.model
    n, states, count = len(a), len(a) - SEA.order, 60
    weight = np.diag([1.0, 0.0, 1e-4, 0.0])
    effort = 1e-4 / 50e3**2 + d.T @ weight @ d
    value = solve_discrete_are(a, b, c.T @ weight @ c, effort, s=c.T @ weight @ d)
    nu = np.random.default_rng(seed).multivariate_normal(
        np.zeros(len(known.covariance)), known.covariance, count
    )
    passive = np.zeros((count + 1, n))
    for k in range(count):
        passive[k + 1] = a @ passive[k] + known.gain @ nu[k]
    state_slope, command_slope, rest = known.increments(value, nu, passive[:-1], states)
    # all in the commands alone, by superposition
    unit = 50e3
    reach = np.zeros((count + 1, n, count))
    for k in range(count):
        reach[k + 1] = a @ reach[k]
        reach[k + 1, :, k] += unit * b[:, 0]
    rows, offset = [unit * np.sqrt(1e-4) / 50e3 * np.eye(count)], [np.zeros(count)]
    root = np.sqrt(np.diag(weight))[:, None]
    for k in range(count):
        effect = c @ reach[k]
        effect[:, k] += unit * d[:, 0]
        rows.append(root * effect)
        offset.append(root[:, 0] * (c @ passive[k]))
    end = np.linalg.cholesky(value + 1e-18 * np.eye(n)).T
    rows.append(end @ reach[count])
    offset.append(end @ passive[count])
    matrix, rest_of = np.vstack(rows), np.concatenate(offset)
    slope = -np.einsum("ki,kij->j", state_slope, reach[:-1, :states]) - unit * command_slope
    best = np.linalg.solve(matrix.T @ matrix, -matrix.T @ rest_of - slope / 2)
    cost = np.sum((matrix @ best + rest_of) ** 2) + slope @ best - rest.sum()
    each = np.trace(known.gain.T @ value @ known.gain @ known.covariance)
    assert cost == pytest.approx(count * each, rel=1e-6)


@pytest.mark.evidence
def test_bound_lies_between_clairvoyant_and_passive_and_costs_no_more_with_more_noise():
    bound = causal_bound(PROBLEM, [PROBLEM.run(seed, 120.0) for seed in range(3)])
    assert bound.clairvoyant_rad < bound.causal_rad < bound.passive_rad
    assert 0 < bound.share.mean < 1
    blind = SensorNoise(roll_rad=0.2, roll_rate_rad_s=0.2, level_m=5.0)
    unseen = CausalProblem(PLANT, SEA, blind)
    worse = causal_bound(unseen, [unseen.run(seed, 120.0) for seed in range(3)])
    assert worse.causal_rad > 1.3 * bound.causal_rad


@pytest.mark.evidence
def test_passive_roll_is_that_of_the_records():
    runs = [PROBLEM.run(seed, 200.0).passive for seed in range(6)]
    assert np.sqrt(np.mean(runs)) == pytest.approx(PROBLEM.passive_rad, rel=0.25)


def test_share_is_that_of_the_roll_and_its_interval_that_of_the_records():
    runs = [CausalRun(PROBLEM.passive_rad**2, 0.0, PROBLEM.passive_rad**2 / 4)] * 3
    bound = causal_bound(PROBLEM, runs)
    assert bound.share.mean == pytest.approx(0.5)
    assert bound.share.half_width == pytest.approx(0.0, abs=1e-12)


def test_a_delay_of_a_sample_or_more_is_refused():
    with pytest.raises(ValueError, match="delay_s"):
        CausalProblem(dataclasses.replace(PLANT, delay_s=0.2), SEA)
