"""Modes, their confidence, and what the best estimator could do."""

from dataclasses import replace

import control
import numpy as np
import pytest
from cramer_rao import cramer_rao
from hypothesis import given
from hypothesis import strategies as st
from roll_plant import FAST_PUMP, SLOW_PUMP, noisy, plant, pulses

from utank_hil.control import ARX
from utank_hil.identification import (
    IdentificationError,
    era,
    markov_parameters,
    modal_confidence,
    modal_parameters,
    okid,
)
from utank_hil.identification.era import _frequency_and_damping_std

pytestmark = pytest.mark.slow

NOISE = 0.02


def _true_modes(truth):
    poles = truth.poles_rad_s()
    return np.concatenate([np.abs(poles), -poles.real / np.abs(poles)])


def test_modes_of_the_true_model():
    truth = plant()
    found = modal_parameters(truth.state_space())
    np.testing.assert_allclose(
        np.concatenate([found.frequency_rad_s, found.damping_ratio]), _true_modes(truth), rtol=1e-9
    )


def test_modes_ask_for_a_discrete_model():
    system = plant().state_space()
    system.dt = 0
    with pytest.raises(ValueError, match="discrete"):
        modal_parameters(system)


def test_integrators_dead_poles_and_modes_that_no_output_shows_have_figures_all_the_same():
    a = np.diag([1.0, 0.5, 0.0])
    found = modal_parameters(control.ss(a, np.ones((3, 1)), [[1.0, 0.0, 1.0]], [[0.0]], 0.2))
    assert found.frequency_rad_s.tolist() == [0.0, pytest.approx(5 * np.log(2)), np.inf]
    assert found.damping_ratio.tolist() == [1.0, 1.0, 1.0]


def test_confidence_is_refused_where_poles_do_not_move_to_first_order():
    u = pulses(1)
    result = okid(u, noisy(plant().respond(u, 0 * u), 0.01, 1)[:, :1], 10, sample_time_s=0.2)
    markov = np.zeros_like(result.markov)
    markov[2] = 1.0  # a delay: two poles at zero
    with pytest.raises(IdentificationError, match="order 2 has poles that coincide"):
        modal_confidence(replace(result, markov=markov), 2)


@given(st.floats(-2.0, -0.01), st.floats(0.1, 2.0), st.floats(-1, 1), st.floats(-1, 1))
def test_deviations_of_frequency_and_damping_follow_a_pole_that_moves(
    real, imaginary, to_real, to_imaginary
):
    pole, move = complex(real, imaginary), np.array([to_real, to_imaginary])
    found = _frequency_and_damping_std(pole, np.outer(move, move))
    step = 1e-6
    ahead, behind = (pole + sign * step * complex(*move) for sign in (1, -1))
    of_frequency = (abs(ahead) - abs(behind)) / (2 * step)
    of_damping = (behind.real / abs(behind) - ahead.real / abs(ahead)) / (2 * step)
    assert found == pytest.approx((abs(of_frequency), abs(of_damping)), abs=1e-6)


@pytest.mark.evidence
@pytest.mark.parametrize("limits", [FAST_PUMP, SLOW_PUMP])
def test_delta_method_is_the_spread_of_redrawn_coefficients(limits):
    # draws from the coefficients' own distribution, each through recursion and ERA
    u, truth = pulses(1, limits), plant()
    result = okid(u, noisy(truth.respond(u, 0 * u), NOISE, 1), 25, sample_time_s=0.2)
    stated = modal_confidence(result, 4)
    p, m = 25, 2
    gram = np.triu(result.gram) + np.triu(result.gram, 1).T
    inputs = np.arange(p + 1) * 3
    draws = []
    rng = np.random.default_rng(0)
    sigma = np.sqrt(np.diag(result.residual_covariance))  # nearly uncorrelated
    roots = []
    for j in range(m):
        information = gram.copy()
        information[inputs, inputs] += result.penalty[j]
        roots.append(np.linalg.inv(np.linalg.cholesky(information)).T)
    for _ in range(150):
        shift = np.column_stack(
            [sigma[j] * roots[j] @ rng.standard_normal(len(gram)) for j in range(m)]
        )
        shift /= result.column_scale[:, None]
        by_lag = np.vstack([np.zeros((m, m)), shift]).reshape(p + 1, 3, m).transpose(0, 2, 1)
        moved = ARX(result.arx.alpha + by_lag[1:, :, :m], result.arx.beta + by_lag[:, :, m:], 0.2)
        found = modal_parameters(
            era(markov_parameters(moved, len(result.markov))[0], 4, sample_time_s=0.2)
        )
        draws.append(np.concatenate([found.frequency_rad_s, found.damping_ratio]))
    spread = np.std(draws, axis=0)
    expected = np.concatenate([stated.frequency_std_rad_s, stated.damping_ratio_std])
    np.testing.assert_allclose(expected, spread, rtol=0.3)


def test_data_without_noise_leave_no_doubt():
    u = pulses(1)
    stated = modal_confidence(okid(u, plant().respond(u, 0 * u), 60, sample_time_s=0.2), 4)
    assert stated.frequency_std_rad_s.max() < 1e-10
    low, high = stated.intervals()[0].T
    assert np.all(low <= stated.modes.frequency_rad_s)
    assert np.all(stated.modes.frequency_rad_s <= high)


@pytest.mark.evidence
@pytest.mark.parametrize("runs", [25, pytest.param(120, marks=pytest.mark.evidence)])
def test_bias_variance_and_coverage_against_the_cramer_rao_bound(runs):
    truth, u = plant(), pulses(1)
    clean = truth.respond(u, 0 * u)
    right = _true_modes(truth)
    found, stated = np.empty((runs, 4)), np.empty((runs, 4))
    for run in range(runs):
        confidence = modal_confidence(okid(u, noisy(clean, NOISE, run), 120, sample_time_s=0.2), 4)
        found[run] = np.concatenate(
            [confidence.modes.frequency_rad_s, confidence.modes.damping_ratio]
        )
        stated[run] = np.concatenate([confidence.frequency_std_rad_s, confidence.damping_ratio_std])
    spread = np.std(found, axis=0)
    ratio = spread / cramer_rao(truth, u, NOISE * np.std(clean, axis=0))
    bias = np.abs(np.mean(found, axis=0) - right)
    coverage = np.mean(np.abs(found - right) < 1.96 * stated, axis=0)
    print(f"\nspread / Cramer-Rao {ratio.round(2)}, bias / spread {(bias / spread).round(2)}")
    print(f"stated / spread {(stated.mean(axis=0) / spread).round(2)}, coverage {coverage}")
    assert np.all(ratio > 0.85)  # 120 runs know the spread to 6 %
    assert np.all(ratio < 2.8)
    assert np.all(bias < 0.8 * spread)
    assert np.all(coverage > 0.89)
