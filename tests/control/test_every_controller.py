"""What every controller promises: take-over, reset, sample time, finite answers."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from rolling_ship import SHIP, TANK
from shipped_designs import LQG_ROLL_RATE_LEVEL

from utank_hil.control import (
    ConstrainedDesign,
    DesignPlant,
    PassiveController,
    PredictiveDesign,
    Predictor,
    SeaModel,
    WashoutLaw,
    design_pd,
    pump_model,
)
from utank_hil.control.feedback_linearization import FeedbackLinearization, level_brake
from utank_hil.control.fuzzy.adaptive import RobustFuzzy
from utank_hil.control.fuzzy.indirect import IndirectFuzzy, SmallGainFuzzy
from utank_hil.control.fuzzy.law import ErrorDynamics
from utank_hil.control.interface import StartsAnew
from utank_hil.control.lqg import design_lqr
from utank_hil.control.semi_active import ClippedValve, OnOffValve
from utank_hil.control.stimulation import Stimulation
from utank_hil.dynamics import RollModel
from utank_hil.dynamics.linear import STATES
from utank_hil.dynamics.sampling import sample
from utank_hil.dynamics.valves import ValveRange
from utank_hil.sea import jonswap

MODEL = RollModel(SHIP, TANK)
PREDICTOR = Predictor(("roll_rad", "level_m"), (2.8e-3, 0.044), 30, 0.61, 0.012, 0.054, 1340.0)
GPC = PredictiveDesign("gpc", PREDICTOR, 40, 50, (1e12, 1.5e7), first_output=28)
SEA = jonswap(4.7, 10.0)
CONSTRAINED = ConstrainedDesign(
    "constrained_gpc", SeaModel(tuple(SEA.frequency_hz), tuple(SEA.density))
)
FUZZY = {
    "error": ErrorDynamics(0.5, 0.5, 2.5),
    "ranges": (math.pi / 6, math.pi / 6, 2.0, 2.0),
    "gain_rad_s2_pa": 1.0e-8,
    "brake_pa_s_m": level_brake(MODEL, 0.3),
}
# each with what it measures
PUMP_LAWS = {
    "passive": (PassiveController, STATES),
    "pd": (design_pd(SHIP, TANK).controller, STATES[2:]),
    "lqr": (
        design_lqr(sample(pump_model(SHIP, TANK, STATES), 0.1, 0.0, 0.0), 1e11).controller,
        STATES,
    ),
    "lqg": (
        LQG_ROLL_RATE_LEVEL.law(DesignPlant(SHIP, TANK)).controller,
        LQG_ROLL_RATE_LEVEL.predictor.measured,
    ),
    "gpc": (GPC.law(DesignPlant(SHIP, TANK)).controller, PREDICTOR.measured),
    "dpc": (
        PredictiveDesign("dpc", PREDICTOR, 40, 44).law(DesignPlant(SHIP, TANK)).controller,
        PREDICTOR.measured,
    ),
    "constrained": (CONSTRAINED.law(DesignPlant(SHIP, TANK)).controller, CONSTRAINED.measured),
    "washout": (WashoutLaw(GPC.law(DesignPlant(SHIP, TANK)), 0.02).controller, PREDICTOR.measured),
    "feedback linearization": (
        FeedbackLinearization(0.5, 0.3, 3.0, 3.8, ship=SHIP, tank=TANK).controller,
        STATES,
    ),
    "small gain fuzzy": (
        SmallGainFuzzy(gamma=0.9, rho=1.0, adaptation=0.1, leakage=1.0, **FUZZY).controller,
        STATES,
    ),
    "robust fuzzy": (
        RobustFuzzy(
            gamma=0.9, epsilon=0.1, adaptation=(0.1, 0.1), leakage=(1.0, 1.0), **FUZZY
        ).controller,
        STATES,
    ),
    "indirect fuzzy": (
        IndirectFuzzy(adaptation_f=0.1, adaptation_g=0.1, leakage=0.02, **FUZZY).controller,
        STATES,
    ),
    "stimulation": (
        Stimulation(
            0.05, 12.5, 60.0, 0.1, ship=SHIP, tank=TANK, pressure_pa=50e3, level_limit_m=4.0
        ).controller,
        STATES,
    ),
}
# what they remember is the ship, or their own doing; the others remember nothing
KNOWS_THE_SHIP = ("lqg", "gpc", "dpc", "washout", "constrained")
STARTS_ANEW = ("small gain fuzzy", "robust fuzzy", "indirect fuzzy", "stimulation")
VALVE_LAWS = {
    "on-off valve": (lambda: OnOffValve(ValveRange(0.0, 3e5)), STATES),
    "clipped valve": (
        lambda: ClippedValve(ValveRange(0.0, 3e5), PUMP_LAWS["lqr"][0]()),
        STATES,
    ),
}
ALL = PUMP_LAWS | VALVE_LAWS
every_law = pytest.mark.parametrize("name", ALL)


def motion(time, size=1.0):
    """A ship and tank in waves, roughly: roll 5 degrees, level 1 m."""
    angle = 0.6 * time
    return size * np.array(
        [
            0.09 * np.sin(angle),
            0.054 * np.cos(angle),
            np.sin(angle - 1.3),
            0.6 * np.cos(angle - 1.3),
        ]
    )


def measured(name, state):
    return state[[STATES.index(one) for one in ALL[name][1]]]


@pytest.mark.parametrize("name", KNOWS_THE_SHIP)
def test_taking_over_it_wants_what_it_would_if_in_charge_all_along(name):
    assert_takes_over_as_if_in_charge(name, *PUMP_LAWS[name])


@pytest.mark.evidence("small gain fuzzy", "indirect fuzzy")
@pytest.mark.slow
@pytest.mark.parametrize("name", STARTS_ANEW)
def test_taking_over_it_begins_as_newly_built(name):
    assert_takes_over_as_new(name, *PUMP_LAWS[name])


@pytest.mark.parametrize("name", KNOWS_THE_SHIP)
def test_law_that_does_not_listen_is_found_out(name):
    build, names = PUMP_LAWS[name]
    with pytest.raises(AssertionError):
        assert_takes_over_as_if_in_charge(name, lambda: Deaf(build()), names)


@pytest.mark.evidence("small gain fuzzy", "indirect fuzzy", "robust fuzzy")
@pytest.mark.slow
@pytest.mark.parametrize("name", STARTS_ANEW)
def test_law_that_goes_on_in_waiting_is_found_out(name):
    build, names = PUMP_LAWS[name]
    with pytest.raises(AssertionError):
        assert_takes_over_as_new(name, lambda: Deaf(build()), names)


@pytest.mark.parametrize("name", PUMP_LAWS)
def test_who_remembers_its_own_doing_says_so(name):
    assert isinstance(PUMP_LAWS[name][0](), StartsAnew) == (name in STARTS_ANEW)


def test_every_law_with_a_memory_is_tried():
    forgetful = {"passive", "pd", "lqr", "feedback linearization"}
    assert set(KNOWS_THE_SHIP) | set(STARTS_ANEW) | forgetful == set(PUMP_LAWS)
    for name in forgetful:
        used, new = (PUMP_LAWS[name][0]() for _ in range(2))
        for k in range(20):
            used.step(measured(name, motion(k * used.sample_time_s)))
        y = measured(name, motion(7.0))
        np.testing.assert_array_equal(used.step(y), new.step(y))


class Deaf:
    """A law that is not told what left."""

    def __init__(self, controller):
        self._controller = controller
        self.sample_time_s = controller.sample_time_s
        self.step, self.reset = controller.step, controller.reset

    def applied(self, u):
        """Does not hear."""


def assert_takes_over_as_if_in_charge(name, build, names):
    """What a law knows of the ship, it knows whoever is in charge.

    One is in charge all along and its commands are cut, one waits with another target; both measure
    the same. Then the one that waited takes over.
    """
    charged, waiting = build(), build()
    target = 0.2 * np.ones(len(names))
    steps = round(240.0 / charged.sample_time_s)
    differed = 0.0
    for k in range(steps):
        y = measured(name, motion(k * charged.sample_time_s))
        wanted, other = charged.step(y), waiting.step(y, target)
        differed = max(differed, abs(float(wanted[0] - other[0])))
        left = np.clip(wanted, -3e3, 3e3)
        charged.applied(left)
        waiting.applied(left)
    assert differed > 1e3  # it did want something else
    for k in range(steps, steps + 20):
        y = measured(name, motion(k * charged.sample_time_s))
        expected, found = charged.step(y), waiting.step(y)
        np.testing.assert_allclose(found, expected, rtol=1e-9, atol=1e-6)
        charged.applied(expected)
        waiting.applied(found)


def assert_takes_over_as_new(name, build, names):
    """What a law remembers of its own doing is nothing as long as another law is in charge."""
    del names
    waited = build()
    steps = round(240.0 / waited.sample_time_s)
    for k in range(steps):
        waited.step(measured(name, motion(k * waited.sample_time_s)))
        waited.applied(np.zeros(1))
    new = build()
    wants, expected = [], []
    for k in range(steps, steps + round(1.0 / waited.sample_time_s)):
        y = measured(name, motion(k * waited.sample_time_s))
        wants.append(float(waited.step(y)[0]))
        expected.append(float(new.step(y)[0]))
    # where a sine of its own begins may differ, how large it is may not
    scale = np.abs(expected).max()
    assert np.abs(np.abs(wants) - np.abs(expected)).max() < 0.05 * scale + 100.0


@every_law
def test_reset_is_as_newly_built(name):
    used, new = ALL[name][0](), ALL[name][0]()
    for k in range(700):  # beyond the room of the predictive laws' memory
        used.step(measured(name, motion(k * used.sample_time_s)))
    used.reset()
    for k in range(20):
        y = measured(name, motion(k * used.sample_time_s))
        np.testing.assert_array_equal(used.step(y), new.step(y))


@every_law
def test_sample_time_is_a_whole_number_of_the_loop_s_ticks(name):
    ticks = ALL[name][0]().sample_time_s / 0.01
    assert ticks >= 1
    assert ticks == pytest.approx(round(ticks), abs=1e-9)


@every_law
def test_answer_is_one_command_of_the_caller_s_own(name):
    controller = ALL[name][0]()
    first = controller.step(measured(name, motion(1.0)))
    assert first.shape == (1,)
    kept = first.copy()
    controller.applied(np.ones(1))
    controller.step(measured(name, motion(2.0)))
    np.testing.assert_array_equal(first, kept)


@pytest.mark.slow
@every_law
@given(
    st.lists(
        st.lists(st.floats(-1e50, 1e50), min_size=4, max_size=4).map(np.array),
        min_size=1,
        max_size=15,
    )
)
def test_answer_is_finite_for_any_measurement_up_to_1e50(name, states):
    controller = ALL[name][0]()
    for state in states:
        u = controller.step(measured(name, state))
        assert np.isfinite(u).all()
        controller.applied(np.clip(u, -50e3, 50e3))


@every_law
@settings(max_examples=10, deadline=None)
@given(
    st.lists(
        st.sampled_from([0.05, math.nan, math.inf, -math.inf, 1e50, -1e300]),
        min_size=4,
        max_size=4,
    ).map(np.array)
)
def test_what_no_sensor_can_measure_is_one_bad_answer_at_most(name, broken):
    controller, untouched = ALL[name][0](), ALL[name][0]()
    for k in range(40):
        y = measured(name, motion(k * controller.sample_time_s))
        with np.errstate(all="ignore"):
            answer = controller.step(measured(name, broken) if k == 5 else y)
        expected = untouched.step(y)
        if k != 5:
            assert np.isfinite(answer).all()
        for law, u in ((controller, answer), (untouched, expected)):
            law.applied(np.clip(np.nan_to_num(u), -50e3, 50e3))
    if name in {"passive", "pd", "lqr", "feedback linearization", "on-off valve", "clipped valve"}:
        np.testing.assert_array_equal(answer, expected)  # nothing is remembered


@pytest.mark.parametrize("name", sorted(set(ALL) - {"stimulation"}))
def test_the_upright_ship_at_rest_is_left_alone(name):
    controller = ALL[name][0]()
    for _ in range(50):
        assert controller.step(np.zeros(len(ALL[name][1])))[0] == 0
