"""LQR against python-control and by value iteration; the Kalman filter by its innovation."""

import control
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from rolling_ship import SHIP, TANK

from utank_hil.analysis.loop.margins import closed_loop_radius
from utank_hil.control.lqg import LQGLaw, design_lqg, design_lqr, kalman_predictor
from utank_hil.dynamics import coupled_model
from utank_hil.dynamics.sampling import LinearModel, sampled_model


def random_model(seed, states=5, inputs=2, outputs=3):
    rng = np.random.default_rng(seed)
    a = rng.normal(size=(states, states))
    a *= 0.95 / np.abs(np.linalg.eigvals(a)).max()
    shapes = ((states, inputs), (outputs, states), (outputs, inputs))
    return LinearModel(a, *(rng.normal(size=shape) for shape in shapes), 0.2)


def positive(rng, size):
    root = rng.normal(size=(size, size))
    return root @ root.T + 0.1 * np.eye(size)


@given(st.integers(0, 10_000))
def test_gain_is_that_of_python_control(seed):
    model, rng = random_model(seed), np.random.default_rng(seed)
    q, r, n = positive(rng, 5), positive(rng, 2), 0.05 * rng.normal(size=(5, 2))
    expected, _, _ = control.dlqr(model.A, model.B, q, r, n)
    np.testing.assert_allclose(design_lqr(model, q, r, n).gain, expected, rtol=1e-7, atol=1e-9)


def test_gain_of_the_thesis_weights_on_the_ship_is_that_of_python_control():
    model = sampled_model(coupled_model(SHIP, TANK)[:, "pressure_pa"], 0.2)
    expected, _, _ = control.dlqr(model, 1e14 * np.eye(4), np.eye(1))
    law = design_lqr(model, 1e14)
    np.testing.assert_allclose(law.gain, expected, rtol=1e-6)
    assert law.sample_time_s == 0.2


def test_innovation_is_white_on_the_nominal_model_and_has_the_foretold_covariance():
    model, rng = random_model(1), np.random.default_rng(1)
    process, measurement = 0.01 * positive(rng, 5), 0.1 * positive(rng, 3)
    law = design_lqg(model, design_lqr(model, 1.0, 1.0), process, measurement)
    controller = law.controller()
    steps = 20_000
    w = rng.multivariate_normal(np.zeros(5), process, steps)
    v = rng.multivariate_normal(np.zeros(3), measurement, steps)
    x, u, innovations = np.zeros(5), np.zeros(2), np.zeros((steps, 3))
    for k in range(steps):
        y = model.C @ x + model.D @ u + v[k]
        x = model.A @ x + model.B @ u + w[k]
        u = controller.step(y)
        innovations[k] = controller.innovation
    white = innovations[200:] @ np.linalg.inv(np.linalg.cholesky(law.innovation_covariance)).T
    count = len(white)
    np.testing.assert_allclose(white.T @ white / count, np.eye(3), atol=5 / np.sqrt(count))
    for lag in range(1, 20):
        np.testing.assert_allclose(white[lag:].T @ white[:-lag] / count, 0, atol=5 / np.sqrt(count))


def test_predictor_error_covariance_solves_its_riccati_equation():
    model, rng = random_model(2), np.random.default_rng(2)
    process, measurement = positive(rng, 5), positive(rng, 3)
    gain, innovation = kalman_predictor(model, process, measurement)
    error = np.eye(5)
    for _ in range(500):
        s = model.C @ error @ model.C.T + measurement
        step = model.A @ error @ model.C.T @ np.linalg.inv(s)
        error = model.A @ error @ model.A.T - step @ s @ step.T + process
    np.testing.assert_allclose(innovation, s, rtol=1e-9)
    np.testing.assert_allclose(gain, step, rtol=1e-9)


def test_loop_has_the_poles_of_regulator_and_predictor_and_no_others():
    # separation: holds with feed-through, in the timing of the loop
    model = random_model(4)
    regulator = design_lqr(model, 1.0, 1.0)
    law = design_lqg(model, regulator, np.eye(5), np.eye(3))
    a, b, c, d, _ = model
    expected = np.concatenate(
        [np.linalg.eigvals(a - b @ law.gain), np.linalg.eigvals(a - law.observer_gain @ c)]
    )
    ac, bc, cc, _, _ = law.matrices()
    loop = np.block([[a, b @ cc], [bc @ c, ac + bc @ d @ cc]])
    found = np.linalg.eigvals(loop)
    np.testing.assert_allclose(np.poly(found), np.poly(expected), rtol=1e-8, atol=1e-10)
    assert closed_loop_radius(law, model) == pytest.approx(np.abs(expected).max())


def small_law(seed=5):
    model = random_model(seed)
    return design_lqg(model, design_lqr(model, 1.0, 1.0), np.eye(5), np.eye(3))


def test_steps_follow_the_state_space_form_of_the_law():
    law = small_law()
    a, b, c, _, _ = law.matrices()
    controller, state = law.controller(), np.zeros(5)
    for y in np.random.default_rng(0).normal(size=(100, 3)):
        state = a @ state + b @ y
        np.testing.assert_allclose(controller.step(y), c @ state, rtol=1e-9)


def test_frequency_response_is_that_of_the_state_space_form():
    law = small_law()
    z = np.exp(1j * np.array([0.01, 0.3, 2.0, np.pi]))
    system = control.ss(*law.matrices())
    for point, response in zip(z, law.response(z), strict=True):
        np.testing.assert_allclose(response, system(point, squeeze=False), rtol=1e-9)


def test_constant_reference_is_reached_where_inputs_suffice():
    model = random_model(7, inputs=2, outputs=2)
    law = design_lqg(model, design_lqr(model, 1.0, 1.0), np.eye(5), np.eye(2))
    controller, x, u = law.controller(), np.zeros(5), np.zeros(2)
    target = np.array([0.7, -0.3])
    for _ in range(2000):
        y = model.C @ x + model.D @ u
        x = model.A @ x + model.B @ u
        u = controller.step(y, target)
    np.testing.assert_allclose(y, target, atol=1e-8)


def test_nothing_is_solved_in_a_step(monkeypatch):
    controller = small_law().controller()

    def refuse(*_):
        raise AssertionError("solved in a step")

    for name in ("solve", "pinv", "inv", "lstsq"):
        monkeypatch.setattr(np.linalg, name, refuse)
    controller.step(np.ones(3), np.ones(3))


def test_model_with_an_integrator_is_controlled_but_takes_no_reference():
    a = np.array([[1.0, 0.2], [0.0, 0.9]])
    model = LinearModel(a, np.array([[0.0], [0.2]]), np.eye(2)[:1], np.zeros((1, 1)), 0.2)
    law = design_lqg(model, design_lqr(model, 1.0, 1.0), np.eye(2), np.eye(1))
    controller, x, u = law.controller(), np.array([1.0, 0.0]), np.zeros(1)
    for _ in range(200):
        y = model.C @ x
        x = a @ x + model.B @ u
        u = controller.step(y)
    assert abs(x[0]) < 1e-6
    with pytest.raises(ValueError, match="reference: the law's model has a pole at 1"):
        controller.step(y, np.ones(1))


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ((np.eye(4), 1.0), "state_weight must have shape"),
        ((np.triu(np.ones((5, 5))), 1.0), "state_weight must be symmetric"),
        ((1.0, -np.eye(2)), "input_weight"),
        ((1.0, np.zeros((2, 2))), "input_weight must be positive"),
        ((1.0, 1.0, np.zeros((2, 5))), "cross_weight must have shape"),
    ],
)
def test_weights_that_do_not_fit_are_refused_by_name(arguments, message):
    with pytest.raises(ValueError, match=message):
        design_lqr(random_model(0), *arguments)


def test_continuous_model_and_foreign_regulator_are_refused():
    with pytest.raises(ValueError, match="discrete"):
        design_lqr(coupled_model(SHIP, TANK), 1.0)
    with pytest.raises(ValueError, match="other states"):
        design_lqg(
            random_model(0, states=4), design_lqr(random_model(0), 1.0), np.eye(4), np.eye(3)
        )


def test_law_is_frozen():
    with pytest.raises(AttributeError):
        small_law().gain = np.zeros((2, 5))
    assert isinstance(small_law(), LQGLaw)
