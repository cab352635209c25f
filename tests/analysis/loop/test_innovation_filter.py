"""The filter on the innovations: the convex problem against the law that comes of it."""

import dataclasses
import functools
from pathlib import Path

import numpy as np
import pytest
from scipy.linalg import solve_discrete_lyapunov

from utank_hil.analysis.loop.innovation_filter import (
    InnovationFilter,
    laguerre,
    mean_positive_product,
)
from utank_hil.analysis.loop.margins import GAINS, closed_loop_radius, ship_variants
from utank_hil.analysis.loop.self_tuning import self_tuned
from utank_hil.configuration import ControllerConfig, load_config
from utank_hil.control.constrained.design import ConstrainedDesign, sea_plant
from utank_hil.control.sea_model import SeaModel
from utank_hil.dynamics.linear import STATES
from utank_hil.sea import jonswap

PLANT = load_config(Path("configs/controllers/gpc.yaml"), ControllerConfig).plant
UNIT = PLANT.limits.pressure_pa
SPECTRUM = jonswap(4.0, 10.0)
SEA = SeaModel(tuple(SPECTRUM.frequency_hz), tuple(SPECTRUM.density), order=16, floor=1.3e-4)
DESIGN = ConstrainedDesign("constrained_gpc", SEA, slope_noise_rad_rt_s=0.01, heel_std_rad=0.003)
LAW = DESIGN.law(PLANT).unlimited()
WEIGHTS = (1.0, 3e-5, 2.6e-4)


@functools.cache
def problem():
    return InnovationFilter(LAW, DESIGN, PLANT, WEIGHTS)


def covariance(law):
    """Of `STATES` and command, from the Lyapunov equation of ship, drive, waves and law."""
    whole, process, *_ = sea_plant(SEA, PLANT, sample_time_s=law.sample_time_s)
    rows = [STATES.index(name) for name in DESIGN.measured]
    a, b, c, _, _ = law.matrices()
    by_law = whole.B @ c
    seen, through = whole.C[rows], whole.D[rows] @ c
    closed = np.block([[whole.A, by_law], [b @ seen, a + b @ through]])
    noise = np.zeros_like(closed)
    n = len(whole.A)
    noise[:n, :n] = process
    noise[n:, n:] = b @ np.diag(np.square(DESIGN.measurement_std)) @ b.T
    out = np.vstack([np.hstack([whole.C, whole.D @ c]), np.hstack([np.zeros((1, n)), c])])
    return out @ solve_discrete_lyapunov(closed, noise) @ out.T


def test_prediction_is_that_of_the_loop_s_covariance():
    for law in (LAW, next(problem().laws())):
        found, spread = problem().prediction(law), covariance(law)
        roll, _, level, _, pressure = np.sqrt(np.diag(spread))
        assert found.roll_rad == pytest.approx(roll, rel=2e-3)
        assert found.level_m == pytest.approx(level, rel=2e-3)
        assert found.pressure_pa == pytest.approx(pressure, rel=2e-3)


def test_derivatives_are_those_of_differences():
    search, rng = problem(), np.random.default_rng(0)
    at = 1e-3 * rng.normal(size=search.coefficients)
    gradient, hessian = search.derivatives(at)
    for _ in range(3):
        step = 1e-6 * rng.normal(size=len(at))
        change = (search.value(at + step) - search.value(at - step)) / 2
        assert change == pytest.approx(gradient @ step, rel=1e-4)
        turn = (search.derivatives(at + step)[0] - search.derivatives(at - step)[0]) / 2
        np.testing.assert_allclose(turn, hessian @ step, atol=1e-5 * np.abs(hessian @ step).max())


def test_it_costs_less_than_without_and_no_step_from_it_costs_less():
    def cost(law):
        found = problem().prediction(law)
        size = found.roll_rad, found.level_m, found.pressure_pa / UNIT
        return np.dot(WEIGHTS, np.square(size))

    best = next(problem().laws())
    assert cost(best) < 0.97 * cost(LAW)
    rng = np.random.default_rng(1)
    search = InnovationFilter(LAW, DESIGN, PLANT, WEIGHTS)
    at = search.minimum(np.zeros(search.coefficients))
    for _ in range(20):
        step = 1e-3 * rng.normal(size=len(at))
        assert search.value(at + step) > search.value(at)


def test_the_law_with_it_is_stable_on_all_ships_of_the_grid():
    law = next(problem().laws())
    for _, _, ship in ship_variants(PLANT.ship):
        sampled = dataclasses.replace(PLANT, ship=ship).sampled(DESIGN.measured, law.sample_time_s)
        assert all(closed_loop_radius(law, sampled, gain) < 1 for gain in GAINS)


def test_within_limits_a_law_that_follows_commands_what_the_linear_one_does():
    linear = next(problem().laws())
    law = DESIGN.law(PLANT).following(linear)
    z = np.exp(1j * np.geomspace(1e-3, 3, 50))
    expected = linear.response(z)
    np.testing.assert_allclose(law.response(z), expected, atol=1e-9 * np.abs(expected).max())
    controller, plain = law.controller(), linear.controller()
    rng = np.random.default_rng(3)
    for _ in range(30):
        y = 1e-4 * rng.normal(size=3)
        assert controller.step(y)[0] == pytest.approx(plain.step(y)[0], rel=1e-6, abs=1e-3)
        assert not controller.limited


def test_inputs_changed_in_the_twelfth_digit_do_not_move_the_design():
    rng = np.random.default_rng(4)

    def designed(size):
        def changed(x):
            return x * (1 + size * rng.uniform(-1, 1))

        ship = dataclasses.replace(
            PLANT.ship,
            inertia_kg_m2=changed(PLANT.ship.inertia_kg_m2),
            stiffness_nm_rad=changed(PLANT.ship.stiffness_nm_rad),
        )
        sea = dataclasses.replace(SEA, density_m2_hz=tuple(map(changed, SEA.density_m2_hz)))
        return self_tuned(dataclasses.replace(PLANT, ship=ship), sea)

    one, other = designed(0.0), designed(1e-12)
    assert other.prediction.roll_rad == pytest.approx(one.prediction.roll_rad, rel=1e-9)
    for of in (lambda law: law.observer_gain, lambda law: law.gain):
        gain, moved = (of(found.law.unlimited()) for found in (one, other))
        np.testing.assert_allclose(moved, gain, rtol=0, atol=1e-6 * np.abs(gain).max())


def test_answers_of_the_basis_to_a_pulse_are_orthonormal():
    a, b = laguerre(5, 0.8)
    answers = np.array([np.linalg.matrix_power(a, k) @ b for k in range(400)])
    np.testing.assert_allclose(answers.T @ answers, np.eye(5), atol=1e-9)


def test_mean_of_the_positive_part_of_a_product_is_that_of_draws():
    rng = np.random.default_rng(1)
    for r in (-0.9, 0.0, 0.6):
        x, y = rng.multivariate_normal([0, 0], [[4.0, 6 * r], [6 * r, 9.0]], 400_000).T
        expected = np.maximum(x * y, 0).mean()
        assert mean_positive_product(2.0, 3.0, 6 * r) == pytest.approx(expected, rel=0.02)
