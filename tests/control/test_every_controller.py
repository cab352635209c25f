"""What every controller promises: take-over, reset, sample time, finite answers."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from utank_hil.control import (
    CommandLimiter,
    PassiveController,
    PredictiveDesign,
    Predictor,
    PumpLimits,
    WashoutLaw,
    design_pd,
    pump_model,
)
from utank_hil.control.direct_fuzzy import RobustFuzzy, SmallGainFuzzy
from utank_hil.control.feedback_linearization import FeedbackLinearization, level_brake
from utank_hil.control.indirect_fuzzy import IndirectFuzzy
from utank_hil.control.lqg import design_lqr
from utank_hil.control.lqg_design import LQG_ROLL_RATE_LEVEL
from utank_hil.control.semi_active import ClippedValve, OnOffValve, ValveRange
from utank_hil.control.stimulate import Stimulation
from utank_hil.control.tracking_error import ErrorDynamics
from utank_hil.dynamics import RollModel, RollShip, Tank
from utank_hil.dynamics.linear import STATES
from utank_hil.dynamics.sampling import sample

SHIP = RollShip(1.9275e9, 1.9275e9 * 0.25, 4.81875e7)
TANK = Tank(17.1, 4.88, 17.11, 6.22, lz_m=1.83, damping_ratio=0.10)
MODEL = RollModel(SHIP, TANK)
LIMITS = PumpLimits()
PREDICTOR = Predictor(("roll_rad", "level_m"), (2.8e-3, 0.044), 30, 0.61, 0.012, 0.054, 1340.0)
GPC = PredictiveDesign("gpc", PREDICTOR, 40, 50, (1e12, 1.5e7), first_output=28)
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
        LQG_ROLL_RATE_LEVEL.law(SHIP, TANK).controller,
        LQG_ROLL_RATE_LEVEL.predictor.measured,
    ),
    "gpc": (GPC.law(SHIP, TANK).controller, PREDICTOR.measured),
    "washout": (WashoutLaw(GPC.law(SHIP, TANK), 0.02).controller, PREDICTOR.measured),
    "feedback linearization": (
        FeedbackLinearization(SHIP, TANK, 0.5, 0.3, 3.0, 3.8).controller,
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
        Stimulation(SHIP, TANK, 0.05, 12.5, 60.0, 50e3, 0.1, 4.0).controller,
        STATES,
    ),
}
VALVE_LAWS = {
    "on-off valve": (lambda: OnOffValve(ValveRange(0.0, 3e5)), STATES),
    "clipped valve": (
        lambda: ClippedValve(ValveRange(0.0, 3e5), PUMP_LAWS["lqr"][0]()),
        STATES,
    ),
}
ALL = PUMP_LAWS | VALVE_LAWS
pump_laws = pytest.mark.parametrize("name", PUMP_LAWS)
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


def silent(name, duration_s):
    """A controller stepped for a while with another one (zero) in charge, and the time after."""
    controller = ALL[name][0]()
    steps = round(duration_s / controller.sample_time_s)
    for k in range(steps):
        controller.step(measured(name, motion(k * controller.sample_time_s)))
        controller.applied(np.zeros(1))
    return controller, steps * controller.sample_time_s


@pump_laws
def test_first_commands_after_taking_over_stay_within_the_rate_limit(name):
    controller, time = silent(name, 60.0)
    limiter = CommandLimiter(LIMITS, TANK, 0.02)
    state = motion(time)
    wanted = float(controller.step(measured(name, state))[0])
    last = 0.0
    for _ in range(10):
        command = limiter.limit(wanted, state[2], state[3])
        assert abs(command - last) <= LIMITS.rate_pa_s * 0.02 * (1 + 1e-9)
        last = command


@pump_laws
def test_nothing_winds_up_while_another_law_is_in_charge(name):
    # what it wants after four minutes in waiting is what it wants after one
    wants = []
    for minutes in (1, 4):
        periods = round(minutes * 60 * 0.6 / math.tau)
        controller, time = silent(name, 0.2 * round(periods * math.tau / 0.6 / 0.2))
        following = [
            controller.step(measured(name, motion(time + k * controller.sample_time_s)))[0]
            for k in range(round(2.0 / controller.sample_time_s))
        ]
        wants.append(np.abs(following).max())
    assert wants[1] <= 1.3 * wants[0] + 1.0


@every_law
def test_reset_is_as_newly_built(name):
    used, new = ALL[name][0](), ALL[name][0]()
    for k in range(300):
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


@every_law
@settings(max_examples=30)
@given(
    st.lists(
        st.lists(st.floats(-1e6, 1e6), min_size=4, max_size=4).map(np.array),
        min_size=1,
        max_size=15,
    )
)
def test_answer_is_finite_for_any_finite_measurement(name, states):
    controller = ALL[name][0]()
    for state in states:
        u = controller.step(measured(name, state))
        assert np.isfinite(u).all()
        controller.applied(np.clip(u, -50e3, 50e3))


@pytest.mark.parametrize("name", sorted(set(ALL) - {"stimulation"}))
def test_the_upright_ship_at_rest_is_left_alone(name):
    controller = ALL[name][0]()
    for _ in range(50):
        assert controller.step(np.zeros(len(ALL[name][1])))[0] == 0
