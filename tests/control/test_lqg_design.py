"""LQG for ship, tank and sea: what the Kalman filter and the regulator are told."""

from dataclasses import replace

import numpy as np
import pytest
from rolling_ship import SHIP, TANK
from shipped_designs import LQG_ROLL_RATE_LEVEL

from utank_hil.analysis.loop.margins import closed_loop_response, margins
from utank_hil.control import DesignPlant, WashoutLaw, pump_model
from utank_hil.control.lqg_design import LQGDesign, wave_plant
from utank_hil.control.predictive.design import Predictor
from utank_hil.dynamics import RollShip

DESIGN = LQG_ROLL_RATE_LEVEL
MEASURED = DESIGN.predictor.measured


def test_default_is_robust_and_cuts_roll_at_the_peak_of_the_sea():
    law = DESIGN.law(DesignPlant(SHIP, TANK))
    found = margins(law, pump_model(SHIP, TANK, MEASURED), 0.05, 0.1)
    assert found.radius < 1
    assert found.peak_sensitivity < 1.75
    assert found.delay_margin_s > 1.0
    w = np.array([0.55, 0.633, 0.7])
    model = DesignPlant(SHIP, TANK)
    active, _ = closed_loop_response(law, model, MEASURED, w)
    passive, _ = closed_loop_response(None, model, MEASURED, w)
    assert np.abs(active[1, 0]) < 0.6 * np.abs(passive[1, 0])


def test_default_is_stable_for_other_roll_periods_and_gains():
    law = DESIGN.law(DesignPlant(SHIP, TANK))
    for stretch in (0.7, 1.0, 1.3):
        ship = RollShip(1.9275e9, 1.9275e9 * 0.25 / stretch**2, 4.81875e7)
        found = margins(law, pump_model(ship, TANK, MEASURED), 0.07, 0.1)
        assert found.radius < 1
        assert found.gain_low < 0.8
        assert found.gain_high > 1.2


def test_regulator_weighs_the_motions_at_the_samples():
    # value iteration over the whole model gives the same cost-to-go: gain of the summed squares
    law = replace(DESIGN, washout_rad_s=0.0).law(DesignPlant(SHIP, TANK))
    plant, _ = wave_plant(DESIGN.predictor, DesignPlant(SHIP, TANK))
    weight = np.diag(DESIGN.state_weight)
    outputs = np.hstack([plant.C, plant.D])  # of state and input together
    stage = outputs.T @ weight @ outputs
    stage[-1, -1] += 1.0
    step = np.hstack([plant.A, plant.B])
    value = np.zeros((len(plant.A),) * 2)
    for _ in range(4000):
        whole = stage + step.T @ value @ step
        gain = whole[-1:, :-1] / whole[-1, -1]
        value = whole[:-1, :-1] - whole[:-1, -1:] @ gain
    np.testing.assert_allclose(law.gain, gain, rtol=1e-5, atol=1e-6 * np.abs(gain).max())


def test_washout_and_weights_of_a_design():
    predictor = DESIGN.predictor
    assert isinstance(
        LQGDesign(predictor, (1e11, 0, 0, 0), 1.0, 0.02).law(DesignPlant(SHIP, TANK)), WashoutLaw
    )
    cheap = LQGDesign(predictor, (1e11, 0.0, 0.0, 0.0), 1e3).law(DesignPlant(SHIP, TANK))
    dear = LQGDesign(predictor, (1e11, 0.0, 0.0, 0.0), 1.0).law(DesignPlant(SHIP, TANK))
    z = np.exp(1j * np.array([0.12]))
    assert np.linalg.norm(cheap.response(z)) < np.linalg.norm(dear.response(z))


@pytest.mark.parametrize(
    ("weights", "input_weight", "name"),
    [
        ((1.0, 1.0), 1.0, "state_weight"),
        ((1.0, 0.0, 0.0, -1.0), 1.0, "state_weight"),
        ((1.0, 0.0, 0.0, 0.0), 0.0, "input_weight"),
    ],
)
def test_weights_out_of_range_are_refused_by_name(weights, input_weight, name):
    predictor = Predictor(("roll_rad",), (1e-3,), 1, 0.6, 0.02, 0.05, 1e3)
    with pytest.raises(ValueError, match=name):
        LQGDesign(predictor, weights, input_weight)
