"""A forecast of the waves in the plan: worth what it is worth, and never dangerous."""

from functools import cache

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from rolling_ship import SHIP, TANK

from utank_hil.analysis.loop.loop_simulation import SensorNoise, passive_motion, simulate_loop
from utank_hil.analysis.loop.margins import robustness
from utank_hil.base.ordered_sums import positive_solved
from utank_hil.control import ConstrainedDesign, DesignPlant, PumpLimits, SeaModel
from utank_hil.control.interface import WaveForecast
from utank_hil.sea import EffectiveSlope, Sea, jonswap

PLANT = DesignPlant(SHIP, TANK, limits=PumpLimits(50e3, 100e3, 4.0))
SPECTRUM = jonswap(4.7, 10.0)
SEA = SeaModel(tuple(SPECTRUM.frequency_hz), tuple(SPECTRUM.density))
LAW = ConstrainedDesign("constrained_gpc", SEA).law(PLANT)
TIME_S = 0.25 * np.arange(1, 21)
NONE = WaveForecast(TIME_S, np.full(20, np.nan), np.zeros(20))
MEASURED = ("roll_rad", "roll_rate_rad_s", "level_m")


@cache
def previewed():
    return LAW.previewed()


def covariance_by_recursion(samples):
    """Covariance of the moments to come, each from the state's covariance at its own time."""
    waves, model = LAW.waves, LAW.model
    a, gain = model.A, LAW.observer_gain
    closed = a - gain @ model.C
    noise = waves.process_covariance + gain @ np.diag(waves.variance) @ gain.T
    error = np.zeros_like(a)
    for _ in range(14):  # doubling: 2^14 samples of the filter's own error equation
        error, noise, closed = noise, noise + closed @ noise @ closed.T, closed @ closed
    found = np.empty((samples, samples))
    for q in range(samples):
        effect = error @ waves.row
        for r in range(q, samples):
            found[q, r] = found[r, q] = waves.row @ effect
            effect = a @ effect
        error = a @ error @ a.T + np.outer(waves.noise, waves.noise)
    return found


def test_what_the_estimate_knows_of_the_waves_to_come_is_the_kalman_filter_s():
    found = previewed().foresight.moment_covariance
    expected = covariance_by_recursion(len(found))
    np.testing.assert_allclose(found, expected, atol=2e-3 * expected.max())
    assert found[0, 0] < 0.5 * found[-1, -1]


def test_a_forecast_is_weighed_by_bayes_rule():
    law = previewed()
    controller = law.controller()
    state = 1e-2 * np.random.default_rng(1).normal(size=len(LAW.model.A))
    deviation = 0.01
    moment = 0.02 * np.sin(0.6 * TIME_S)
    preview = controller._preview
    preview.take(WaveForecast(TIME_S, moment, np.full(20, deviation)))
    found = preview.expected(state)

    grid_s = 0.2 * np.arange(2, 25)  # samples between two points
    at = np.arange(1, 24)
    rows = law.foresight.by_state[at]
    spectrum = law.foresight.covariance / law.foresight.covariance[0]
    apart = np.abs(at[:, None] - at)
    error = deviation**2 * spectrum[apart]
    error += np.eye(23) * 0.01 * law.foresight.covariance[0]
    known = covariance_by_recursion(60)
    innovation = np.interp(grid_s, TIME_S, moment) - rows @ state
    expected = known[:, at] @ np.linalg.solve(known[np.ix_(at, at)] + error, innovation)
    moved = found.copy()
    moved[: len(state)] -= state
    model = np.zeros((60, len(moved)))
    model[:, : len(state)] = law.foresight.by_state
    effect = LAW.waves.noise.copy()
    for q in range(1, 60):  # of a noise, q samples after it
        for r in range(q, 60):
            model[r, len(state) + r - q] = LAW.waves.row @ effect
        effect = LAW.model.A @ effect
    np.testing.assert_allclose(model @ moved, expected, atol=2e-3 * np.abs(expected).max())


@given(seed=st.integers(0, 2**32 - 1), size=st.integers(1, 30))
def test_a_positive_system_is_solved(seed, size):
    rng = np.random.default_rng(seed)
    root = rng.normal(size=(size, size))
    a, b = root @ root.T + np.eye(size), rng.normal(size=size)
    np.testing.assert_allclose(positive_solved(a, b), np.linalg.solve(a, b), rtol=1e-6, atol=1e-8)


@pytest.mark.parametrize("forecast", [None, NONE])
def test_without_a_forecast_it_is_the_law_without_preview(forecast):
    rng = np.random.default_rng(2)
    plain, other = LAW.controller(), previewed().controller()
    limited = 0
    for step in range(60):
        y = rng.normal(size=3) * (0.1, 0.05, 1.0) * (1e-3 if step < 30 else 1.0)
        other.preview(forecast)
        expected = plain.step(y)
        limited += plain.limited
        np.testing.assert_allclose(other.step(y), expected, atol=2.0)
        for law in (plain, other):
            law.applied(expected)
    assert 0 < limited < 60


@pytest.mark.parametrize("samples", [25, 60])
def test_it_keeps_its_margins_where_it_knows_the_waves_from_others(samples):
    law = previewed()
    told = law.foreseeing(samples)
    assert not robustness(told, PLANT, MEASURED, with_delay_margin=False).failures()
    with pytest.raises(ValueError, match="not previewed"):
        LAW.foreseeing(samples)


def test_the_law_of_a_perfect_forecast_is_that_of_a_plan_told_what_the_estimate_leaves():
    """Waves of zero, said to be certain, for a state: the plan's first command is its own."""
    law = previewed()
    controller, state = law.controller(), 1e-5 * np.random.default_rng(3).normal(size=14)
    controller._state = state.copy()
    preview = controller._preview
    preview.take(WaveForecast(0.2 * np.arange(27), np.zeros(27), np.zeros(27)))
    told = controller._plan_gain[0] @ preview.expected(state)
    told += controller._steady_command @ np.append(state, np.zeros(60))
    np.testing.assert_allclose(told, -(law.foreseeing(25).gain @ state)[0], rtol=1e-6)


def test_a_forecast_that_reaches_less_far_than_asked_is_left_out():
    rng = np.random.default_rng(2)
    y = rng.normal(size=3) * (1e-4, 5e-5, 1e-3)
    answers = []
    for least_s in (0.0, 4.6, 4.9):  # the forecast reaches 5 s, used up to 4.8 s
        controller = LAW.previewed(least_s).controller()
        controller.preview(WaveForecast(TIME_S, np.full(20, 0.01), np.zeros(20)))
        answers.append(float(controller.step(y)[0]))
    assert answers[0] == answers[1]
    assert answers[2] == pytest.approx(float(LAW.controller().step(y)[0]), abs=2.0)
    assert abs(answers[2] - answers[0]) > 100


class Fed:
    """A controller with what a forecaster says before each step."""

    def __init__(self, moment, error, deviation):
        self.inner = previewed().controller()
        self.sample_time_s = self.inner.sample_time_s
        self._said, self._deviation, self._step = moment + error, deviation, 0

    def step(self, y):
        at = 20 * self._step + np.round(TIME_S / 0.01).astype(int)
        self._step += 1
        self.inner.preview(WaveForecast(TIME_S, self._said[at], np.full(20, self._deviation)))
        return self.inner.step(y)

    def applied(self, u):
        self.inner.applied(u)


TICKS = 9000


@cache
def waves(seed):
    sea = Sea.irregular(SPECTRUM, seed, heading_rad=np.pi / 2)
    moment = EffectiveSlope(0.5).moment(sea.omega_rad_s, sea.heading_rad, SHIP.stiffness_nm_rad)
    return sea.harmonics(sea.amplitude_m * moment)


@cache
def motion():
    return passive_motion(SHIP, TANK, waves(71), 0.01, TICKS)


def moment_of(seed):
    return waves(seed).series(0.01, TICKS + 600) / SHIP.stiffness_nm_rad


def roll_rms(controller):
    run = simulate_loop(PLANT, motion(), controller, MEASURED, noise=SensorNoise())
    return np.sqrt(np.mean(run.motion[3000:, 0] ** 2))


@cache
def without():
    return roll_rms(LAW.controller())


def test_a_perfect_forecast_of_five_seconds_is_worth_something():
    fed = Fed(moment_of(71), 0.0, 0.0)
    assert roll_rms(fed) < 0.95 * without()
    assert not fed.inner.doubts_forecasts


def test_an_error_as_large_as_the_waves_costs_nothing():
    error = moment_of(72)
    fed = Fed(moment_of(71), error, error.std())
    assert roll_rms(fed) < 1.03 * without()
    assert not fed.inner.doubts_forecasts


def test_a_forecast_of_the_wrong_sign_is_doubted_and_ignored():
    fed = Fed(-moment_of(71), 0.0, 0.0)
    assert roll_rms(fed) < 1.03 * without()
    assert fed.inner.doubts_forecasts


@settings(max_examples=20)
@given(seed=st.integers(0, 2**32 - 1), size=st.sampled_from([0.1, 1.0, 1e50, np.inf, np.nan]))
def test_no_forecast_brings_the_pump_beyond_its_limits(seed, size):
    rng = np.random.default_rng(seed)
    controller = previewed().controller()
    before = 0.0
    for _ in range(8):
        moment, deviation = rng.normal(size=(2, 20)) * rng.choice([0.01, size], size=(2, 20))
        controller.preview(WaveForecast(TIME_S, moment, deviation))
        pressure = float(controller.step(rng.normal(size=3) * (0.05, 0.03, 0.5))[0])
        assert abs(pressure) <= 50e3
        assert abs(pressure - before) <= 100e3 * 0.2 + 0.1  # commands along a limit have a grid
        before = pressure


def test_a_forecast_counts_for_one_step_and_a_reset_forgets_it():
    one, other = (previewed().controller() for _ in range(2))
    y = np.array([1e-3, 0.0, 0.0])
    one.preview(WaveForecast(TIME_S, np.full(20, 0.01), np.zeros(20)))
    assert one.step(y) != pytest.approx(other.step(y))
    one.reset()
    other.reset()
    assert one.step(y) == pytest.approx(other.step(y))
