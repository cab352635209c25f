"""Modes of identified models, and what the best estimator could do."""

import control
import numpy as np
import pytest
from cramer_rao import cramer_rao
from roll_plant import noisy, plant, pulses, realized

from utank_hil.identification import modal_parameters, okid

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


@pytest.mark.evidence
@pytest.mark.parametrize("runs", [25, pytest.param(120, marks=pytest.mark.evidence)])
def test_bias_and_variance_against_the_cramer_rao_bound(runs):
    truth, u = plant(), pulses(1)
    clean = truth.respond(u, 0 * u)
    right = _true_modes(truth)
    found = np.empty((runs, 4))
    for run in range(runs):
        model = okid(u, noisy(clean, NOISE, run), 120, sample_time_s=0.2)
        modes = modal_parameters(realized(model, 4))
        found[run] = np.concatenate([modes.frequency_rad_s, modes.damping_ratio])
    spread = np.std(found, axis=0)
    ratio = spread / cramer_rao(truth, u, NOISE * np.std(clean, axis=0))
    bias = np.abs(np.mean(found, axis=0) - right)
    print(f"\nspread / Cramer-Rao {ratio.round(2)}, bias / spread {(bias / spread).round(2)}")
    assert np.all(ratio > 0.85)  # 120 runs know the spread to 6 %
    assert np.all(ratio < 2.8)
    assert np.all(bias < 0.8 * spread)
