"""PD on the level: a virtual tank, at the optimum."""

from dataclasses import replace

import numpy as np
import pytest
from rolling_ship import SHIP, TANK

from utank_hil.analysis.loop.margins import closed_loop_response, margins
from utank_hil.base.ordered_sums import product
from utank_hil.control import DesignPlant
from utank_hil.control.gain import PD_MEASURED, PDDesign, design_pd
from utank_hil.control.optimal_tank import passive_optimum, ship_ratios
from utank_hil.dynamics.linear import coupled_matrices, pump_model


def test_level_in_a_ship_held_still_has_the_optimal_frequency_and_damping():
    law = design_pd(SHIP, TANK)
    ratios, ship_frequency = ship_ratios(SHIP, TANK)
    best = passive_optimum(ratios)
    mass, damping, stiffness = (matrix[1, 1] for matrix in coupled_matrices(SHIP, TANK))
    kp, kd = TANK.reservoir_area_m2 * law.gain[0]
    frequency = np.sqrt((stiffness + kp) / mass)
    assert frequency / ship_frequency == pytest.approx(best.frequency_ratio)
    assert (damping + kd) / (2 * mass * frequency) == pytest.approx(best.damping_ratio)


def test_roll_over_frequency_peaks_at_the_optimum_when_the_loop_is_fast():
    law = design_pd(SHIP, TANK, sample_time_s=1e-3)
    ratios, ship_frequency = ship_ratios(SHIP, TANK)
    model = DesignPlant(SHIP, TANK, delay_s=0.0, lag_s=0.0)
    w = np.linspace(0.3, 0.9, 4000)
    motions, _ = closed_loop_response(law, model, PD_MEASURED, w)
    static_heel = 1 / coupled_matrices(SHIP, TANK)[2][0, 0]
    best = passive_optimum(ratios)
    assert np.abs(motions[:, 0]).max() / static_heel == pytest.approx(best.peak, rel=2e-3)
    passive, _ = closed_loop_response(None, model, PD_MEASURED, w)
    assert np.abs(motions[:, 0]).max() < 0.5 * np.abs(passive[:, 0]).max()
    assert ship_frequency == pytest.approx(0.4985, abs=1e-4)


def test_of_a_quadratic_loss_the_pump_adds_what_is_missing_and_none_in_fast_water():
    rough = replace(TANK, quadratic_loss=8.0)
    plant = DesignPlant(SHIP, rough.linearized(0.5), calm=rough)
    built, whole = PDDesign().build(plant), design_pd(SHIP, rough)
    assert built.at_rest
    np.testing.assert_array_equal(built.linear.gain, whole.gain)
    controller, per_rate = built.controller(), rough.quadratic_loss_pa_per_m2_s2
    spring, loss = whole.gain[0]
    full_m_s = loss / per_rate
    for rate in (0.2 * full_m_s, -0.9 * full_m_s):
        (pressure,) = controller.step(np.array([0.1, rate]))
        own = per_rate * abs(rate) * rate
        assert pressure == pytest.approx(-(spring * 0.1 + loss * rate - own))
    for rate in (1.1 * full_m_s, -5 * full_m_s):
        assert controller.step(np.array([0.0, rate])) == [0.0]
    bare = PDDesign().build(DesignPlant(SHIP, TANK))
    y = np.array([0.1, 3.0])
    expected = -product(design_pd(SHIP, TANK).gain, y)
    np.testing.assert_array_equal(bare.controller().step(y), expected)


def test_a_pump_that_brakes_less_than_the_tank_keeps_driving():
    still = replace(TANK, damping_ratio=0.9, quadratic_loss=8.0)
    controller = PDDesign().build(DesignPlant(SHIP, still)).controller()
    loss = design_pd(SHIP, still).gain[0, 1]
    assert loss < 0
    assert controller.step(np.array([0.0, 3.0])) == pytest.approx([-3.0 * loss])


def test_delay_and_lag_of_the_pump_are_harmless():
    system = pump_model(SHIP, TANK, PD_MEASURED)
    found = margins(design_pd(SHIP, TANK), system, delay_s=0.05, lag_s=0.1)
    assert found.radius < 1
    assert found.peak_sensitivity < 2
    assert found.delay_margin_s > 0.2


@pytest.mark.parametrize("sample_time_s", [-1.0, 0.0, np.nan])
def test_impossible_sample_time_is_refused(sample_time_s):
    with pytest.raises(ValueError, match="sample_time_s must be"):
        design_pd(SHIP, TANK, sample_time_s)
