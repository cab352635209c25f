"""Indirect adaptive fuzzy law: its Lyapunov function, its projection, what it learns."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from utank_hil.control.fuzzy.indirect import IndirectFuzzy
from utank_hil.control.fuzzy.law import ErrorDynamics, FuzzyBasis

ERROR = ErrorDynamics(1.0, 0.7, 2.0)
RANGES = (0.5, 0.5)
BASIS = FuzzyBasis(RANGES)


def law_of(**changes):
    numbers = {
        "error": ERROR,
        "ranges": RANGES,
        "gain_rad_s2_pa": 2e-7,
        "adaptation_f": 2.0,
        "adaptation_g": 1.0,
        "leakage": 1e-9,
        "least_gain": 0.4,
        "sample_time_s": 1e-3,
    }
    return IndirectFuzzy(**{**numbers, **changes})


def test_first_command_is_the_law_of_the_source_with_what_is_known_before():
    law = law_of(prior=(0.01, -0.3, 0.05))
    x = np.array([0.2, -0.1])
    k1, k2 = ERROR.gains
    f = 0.01 - 0.3 * 0.2 + 0.05 * -0.1
    expected = (-f - k1 * 0.2 - k2 * -0.1) / 2e-7
    assert law.controller().step(x)[0] == pytest.approx(expected)
    shifted = (-f - k1 * 0.15 - k2 * -0.1) / 2e-7
    assert law.controller().step(x, np.array([0.05]))[0] == pytest.approx(shifted)


@pytest.mark.evidence("1", "2", "3")
@pytest.mark.slow
@pytest.mark.parametrize("seed", range(4))
def test_lyapunov_function_falls_on_a_plant_of_the_class_also_when_projection_acts(seed):
    rng = np.random.default_rng(seed)
    drift = 0.5 * rng.normal(size=(9, 3))
    gain = np.where(rng.random(9) < 0.5, 0.4, rng.uniform(0.4, 1.5, 9))  # half of them at the least
    law = law_of()
    controller, p = law.controller(), ERROR.lyapunov
    x = np.array([0.3, -0.2])
    values, at_least = [], 0
    for _ in range(8000):
        values.append(
            x @ p @ x / 2
            + np.square(drift - controller.drift).sum() / (2 * law.adaptation_f)
            + np.square(gain - controller.gain).sum() / (2 * law.adaptation_g)
        )
        u = 2e-7 * controller.step(x)[0]
        at_least += int((controller.gain == law.least_gain).any())
        for _ in range(2):  # the plant, in half samples
            xi = BASIS(x)
            acceleration = xi @ drift @ np.array([1.0, *x]) + xi @ gain * u
            x = x + 5e-4 * np.array([x[1] + 2.5e-4 * acceleration, acceleration])
    coarse = np.array(values[::100])
    assert (np.diff(coarse) < 1e-6 * coarse[0]).all()
    assert coarse[-1] < coarse[0]
    assert np.abs(x).max() < 0.1


def test_estimated_gain_never_falls_below_the_least_one():
    law = law_of(adaptation_g=1e3, leakage=0.01)
    controller = law.controller()
    rng = np.random.default_rng(1)
    for x in rng.uniform(-0.9, 0.9, (2000, 2)):
        controller.step(x)
        assert controller.gain.min() >= law.least_gain
    xi = np.array([BASIS(x) for x in rng.uniform(-3, 3, (500, 2))])
    assert (xi @ controller.gain >= law.least_gain - 1e-12).all()
    assert (controller.gain == law.least_gain).any()


def test_nothing_is_learnt_while_another_law_is_in_charge_or_beyond_the_rules():
    controller = law_of(leakage=0.1).controller()
    controller.step(np.array([0.4, 0.4]))
    learnt = np.abs(controller.drift).max()
    assert learnt > 0
    for _ in range(100):
        controller.applied(np.zeros(1))
        controller.step(np.array([0.4, 0.4]))
    assert np.abs(controller.drift).max() < learnt
    controller.reset()
    controller.step(np.array([1.2, 0.0]))  # beyond twice the range
    assert not controller.drift.any()


@given(st.floats(-0.9, 0.9), st.floats(-0.9, 0.9))
def test_constant_excitation_ends_at_the_leakage_s_own_bound(roll, rate):
    law = law_of(leakage=5.0, sample_time_s=0.2, adaptation_f=0.01, adaptation_g=1e-6)
    controller = law.controller()
    x = np.array([roll, rate])
    for _ in range(100):
        controller.step(x)
    s = ERROR.lyapunov[1] @ x
    expected = law.adaptation_f / law.leakage * s * np.outer(BASIS(x), [1.0, *x])
    np.testing.assert_allclose(controller.drift, expected, rtol=1e-6, atol=1e-15)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"leakage": 0.0}, "leakage"),
        ({"least_gain": 1.0}, "least_gain"),
        ({"prior": (1.0,)}, "prior must have 3"),
        ({"ranges": (1.0,)}, "at least roll"),
        ({"adaptation_f": np.inf}, "adaptation_f"),
    ],
)
def test_parameters_out_of_range_are_refused_by_name(change, message):
    with pytest.raises(ValueError, match=message):
        law_of(**change)
