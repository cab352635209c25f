"""Refined models: exact slopes, never worse, near the Cramer-Rao bound, ahead in a sea."""

import control
import numpy as np
import pytest
from cramer_rao import cramer_rao
from roll_plant import SAMPLE_TIME_S, jonswap_moment, noisy, plant, pulses, response_error

from utank_hil.identification import era, okid, refine
from utank_hil.identification.refinement import _Modal


def test_slopes_are_finite_differences_for_real_and_complex_poles() -> None:
    rng = np.random.default_rng(1)
    model = _Modal(
        np.array([0.9 + 0.2j, 0.7, 0.5 + 0.6j]),
        rng.standard_normal((3, 2)) + 1j * np.array([[1.0], [0.0], [1.0]]) * rng.random((3, 2)),
        rng.standard_normal((3, 2)) + 1j * np.array([[1.0], [0.0], [-1.0]]) * rng.random((3, 2)),
        rng.standard_normal((2, 2)),
    )
    u = rng.standard_normal((2, 50))
    _, slopes, free = model.signals(u)
    assert len(slopes) == 5 * (1 + 2 + 2) + 4
    assert len(free) == 5
    for i, slope in enumerate(slopes):
        step = np.zeros(len(slopes))
        step[i] = 1e-6
        ahead, _, _ = model.moved(step).signals(u)
        behind, _, _ = model.moved(-step).signals(u)
        np.testing.assert_allclose(slope, (ahead - behind) / 2e-6, atol=1e-6)


def test_response_is_that_of_the_state_space_model() -> None:
    rng = np.random.default_rng(2)
    model = _Modal(
        np.array([0.9 + 0.2j, 0.7]),
        np.array([[1 + 2j, 0.5], [0.3, 0.1]]),
        np.array([[1 - 1j], [2.0]]),
        np.array([[0.1], [0.2]]),
    )
    u = rng.standard_normal((1, 40))
    system = model.state_space(np.array([2.0, 3.0]), np.array([10.0]), SAMPLE_TIME_S)
    response = control.forced_response(system, inputs=10 * u).outputs
    np.testing.assert_allclose(model.signals(u)[0], response / [[2.0], [3.0]], atol=1e-12)


def test_exact_data_stay_exact() -> None:
    u, truth = pulses(1), plant()
    y = truth.respond(u, 0 * u)
    result = okid(u, y, 30)
    assert response_error(refine(era(result.markov, 4), result, u, y).system, truth).max() < 1e-9


def test_regular_wave_and_gaps_are_taken_along() -> None:
    u, truth = pulses(1), plant()
    time_s = np.arange(len(u)) * SAMPLE_TIME_S
    y = noisy(truth.respond(u, 2e7 * np.cos(0.6 * time_s)), 0.01, 1)
    y[900:910] = np.nan
    u[1700] = np.nan
    result = okid(u, y, 60, disturbance_frequencies_rad_s=[0.6])
    refined = refine(era(result.markov, 4), result, u, y)
    assert response_error(refined.system, truth).max() < 0.005
    assert refined.gain >= 0
    right = np.abs(truth.poles_rad_s())
    found = refined.confidence
    assert np.all(np.abs(found.modes.frequency_rad_s - right) < 4 * found.frequency_std_rad_s)


def test_ahead_of_era_in_an_irregular_sea() -> None:
    truth = plant()
    errors = []
    for seed in range(5):
        u = pulses(seed)
        pumped, rolled = truth.respond(u, 0 * u), truth.respond(0 * u, jonswap_moment(2500, seed))
        wave = rolled * np.std(pumped[:, 0]) / np.std(rolled[:, 0])
        y = noisy(pumped + wave, 0.01, seed)
        result = okid(u, y, 120)
        system = era(result.markov, 4)
        refined = refine(system, result, u, y).system
        errors.append([response_error(system, truth)[0], response_error(refined, truth)[0]])
    before, after = np.median(errors, axis=0)
    assert after < 0.7 * before


@pytest.mark.slow
def test_spread_is_near_the_cramer_rao_bound_and_less_than_that_of_era() -> None:
    runs, truth, u, noise = 60, plant(), pulses(1), 0.02
    clean = truth.respond(u, 0 * u)
    poles = truth.poles_rad_s()
    right = np.concatenate([np.abs(poles), -poles.real / np.abs(poles)])
    found, stated = np.empty((runs, 4)), np.empty((runs, 4))
    for run in range(runs):
        y = noisy(clean, noise, run)
        result = okid(u, y, 120)
        modes = refine(era(result.markov, 4), result, u, y).confidence
        found[run] = np.concatenate([modes.modes.frequency_rad_s, modes.modes.damping_ratio])
        stated[run] = np.concatenate([modes.frequency_std_rad_s, modes.damping_ratio_std])
    spread = np.std(found, axis=0)
    ratio = spread / cramer_rao(truth, u, noise * np.std(clean, axis=0))
    bias = np.abs(np.mean(found, axis=0) - right)
    coverage = np.mean(np.abs(found - right) < 1.96 * stated, axis=0)
    print(f"\nspread / Cramer-Rao {ratio.round(2)}, bias / spread {(bias / spread).round(2)}")
    print(f"stated / spread {(stated.mean(axis=0) / spread).round(2)}, coverage {coverage}")
    assert np.all(ratio > 0.8)
    assert np.all(ratio < 1.9)
    assert np.all(bias < 0.4 * spread)
    assert np.all(coverage > 0.89)


def test_parts_that_do_not_belong_together_are_refused() -> None:
    u, truth = pulses(1), plant()
    y = truth.respond(u, 0 * u)
    result = okid(u, y, 10)
    with pytest.raises(ValueError, match="do not belong to a record"):
        refine(era(result.markov, 4), result, u, y[:, 0])
