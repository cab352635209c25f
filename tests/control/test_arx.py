"""ARX model: exact conversion from state space, prediction, simulation, refusal of bad input."""

import control
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from utank_hil.control import ARX


def random_system(seed: int, states: int, outputs: int, inputs: int) -> control.StateSpace:
    rng = np.random.default_rng(seed)
    a = rng.normal(size=(states, states))
    a *= 0.95 / np.abs(np.linalg.eigvals(a)).max()
    return control.ss(
        a,
        rng.normal(size=(states, inputs)),
        rng.normal(size=(outputs, states)),
        rng.normal(size=(outputs, inputs)),
        0.2,
    )


def respond(system, x, u):
    """Response by the plain state recursion from the state `x`."""
    y = []
    for sample in u:
        y.append(system.C @ x + system.D @ sample)
        x = system.A @ x + system.B @ sample
    return np.array(y)


@given(
    seed=st.integers(0, 2**32 - 1),
    states=st.integers(1, 6),
    outputs=st.integers(1, 3),
    inputs=st.integers(1, 3),
    extra=st.integers(0, 3),
)
def test_arx_from_state_space_predicts_its_response_exactly(seed, states, outputs, inputs, extra):
    system = random_system(seed, states, outputs, inputs)
    order = states + extra
    arx = ARX.from_state_space(system, order)
    rng = np.random.default_rng(seed + 1)
    u = rng.normal(size=(60, inputs))
    y = respond(system, rng.normal(size=states), u)  # from an unknown initial state
    error = np.abs(arx.predict(u, y) - y)[order:].max()
    assert error < 1e-6 * np.abs(y).max()


@pytest.mark.parametrize(("outputs", "order"), [(1, 4), (2, 2), (2, 5), (4, 1)])
def test_arx_of_least_order_when_the_outputs_determine_the_state(outputs, order):
    system = random_system(3, 4, outputs, 1)
    arx = ARX.from_state_space(system, order)
    u = np.random.default_rng(0).normal(size=(50, 1))
    y = respond(system, np.ones(4), u)
    np.testing.assert_allclose(arx.predict(u, y)[order:], y[order:], atol=1e-9 * np.abs(y).max())


def test_order_too_low_for_the_states_is_refused_with_the_order_needed():
    with pytest.raises(ValueError, match="use order 3"):
        ARX.from_state_space(random_system(0, 5, 2, 1), 2)


def test_enough_numbers_but_undetermined_state_is_refused():
    # the second output only repeats the first: 2 samples of 2 outputs hold 2 numbers, not 4
    one = random_system(1, 4, 1, 1)
    twice = control.ss(one.A, one.B, np.vstack([one.C, one.C]), np.zeros((2, 1)), 0.2)
    with pytest.raises(ValueError, match="raise the ARX order"):
        ARX.from_state_space(twice, 2)
    assert ARX.from_state_space(twice, 4).outputs == 2


def test_continuous_model_is_refused():
    with pytest.raises(ValueError, match="discrete"):
        ARX.from_state_space(control.ss(-1, 1, 1, 0), 1)


@given(
    seed=st.integers(0, 2**32 - 1),
    order=st.integers(1, 5),
    outputs=st.integers(1, 3),
    inputs=st.integers(1, 3),
)
def test_simulation_equals_the_state_space_form_and_its_own_prediction(
    seed, order, outputs, inputs
):
    rng = np.random.default_rng(seed)
    arx = ARX(
        0.3 * rng.normal(size=(order, outputs, outputs)) / order,
        rng.normal(size=(order + 1, outputs, inputs)),
        0.1,
    )
    u = rng.normal(size=(30, inputs))
    y = arx.simulate(u)
    system = control.ss(*arx.matrices())
    scale = 1e-10 * np.abs(y).max()
    np.testing.assert_allclose(respond(system, np.zeros(order * outputs), u), y, atol=scale)
    np.testing.assert_allclose(arx.predict(u, y), y, atol=scale)


@pytest.mark.parametrize(
    ("alpha", "beta", "sample_time_s", "message"),
    [
        (np.zeros(4), np.zeros((5, 1, 1)), 0.2, r"alpha must have shape \(p, m, m\)"),
        (np.zeros((4, 1, 2)), np.zeros((5, 1, 1)), 0.2, "alpha must have shape"),
        (np.zeros((4, 1, 1)), np.zeros((4, 1, 1)), 0.2, r"beta must have shape .* = \(5, 1, r\)"),
        (np.zeros((4, 1, 1)), np.zeros((5, 1, 0)), 0.2, "at least one input"),
        (np.full((1, 1, 1), np.nan), np.zeros((2, 1, 1)), 0.2, "finite"),
        (np.zeros((1, 1, 1)), np.zeros((2, 1, 1)), 0.0, "sample_time_s"),
    ],
)
def test_bad_coefficients_are_refused_by_name(alpha, beta, sample_time_s, message):
    with pytest.raises(ValueError, match=message):
        ARX(alpha, beta, sample_time_s)


def test_coefficients_cannot_be_changed_afterwards():
    alpha = np.zeros((1, 1, 1))
    arx = ARX(alpha, np.zeros((2, 1, 1)), 0.2)
    alpha[:] = 1
    assert arx.alpha[0, 0, 0] == 0
    with pytest.raises(ValueError, match="read-only"):
        arx.alpha[0] = 1


def test_record_of_the_wrong_shape_is_refused():
    arx = ARX(np.zeros((1, 1, 1)), np.zeros((2, 1, 1)), 0.2)
    with pytest.raises(ValueError, match="u must have shape"):
        arx.predict(np.zeros(5), np.zeros((5, 1)))
    with pytest.raises(ValueError, match="y must have shape"):
        arx.predict(np.zeros((5, 1)), np.zeros((4, 1)))
