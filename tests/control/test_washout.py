"""Washout: no steady pressure for a steady list, the law untouched where the waves are."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from shipped_designs import LQG_ROLL_RATE_LEVEL

from utank_hil.control import DesignPlant, PredictiveLaw, WashoutLaw
from utank_hil.dynamics import RollShip, Tank

LAW = PredictiveLaw(
    np.array([0.3, -0.2]).reshape(2, 1, 1),
    np.array([[[1e6, 2e4]], [[-3e6, 1e4]]]),
    np.zeros((1, 1, 2)),
    0.2,
)
WASHED = WashoutLaw(LAW, 0.03)
SHIP = RollShip(1.9275e9, 1.9275e9 * 0.25, 4.87e7)
LQG = LQG_ROLL_RATE_LEVEL.law(
    DesignPlant(SHIP, Tank(17.1, 4.88, 17.11, 6.22, lz_m=1.83, damping_ratio=0.10))
)


def random_law(seed, taps, inputs, outputs):
    rng = np.random.default_rng(seed)
    return PredictiveLaw(
        rng.normal(size=(taps, inputs, inputs)) * 0.5 / (taps * inputs),
        rng.normal(size=(taps, inputs, outputs)),
        rng.normal(size=(4, inputs, outputs)),
        0.2,
    )


def assert_equal_to_the_plain_form(law, seed, steps, size_pa):
    """The law on outputs that the low-pass of the module's text is taken off, step by step.

    Some commands are replaced, some steps have a reference.
    """
    rng = np.random.default_rng(seed)
    inputs, outputs = law.law.matrices().D.shape
    washed, plain, mean = law.controller(), law.law.controller(), np.zeros(outputs)
    for k in range(steps):
        y = rng.normal(size=outputs) + 3.0  # a list
        mean = mean + law.share * (y - mean)
        reference = rng.normal(size=outputs) if k % 5 == 2 else None
        u, expected = washed.step(y, reference), plain.step(y - mean, reference)
        np.testing.assert_allclose(u, expected, rtol=1e-8, atol=1e-8 * size_pa)
        if k % 3 == 0:
            left = size_pa * rng.normal(size=inputs)
            washed.applied(left)
            plain.applied(left)


@given(
    seed=st.integers(0, 1000),
    taps=st.integers(1, 6),
    inputs=st.integers(1, 3),
    outputs=st.integers(1, 3),
    corner_rad_s=st.floats(1e-3, 5.0),
)
def test_predictive_law_with_the_washout_folded_in_is_the_plain_form(
    seed, taps, inputs, outputs, corner_rad_s
):
    law = WashoutLaw(random_law(seed, taps, inputs, outputs), corner_rad_s)
    assert_equal_to_the_plain_form(law, seed, 60, 1.0)


def test_folded_predictive_law_stays_the_plain_form_over_many_turns_of_its_memory():
    assert_equal_to_the_plain_form(WASHED, 1, 3000, 1e6)


@pytest.mark.parametrize("corner_rad_s", [0.02, 1.0])
def test_lqg_law_with_the_washout_folded_in_is_the_plain_form(corner_rad_s):
    assert_equal_to_the_plain_form(WashoutLaw(LQG.law, corner_rad_s), 2, 500, 1e6)


def test_innovation_of_a_washed_lqg_law_is_that_of_the_outputs_without_their_mean():
    washed, plain, mean = LQG.controller(), LQG.law.controller(), np.zeros(3)
    for y in np.random.default_rng(3).normal(size=(50, 3)):
        mean = mean + LQG.share * (y - mean)
        washed.step(y)
        plain.step(y - mean)
    np.testing.assert_allclose(washed.innovation, plain.innovation, rtol=1e-8)


def test_steady_list_ends_in_zero_pressure():
    controller, plain = WASHED.controller(), LAW.controller()
    for _ in range(3000):
        u, other = controller.step(np.array([0.05, 0.4])), plain.step(np.array([0.05, 0.4]))
        controller.applied(u)
    assert abs(u[0]) < 0.01
    assert abs(other[0]) > 1e3


def test_response_and_matrices_are_those_of_the_stepped_controller():
    y = np.random.default_rng(0).normal(size=(80, 2))
    controller = WASHED.controller()
    stepped = np.array([controller.step(sample)[0] for sample in y])
    a, b, c, d, _ = WASHED.matrices()
    x, by_state = np.zeros(len(a)), []
    for sample in y:
        x = a @ x + b @ sample  # u(k + 1) from y(k): the model's output one ahead
        by_state.append((c @ x)[0])
    np.testing.assert_allclose(by_state, stepped, rtol=1e-9)
    z = np.exp(1j * np.array([0.001, 0.1, 2.0]))
    for point, response in zip(z, WASHED.response(z), strict=True):
        expected = c @ np.linalg.solve(point * np.eye(len(a)) - a, b) + d
        np.testing.assert_allclose(response, expected, rtol=1e-9)


def test_wave_frequencies_pass_and_steady_values_do_not():
    z = np.exp(0.2j * np.array([1e-5, 0.5]))
    ratio = WASHED.response(z)[:, 0, 0] / LAW.response(z)[:, 0, 0]
    assert abs(ratio[0]) < 1e-3
    assert abs(ratio[1] - 1) < 0.07


def test_corner_must_be_positive():
    with pytest.raises(ValueError, match="corner_rad_s"):
        WashoutLaw(LAW, 0.0)
