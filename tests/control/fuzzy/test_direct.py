"""Direct adaptive fuzzy laws: the Lyapunov inequality of their proofs, and what is learnt."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from utank_hil.control.fuzzy.adaptive import RobustFuzzy
from utank_hil.control.fuzzy.indirect import SmallGainFuzzy
from utank_hil.control.fuzzy.law import ErrorDynamics, FuzzyBasis

ERROR = ErrorDynamics(0.8, 0.6, 2.5)
RANGES = (0.5, 0.5)
BASIS = FuzzyBasis(RANGES)
SMALL_GAIN = SmallGainFuzzy(
    ERROR, RANGES, 1.0, gamma=0.9, rho=0.4, adaptation=0.3, leakage=0.2, initial=0.1
)
ROBUST = RobustFuzzy(
    ERROR,
    RANGES,
    1.0,
    gamma=0.9,
    epsilon=0.05,
    adaptation=(0.3, 0.2),
    leakage=(0.2, 0.1),
    initial=(0.1, 0.2),
)

# an unknown plant of the class: f a Takagi-Sugeno system, g bounded below, d bounded
_RNG = np.random.default_rng(0)
CONSTANTS = 0.2 * _RNG.normal(size=9)
SLOPES = 0.8 * _RNG.normal(size=(9, 2))
LEAST_GAIN, DISTURBANCE = 0.5, 0.3


def plant(x, u, d):
    f = BASIS(x) @ (CONSTANTS + SLOPES @ x)
    gain = LEAST_GAIN * (1 + np.sin(3 * x[0]) ** 2)
    return np.array([x[1], f + gain * u + DISTURBANCE * d])


def test_lyapunov_matrix_solves_its_equation():
    k1, k2 = ERROR.gains
    a, p = np.array([[0.0, 1.0], [-k1, -k2]]), ERROR.lyapunov
    np.testing.assert_allclose(a.T @ p + p @ a, -2.5 * np.eye(2), atol=1e-12)
    assert np.linalg.eigvalsh(p).min() > 0


def law_at(law, x, parameters):
    """Acceleration and rates of the parameters, written out from the equations of the source."""
    s = ERROR.lyapunov[1] @ x
    square = float(BASIS(x) @ BASIS(x))
    u, drives = law.answer(parameters, s, square, 1 + x @ x + np.sqrt(square))
    rates = [
        gamma * (drive - sigma * (value - start))
        for (gamma, sigma), drive, value, start in zip(
            law.rates, drives, parameters, law.start, strict=True
        )
    ]
    return u, rates


states = st.tuples(st.floats(-1, 1), st.floats(-1, 1)).map(np.array)


def slopes_norm():
    # f + k' e = xi A_0 + xi (A' + 1 k') e because the basis sums to one
    return np.linalg.norm(SLOPES + np.array(ERROR.gains), 2)


BOUND = np.abs(CONSTANTS).max() + DISTURBANCE


@given(states, st.floats(0, 20), st.floats(-1, 1))
def test_small_gain_law_meets_its_lyapunov_inequality_everywhere(x, gain, d):
    law = SMALL_GAIN
    p = ERROR.lyapunov
    u, (gain_rate,) = law_at(law, x, (gain,))
    ideal = max(slopes_norm() ** 2, BOUND**2) / LEAST_GAIN
    value = x @ p @ x / 2 + LEAST_GAIN / (2 * law.adaptation) * (gain - ideal) ** 2
    fall = x @ p @ plant(x, u, d) + LEAST_GAIN / law.adaptation * (gain - ideal) * gain_rate
    d1 = LEAST_GAIN * law.leakage * (ideal - law.initial) ** 2 / 2 + law.rho**2
    c1 = min((ERROR.q - 2) / np.linalg.eigvalsh(p).max(), law.leakage * law.adaptation)
    assert fall <= -c1 * value + d1 + 1e-9
    if value > d1 / c1:
        assert fall < 0


@given(states, st.floats(0, 20), st.floats(0, 5), st.floats(-1, 1))
def test_robust_law_meets_its_lyapunov_inequality_everywhere(x, gain, bound, d):
    law = ROBUST
    p = ERROR.lyapunov
    u, (gain_rate, bound_rate) = law_at(law, x, (gain, bound))
    ideal_gain, ideal_bound = slopes_norm() ** 2 / LEAST_GAIN, BOUND / LEAST_GAIN
    g1, g2 = law.adaptation
    value = (
        x @ p @ x / 2
        + LEAST_GAIN / (2 * g1) * (gain - ideal_gain) ** 2
        + LEAST_GAIN / (2 * g2) * (bound - ideal_bound) ** 2
    )
    fall = (
        x @ p @ plant(x, u, d)
        + LEAST_GAIN / g1 * (gain - ideal_gain) * gain_rate
        + LEAST_GAIN / g2 * (bound - ideal_bound) * bound_rate
    )
    s1, s2 = law.leakage
    d1 = (
        LEAST_GAIN
        / 2
        * (
            s1 * (ideal_gain - law.initial[0]) ** 2
            + s2 * (ideal_bound - law.initial[1]) ** 2
            + 2 * law.epsilon
        )
    )
    c1 = min((ERROR.q - 1) / np.linalg.eigvalsh(p).max(), s1 * g1, s2 * g2)
    assert fall <= -c1 * value + d1 + 1e-9
    if value > d1 / c1:
        assert fall < 0


@pytest.mark.slow
@pytest.mark.parametrize("law", [SMALL_GAIN, ROBUST])
def test_stepped_parameters_follow_their_differential_equation(law):
    controller = law.controller()
    x = np.array([0.2, -0.1])
    parameters = law.start
    for _ in range(3000):
        controller.step(x)
    fine = 3000 * law.sample_time_s / 20_000
    for _ in range(20_000):
        _, rates = law_at(law, x, parameters)
        parameters = [value + fine * rate for value, rate in zip(parameters, rates, strict=True)]
    np.testing.assert_allclose(controller.parameters, parameters, rtol=5e-4)


@pytest.mark.parametrize("law", [SMALL_GAIN, ROBUST])
def test_command_is_the_law_of_the_source(law):
    controller = law.controller()
    x = np.array([0.3, 0.1])
    before = controller.parameters
    assert controller.step(x)[0] == pytest.approx(law_at(law, x, before)[0])
    law_with_target = law.controller()
    assert law_with_target.step(np.array([0.1, 0.0]), np.array([0.1]))[0] == 0


@pytest.mark.parametrize("law", [SMALL_GAIN, ROBUST])
def test_nothing_is_learnt_while_the_command_is_cut_short(law):
    controller = law.controller()
    controller.step(np.array([0.4, 0.4]))
    learnt = controller.parameters
    for _ in range(1000):
        controller.applied(np.zeros(1))
        controller.step(np.array([0.4, 0.4]))
    assert all(now < then for now, then in zip(controller.parameters, learnt, strict=True))
    assert all(now >= start for now, start in zip(controller.parameters, law.start, strict=True))
    controller.reset()
    assert controller.parameters == law.start


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"gamma": 1.0}, "gamma must be above 0 and below 1"),
        ({"rho": 0.0}, "rho"),
        ({"initial": -1.0}, "initial"),
        ({"ranges": (1.0,)}, "at least roll"),
        ({"ranges": (1.0, -1.0)}, "ranges"),
        ({"error": ErrorDynamics(1.0, 1.0, 2.0)}, "error.q must be above 2"),
    ],
)
def test_parameters_out_of_range_are_refused_by_name(change, message):
    numbers = {
        "error": ERROR,
        "ranges": RANGES,
        "gain_rad_s2_pa": 1.0,
        "gamma": 0.9,
        "rho": 1.0,
        "adaptation": 1.0,
        "leakage": 1.0,
    }
    with pytest.raises(ValueError, match=message):
        SmallGainFuzzy(**{**numbers, **change})


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"gamma": 1.0}, "gamma must be above 0 and below 1"),
        ({"error": ErrorDynamics(1.0, 1.0, 1.0)}, "error.q must be above 1"),
        ({"epsilon": 0.0}, "epsilon"),
        ({"leakage": (1.0, 0.0)}, "leakage"),
        ({"adaptation": (np.nan, 1.0)}, "adaptation"),
        ({"initial": (0.0, -1.0)}, "initial"),
    ],
)
def test_robust_parameters_out_of_range_are_refused_by_name(change, message):
    numbers = {
        "error": ERROR,
        "ranges": RANGES,
        "gain_rad_s2_pa": 1.0,
        "gamma": 0.9,
        "epsilon": 1.0,
        "adaptation": (1.0, 1.0),
        "leakage": (1.0, 1.0),
    }
    with pytest.raises(ValueError, match=message):
        RobustFuzzy(**{**numbers, **change})


def test_error_dynamics_need_positive_numbers():
    with pytest.raises(ValueError, match="damping_ratio"):
        ErrorDynamics(1.0, 0.0, 2.5)
