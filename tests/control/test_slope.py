"""The slope of a nonlinear law at rest, against its formula."""

import numpy as np
import pytest
from rolling_ship import SHIP, TANK

from utank_hil.control.feedback_linearization import FeedbackLinearization, level_brake
from utank_hil.control.fuzzy.adaptive import RobustFuzzy
from utank_hil.control.fuzzy.indirect import IndirectFuzzy, SmallGainFuzzy
from utank_hil.control.fuzzy.law import ErrorDynamics, FuzzyBasis
from utank_hil.control.gain import slope_at_rest
from utank_hil.dynamics import RollModel
from utank_hil.dynamics.linear import state_matrices

ERROR = ErrorDynamics(1.5, 0.7, 2.5)
RANGES = (0.5, 0.5, 4.0, 4.0)
GAIN = 1.8e-8
XI2 = FuzzyBasis(RANGES).square(np.zeros(4))
PSI = 1 + np.sqrt(XI2)
P = ERROR.lyapunov[:, 1]  # s = p12 e + p22 e'


def slope(law, inputs=4):
    return slope_at_rest(law.controller, inputs).gain[0]


@pytest.mark.parametrize("shift", [0.0, 0.005])
def test_of_feedback_linearization_it_places_the_poles_of_the_linear_model(shift):
    w, zeta = 0.6, 0.4
    law = FeedbackLinearization(w, zeta, 2.5, 3.5, shift, 20.0, 0.3, ship=SHIP, tank=TANK)
    a, b = state_matrices(SHIP, TANK)
    output = np.array([1.0, 0.0, shift, 0.0])  # s = phi + kL h
    rate = output @ a
    gain = (w**2 * output + 2 * zeta * w * rate + rate @ a) / (rate @ b[:, 0])
    gain[3] += level_brake(RollModel(SHIP, TANK), 0.3)
    np.testing.assert_allclose(slope(law), gain, rtol=1e-6, atol=1e-6 * np.abs(gain).max())


def test_of_the_direct_fuzzy_laws_it_is_that_of_their_start_parameters():
    small = SmallGainFuzzy(
        ERROR, RANGES, GAIN, brake_pa_s_m=700.0,
        gamma=0.5, rho=2.0, adaptation=0.1, leakage=1.0, initial=0.3,
    )  # fmt: skip
    theta = XI2 / (4 * 0.25) + PSI**2 / (4 * 4.0)
    expected = [*(0.3 * theta * P / GAIN), 0.0, 700.0]
    np.testing.assert_allclose(slope(small), expected, rtol=1e-6, atol=1e-3)
    robust = RobustFuzzy(
        ERROR, RANGES, GAIN,
        gamma=0.5, epsilon=0.1, adaptation=(0.1, 0.1), leakage=(1.0, 1.0), initial=(0.3, 0.2),
    )  # fmt: skip
    share = 0.3 * XI2 / (2 * 0.25) + 0.04 * PSI**2 / 0.1
    np.testing.assert_allclose(slope(robust), [*(share * P / GAIN), 0.0, 0.0], rtol=1e-6, atol=1e-3)


def test_of_the_indirect_fuzzy_law_it_is_that_of_its_prior():
    prior = (0.0, -0.2, -0.05, 0.01, 0.0)
    law = IndirectFuzzy(
        ERROR, RANGES, GAIN, adaptation_f=0.1, adaptation_g=0.1, leakage=0.1, prior=prior
    )
    k1, k2 = ERROR.gains
    expected = (np.array(prior[1:]) + np.array([k1, k2, 0.0, 0.0])) / GAIN
    np.testing.assert_allclose(slope(law), expected, rtol=1e-6, atol=1e-3)


def test_an_answer_that_overflows_is_refused():
    law = IndirectFuzzy(
        ErrorDynamics(1e150, 0.7, 2.5), RANGES, 1e-200,
        adaptation_f=0.1, adaptation_g=0.1, leakage=0.1,
    )  # fmt: skip
    with np.errstate(all="ignore"), pytest.raises(ValueError, match="overflows"):
        slope(law)
