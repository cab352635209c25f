"""Excitations keep the pump's limits, excite, and come out the same for the same seed."""

from functools import partial

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from roll_plant import SAMPLE_TIME_S, plant

from utank_hil.control import ARX
from utank_hil.control.interface import PumpLimits
from utank_hil.identification import chirp, multisine, prbs, random_pulses, response_scale
from utank_hil.identification.lag_regression import LagRegression, input_excitation

LIMITS = PumpLimits(pressure_pa=5e4, rate_pa_s=1e5)
pulses = partial(random_pulses, sample_time_s=SAMPLE_TIME_S)
SIGNALS = {
    "random pulses": pulses,
    "prbs": partial(prbs, sample_time_s=SAMPLE_TIME_S),
    "multisine": partial(multisine, sample_time_s=SAMPLE_TIME_S),
    "chirp": lambda duration_s, limits, seed: chirp(
        duration_s, limits, sample_time_s=SAMPLE_TIME_S
    ),
}


@pytest.mark.parametrize("name", SIGNALS)
@settings(max_examples=20)
@given(
    duration_s=st.floats(40.0, 600.0),
    pressure_pa=st.floats(1.0, 1e6),
    seconds_to_full=st.floats(0.01, 60.0),
    seed=st.integers(0, 99),
)
def test_pressure_and_rate_are_kept_and_both_ends_are_zero(
    name, duration_s, pressure_pa, seconds_to_full, seed
):
    limits = PumpLimits(pressure_pa=pressure_pa, rate_pa_s=pressure_pa / seconds_to_full)
    pressure = SIGNALS[name](duration_s, limits, seed)
    assert len(pressure) == round(duration_s / SAMPLE_TIME_S)
    assert np.abs(pressure).max() <= limits.pressure_pa * (1 + 1e-12)
    steps = np.diff(pressure, prepend=0.0, append=0.0)
    assert np.abs(steps).max() <= limits.rate_pa_s * SAMPLE_TIME_S * (1 + 1e-9)
    assert pressure[0] == pressure[-1] == 0
    assert np.array_equal(pressure, SIGNALS[name](duration_s, limits, seed))


@pytest.mark.parametrize("name", ["random pulses", "prbs", "multisine"])
def test_another_seed_gives_another_signal_of_useful_size(name):
    one, other = (SIGNALS[name](500.0, LIMITS, seed) for seed in (1, 2))
    assert not np.array_equal(one, other)
    assert np.std(one) > 0.15 * LIMITS.pressure_pa


def excitation_order(u, most):
    signal = u.reshape(len(u), -1)
    regression = LagRegression(signal, 0, most - 1, np.empty((0, len(u))))
    return input_excitation(regression, regression.matrix.T @ regression.matrix)[0]


def test_random_pulses_excite_every_coefficient_of_the_thesis_models():
    assert (
        excitation_order(random_pulses(500.0, LIMITS, 1, sample_time_s=SAMPLE_TIME_S), 201) == 201
    )


def test_order_of_excitation_counts_sines_twice_and_a_constant_once():
    time_s = np.arange(1000) * SAMPLE_TIME_S
    one, two = np.sin(1.0 * time_s), np.sin(3.0 * time_s)
    assert excitation_order(np.ones(1000), 10) == 1
    assert excitation_order(one, 10) == 2
    assert excitation_order(one + two + 3, 10) == 5
    holed = one + two
    holed[500] = np.nan
    assert excitation_order(holed, 10) == 4
    assert excitation_order(np.random.default_rng(0).standard_normal((500, 2)), 10) == 10


def test_narrow_band_is_seen_for_what_it_is():
    angle = np.outer(np.arange(2500) * SAMPLE_TIME_S, np.linspace(0.4, 0.6, 15))
    narrow = np.cos(angle + np.arange(15) ** 2).sum(axis=1)
    assert 8 <= excitation_order(narrow, 201) < 40


def test_scale_keeps_level_and_added_roll_within_their_limits():
    truth = plant()
    model = ARX.from_state_space(truth.state_space(), 4)
    pressure = random_pulses(500.0, LIMITS, 1, sample_time_s=SAMPLE_TIME_S)
    response = np.abs(truth.respond(pressure, 0 * pressure)).max(axis=0)
    limits = response * [0.5, 0.8]
    scale = response_scale(pressure, model, limits)
    assert scale == pytest.approx(0.5, rel=2e-6)
    assert (scale * 2**20).is_integer()  # no last digit of the prediction is left
    scaled = np.abs(truth.respond(scale * pressure, 0 * pressure)).max(axis=0)
    assert np.all(scaled <= limits * (1 + 1e-9))
    assert response_scale(pressure, model, response * 2) == 1.0
    assert response_scale(0 * pressure, model, response) == 1.0


def test_multisine_and_chirp_hold_their_band():
    for pressure in (
        multisine(500.0, LIMITS, 1, sample_time_s=SAMPLE_TIME_S),
        chirp(500.0, LIMITS, sample_time_s=SAMPLE_TIME_S),
    ):
        power = np.abs(np.fft.rfft(pressure)) ** 2
        omega = 2 * np.pi * np.fft.rfftfreq(len(pressure), SAMPLE_TIME_S)
        inside = (omega > 0.19) & (omega < 1.25)
        assert power[inside].sum() > 0.97 * power.sum()
    with pytest.raises(ValueError, match="no harmonic"):
        multisine(5.0, LIMITS, 1, band_rad_s=(0.2, 0.3), sample_time_s=SAMPLE_TIME_S)
    with pytest.raises(ValueError, match="band_rad_s must rise"):
        chirp(50.0, LIMITS, band_rad_s=(1.0, 0.3), sample_time_s=SAMPLE_TIME_S)


def test_bad_requests_are_refused():
    with pytest.raises(ValueError, match="do not last one sample"):
        random_pulses(0.05, LIMITS, 1, sample_time_s=SAMPLE_TIME_S)
    with pytest.raises(ValueError, match="hold_s must rise"):
        random_pulses(10.0, LIMITS, 1, hold_s=(3.0, 1.0), sample_time_s=SAMPLE_TIME_S)
    with pytest.raises(ValueError, match="sample_time_s"):
        random_pulses(50.0, LIMITS, 1, sample_time_s=0.0)
    model = ARX.from_state_space(plant().state_space(), 4)
    with pytest.raises(ValueError, match="2 positive values"):
        response_scale(np.zeros(9), model, np.array([0.1]))
    two_inputs = ARX(np.zeros((1, 1, 1)), np.zeros((2, 1, 2)), 0.2)
    with pytest.raises(ValueError, match="one input"):
        response_scale(np.zeros(9), two_inputs, np.array([0.1]))
