"""The search for an observer: cost and derivative against other computations, and what it finds."""

import dataclasses
from pathlib import Path

import numpy as np
import pytest
from scipy.linalg import solve_discrete_lyapunov

from utank_hil.analysis.loop.closed_loop import closed_loop_eigenvalues
from utank_hil.analysis.loop.loop_in_sea import LoopInSea, covariance, in_pump_units
from utank_hil.analysis.loop.observer_search import ObserverSearch
from utank_hil.analysis.loop.sea_response import motion_in_sea
from utank_hil.configuration import ControllerConfig, load_config
from utank_hil.control.constrained.design import ConstrainedDesign
from utank_hil.control.sea_model import SeaModel
from utank_hil.dynamics.linear import coupled_model
from utank_hil.sea import EffectiveSlope, Sea, jonswap

PLANT = load_config(Path("configs/controllers/gpc.yaml"), ControllerConfig).plant
UNIT = PLANT.limits.pressure_pa
SPECTRUM = jonswap(4.0, 10.0)
SEA = SeaModel(tuple(SPECTRUM.frequency_hz), tuple(SPECTRUM.density), order=16, floor=1.3e-4)
DESIGN = ConstrainedDesign("constrained_gpc", SEA, slope_noise_rad_rt_s=0.01, heel_std_rad=0.003)
LAW = DESIGN.law(PLANT)
LINEAR = LAW.unlimited()
WEIGHTS = (1.0, 3e-5, 2.6e-4)
NOISE = np.diag(np.square(DESIGN.measurement_std))
SLOWER = dataclasses.replace(
    PLANT, ship=dataclasses.replace(PLANT.ship, stiffness_nm_rad=PLANT.ship.stiffness_nm_rad / 1.3)
)


def loop(plant=PLANT, pump_gain=1.0):
    law = in_pump_units(LINEAR, SEA, UNIT)
    return law, LoopInSea(plant, SEA, law, DESIGN.measured, NOISE, WEIGHTS, pump_gain)


def test_the_covariance_is_that_of_another_solver_and_none_where_it_grows():
    rng = np.random.default_rng(1)
    a = rng.standard_normal((12, 12))
    a *= 0.999 / np.abs(np.linalg.eigvals(a)).max()
    root = rng.standard_normal((12, 3))
    expected = solve_discrete_lyapunov(a, root @ root.T)
    found = covariance(a, root @ root.T)
    np.testing.assert_allclose(found, expected, rtol=1e-7, atol=1e-7 * np.abs(expected).max())
    assert covariance(1.002 * a, root @ root.T) is None


@pytest.mark.parametrize("plant", [PLANT, SLOWER])
def test_the_cost_is_that_of_the_sum_over_components(plant):
    law, found = loop(plant)
    moment = Sea.irregular(SPECTRUM, 1, components=2048).roll_moment(
        plant.ship.stiffness_nm_rad, EffectiveSlope(SEA.effective_slope)
    )
    system = coupled_model(plant.ship, plant.tank)
    motion = motion_in_sea(LINEAR, system, DESIGN.measured, moment, plant.delay_s, plant.lag_s)
    expected = np.dot(
        WEIGHTS,
        np.square([motion.roll_rms_rad, motion.level_rms_m, motion.pressure_rms_pa / UNIT]),
    )
    assert found.cost(law.observer_gain)[0] == pytest.approx(expected, rel=0.05)
    still = motion_in_sea(None, system, DESIGN.measured, moment)
    passive = np.dot(WEIGHTS[:2], np.square([still.roll_rms_rad, still.level_rms_m]))
    assert found.passive_cost == pytest.approx(passive, rel=0.05)


def test_a_ship_that_capsizes_with_her_tank_passive_has_no_cost_to_compare_with():
    """Patti-B with 0.59 of her stiffness: the law's own cost stands in for it."""
    config = load_config(Path("configs/controllers/patti_b_constrained_gpc.yaml"), ControllerConfig)
    own = config.plant
    soft = dataclasses.replace(own.ship, stiffness_nm_rad=own.ship.stiffness_nm_rad / 1.3**2)
    law, sea = config.law.law(own), config.law.sea
    scaled = in_pump_units(law.unlimited(), sea, own.limits.pressure_pa)
    plants = [own, dataclasses.replace(own, ship=soft)]
    costs = [
        LoopInSea(plant, sea, scaled, config.law.measured, NOISE, WEIGHTS).passive_cost
        for plant in plants
    ]
    assert costs[0] > 0
    assert costs[1] is None
    search = ObserverSearch(law, config.law, own, WEIGHTS, 5e-3)
    assert 0 < search.value(scaled.observer_gain)[0] < 10


def test_the_loop_has_the_modes_of_the_sampled_loop():
    law, found = loop(SLOWER, pump_gain=1.2)
    modes = np.linalg.eigvals(found.closed(law.observer_gain))
    sampled = SLOWER.sampled(DESIGN.measured, LINEAR.sample_time_s)
    for mode in closed_loop_eigenvalues(LINEAR, sampled, 1.2):
        assert np.abs(modes - mode).min() < 1e-6


def test_the_derivative_is_that_of_differences():
    search = ObserverSearch(LAW, DESIGN, PLANT, WEIGHTS, 0.05)
    gain = in_pump_units(LINEAR, SEA, UNIT).observer_gain
    _, slope = search.value(gain)
    rng = np.random.default_rng(2)
    for _ in range(3):
        step = 1e-5 * gain * rng.standard_normal(gain.shape)
        change = (search.value(gain + step)[0] - search.value(gain - step)[0]) / 2
        assert change == pytest.approx(float(np.sum(slope * step)), rel=1e-4)


def test_a_few_steps_make_the_gain_better_and_leave_the_heel_alone(monkeypatch):
    monkeypatch.setattr("utank_hil.analysis.loop.observer_search._ITERATIONS", 10)
    search = ObserverSearch(LAW, DESIGN, PLANT, WEIGHTS, 5e-3)
    gain = search.best()
    found = dataclasses.replace(LAW, observer_gain=gain).unlimited()
    before, after = (in_pump_units(law, SEA, UNIT).observer_gain for law in (LINEAR, found))
    assert search.value(after)[0] < 0.95 * search.value(before)[0]
    np.testing.assert_array_equal(gain[-1], LAW.observer_gain[-1])


def test_a_gain_with_which_a_loop_is_unstable_is_worse_than_any():
    search = ObserverSearch(LAW, DESIGN, PLANT, WEIGHTS, 5e-3)
    gain = in_pump_units(LINEAR, SEA, UNIT).observer_gain
    assert search.value(-gain)[0] > 100 * search.value(gain)[0]
