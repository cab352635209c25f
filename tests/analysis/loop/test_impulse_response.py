"""The law that a controller's impulse response holds, against laws known in full."""

import dataclasses

import numpy as np
import pytest
from shipped_designs import DPC_ROLL_LEVEL, GPC_ROLL, LQG_ROLL_RATE_LEVEL

from utank_hil.analysis.loop import impulse_response
from utank_hil.analysis.loop.impulse_response import (
    NoImpulseResponse,
    impulse_response_law,
    realize,
)
from utank_hil.analysis.loop.margins import (
    closed_loop_eigenvalues,
    closed_loop_radius,
    margins,
    robustness,
)
from utank_hil.control import (
    PD_MEASURED,
    ConstrainedDesign,
    DesignPlant,
    FeedbackLinearization,
    PassiveController,
    SeaModel,
    design_pd,
)
from utank_hil.control.gain import slope_at_rest
from utank_hil.control.state_space import StateSpaceLaw
from utank_hil.dynamics import RollShip, Tank
from utank_hil.dynamics.linear import STATES, pump_model
from utank_hil.dynamics.sampling import LinearModel, sample, state_space_response
from utank_hil.sea import jonswap

pytestmark = pytest.mark.slow

SHIP = RollShip(1.9275e9, 1.9275e9 * 0.25, 4.87e7)
TANK = Tank(17.1, 4.88, 17.11, 6.22, lz_m=1.83, damping_ratio=0.10)
SEA = jonswap(4.7, 10.0)
CONSTRAINED = ConstrainedDesign(
    "constrained_gpc", SeaModel(tuple(SEA.frequency_hz), tuple(SEA.density))
)
ROLL = ("roll_rad",)
LEAD_LAG = StateSpaceLaw(
    LinearModel(np.array([[0.3]]), np.ones((1, 1)), np.array([[6e5]]), np.array([[-1e6]]), 0.1)
)
LAWS = {
    "pd": (design_pd(SHIP, TANK), PD_MEASURED),
    "gpc": (GPC_ROLL.law(DesignPlant(SHIP, TANK)), GPC_ROLL.predictor.measured),
    "dpc": (DPC_ROLL_LEVEL.law(DesignPlant(SHIP, TANK)), DPC_ROLL_LEVEL.predictor.measured),
    "lqg": (
        LQG_ROLL_RATE_LEVEL.law(DesignPlant(SHIP, TANK)),
        LQG_ROLL_RATE_LEVEL.predictor.measured,
    ),
    "constrained": (CONSTRAINED.law(DesignPlant(SHIP, TANK)), CONSTRAINED.measured),
    "lead-lag": (LEAD_LAG, ("roll_rate_rad_s",)),
}


class Stepped:
    """A controller of one measurement and one state, by a function (y, state) -> (u, state)."""

    sample_time_s = 0.1

    def __init__(self, function):
        self._function = function
        self._state = 0.0

    def step(self, y, reference=None):
        u, self._state = self._function(float(y[0]), self._state)
        return np.atleast_1d(u)

    def applied(self, u):
        pass

    def reset(self):
        self._state = 0.0


def probe(function, **options):
    return impulse_response_law(lambda: Stepped(function), ROLL, **options)


@pytest.mark.evidence("dpc", "gpc", "constrained")
@pytest.mark.parametrize("name", LAWS)
def test_it_is_the_law_that_was_stepped(name):
    own, measured = LAWS[name]
    found = impulse_response_law(own.controller, measured)
    assert found.linear
    assert found.sample_time_s == own.sample_time_s
    z = np.exp(1j * np.geomspace(1e-3, np.pi / own.sample_time_s, 400) * own.sample_time_s)
    expected = own.response(z)
    np.testing.assert_allclose(found.response(z), expected, rtol=1e-6)
    np.testing.assert_allclose(state_space_response(found.matrices(), z), expected, rtol=1e-6)
    assert len(found.matrices().A) <= len(own.matrices().A)
    system = pump_model(SHIP, TANK, measured)
    mine, theirs = (dataclasses.asdict(margins(law, system, 0.05, 0.1)) for law in (found, own))
    # the law's own matrices may hold states that nothing sees, which are eigenvalues of the loop
    plant = sample(system, own.sample_time_s, 0.05, 0.1)
    eigenvalues = closed_loop_eigenvalues(own, plant)
    of_law = np.linalg.eigvals(own.matrices().A)
    hidden = np.abs(eigenvalues[:, None] - of_law).min(axis=1) < 1e-9
    assert mine.pop("radius") == pytest.approx(np.abs(eigenvalues[~hidden]).max(), rel=1e-6)
    assert theirs.pop("radius") < 1
    # found on a grid that follows the eigenvalues
    assert mine.pop("peak_frequency_rad_s") == pytest.approx(
        theirs.pop("peak_frequency_rad_s"), rel=1e-3
    )
    assert mine.pop("phase_margin_rad") == pytest.approx(theirs.pop("phase_margin_rad"), rel=1e-4)
    assert mine == pytest.approx(theirs, rel=1e-6)


@pytest.mark.evidence
def test_robustness_takes_it_as_any_law():
    own, measured = LAWS["gpc"]
    found, expected = (
        robustness(law, DesignPlant(SHIP, TANK), measured)
        for law in (impulse_response_law(own.controller, measured), own)
    )
    assert found.failures() == expected.failures() == ()
    assert found.worst_radius == pytest.approx(expected.worst_radius, rel=1e-6)


def test_of_a_static_nonlinear_law_it_is_the_slope_at_rest():
    law = FeedbackLinearization(0.5, 0.3, 3.0, 3.8, ship=SHIP, tank=TANK)
    found = impulse_response_law(law.controller, STATES)
    slope = slope_at_rest(law.controller, 4)
    z = np.exp(1j * np.array([0.001, 0.05]))
    np.testing.assert_allclose(found.response(z), slope.response(z), rtol=1e-5)
    assert len(found.matrices().A) == 1


def test_a_law_that_does_nothing_leaves_the_loop_open():
    found = impulse_response_law(PassiveController, ROLL)
    plant = sample(pump_model(SHIP, TANK, ROLL), found.sample_time_s, 0.05, 0.1)
    assert closed_loop_radius(found, plant) == np.abs(np.linalg.eigvals(plant.A)).max()
    assert margins(found, pump_model(SHIP, TANK, ROLL)).peak_loop_gain == 0


@pytest.mark.evidence
def test_a_long_memory_is_followed_to_its_end():
    pole = np.exp(-0.02 * 0.01)  # a washout of 50 s in a law of 10 ms
    found = probe(lambda y, mean: (y - mean, pole * mean + (1 - pole) * y))
    assert len(found.impulse) > 80_000
    z = np.exp(1j * np.array([1e-5, 1e-3, 1.0]))
    expected = (1 - (1 - pole) / (z - pole)) / z
    np.testing.assert_allclose(found.response(z)[:, 0, 0], expected, rtol=1e-6)
    np.testing.assert_allclose(
        state_space_response(found.matrices(), z)[:, 0, 0], expected, rtol=1e-6
    )


@pytest.mark.parametrize(
    ("function", "peak"),
    [
        (lambda y, s: (s + y, s + y), "it peaks at 0.001 and is 0.001 after 2000 steps"),
        (lambda y, s: (s + y, 1.01 * (s + y)), "does not decay: it peaks at"),
        (lambda y, s: (s + y, 1e30 * (s + y)), "does not decay: it peaks at"),
    ],
    ids=["integrator", "unstable", "explodes"],
)
def test_a_law_that_does_not_forget_is_refused(function, peak):
    with pytest.raises(NoImpulseResponse, match=peak):
        probe(function, most_samples=2000)


@pytest.mark.parametrize(
    ("function", "slope"),
    [
        (lambda y, s: (5.0 * (y if abs(y) > 7e-4 else 0.0), s), 0.0),
        (lambda y, s: (5.0 * min(max(y, -7e-4), 7e-4), s), 5.0),
        (lambda y, s: (5.0 * y if y > 0 else 0.0, s), 2.5),
        (lambda y, s: (5.0 * y + 0.3, s), 5.0),
    ],
    ids=["dead zone", "saturation", "one-sided", "answer at rest"],
)
def test_a_law_that_is_visibly_nonlinear_says_so_and_is_its_slope(function, slope):
    found = probe(function)
    assert not found.linear
    assert found.impulse[0, 0, 0] == pytest.approx(slope)
    assert not np.abs(found.impulse[1:]).max() > 1e-9


def fails_in_its_tenth_step(y, step):
    return 1 / (9 - step), step + 1


def leaves(y, step):
    raise SystemExit(0)


@pytest.mark.parametrize(
    ("function", "message"),
    [
        (leaves, "step 1 after an impulse of 0.0005 in roll_rad: SystemExit: 0"),
        (
            fails_in_its_tenth_step,
            "step 10 after an impulse of 0.0005 in roll_rad: ZeroDivisionError: float division",
        ),
        (lambda y, s: (np.nan, s), r"step 1 .* must be finite, shape \(commands,\), got .*nan"),
        (lambda y, s: (np.zeros((1, 1)), s), "step 1 .* must be finite, shape"),
        (lambda y, s: (np.zeros(1 + int(s > 3)), s + 1), "step 5 .* must be finite, shape"),
    ],
    ids=["leaves", "raises", "nan", "matrix", "other shape"],
)
def test_a_step_that_fails_is_told_with_its_number(function, message):
    with pytest.raises(NoImpulseResponse, match=message):
        probe(function)


def test_the_time_that_it_takes_is_bounded():
    with pytest.raises(NoImpulseResponse, match="out of time"):
        probe(lambda y, s: (s + y, s + y), budget_s=0.02)


def test_a_model_of_two_commands_is_found_again():
    rng = np.random.default_rng(2)
    a, b, c = 0.35 * rng.normal(size=(5, 5)), rng.normal(size=(5, 3)), rng.normal(size=(2, 5))
    c[1] *= 1e6  # another unit
    impulse = np.array([c @ np.linalg.matrix_power(a, k) @ b for k in range(400)])
    model = realize(impulse, 0.1)
    assert len(model.A) == 5
    found = np.sort_complex(np.linalg.eigvals(model.A))
    np.testing.assert_allclose(found, np.sort_complex(np.linalg.eigvals(a)), rtol=1e-6)
    z = np.exp(1j * np.array([0.1, 1.0, 3.0]))
    expected = state_space_response(LinearModel(a, b, c, np.zeros((2, 3)), 0.1), z)
    np.testing.assert_allclose(state_space_response(model, z), expected, rtol=1e-6)


def test_a_response_that_no_small_model_has_is_refused(monkeypatch):
    noise = np.random.default_rng(0).normal(size=(60, 1, 1))
    assert len(realize(noise, 0.1).A) > 50  # nearly every sample of it is a state
    monkeypatch.setattr(impulse_response, "MOST_STATES", 32)
    with pytest.raises(NoImpulseResponse, match="no model of 32 states"):
        realize(noise, 0.1)
