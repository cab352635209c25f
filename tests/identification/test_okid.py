"""OKID: exact on exact data, right under waves, clear when it cannot be."""

import inspect

import control
import numpy as np
import pytest
from roll_plant import (
    BAND_RAD_S,
    SAMPLE_TIME_S,
    frequency_response,
    noisy,
    plant,
    pulses,
    realized,
    response_error,
)

from utank_hil.identification import (
    IdentificationError,
    arx,
    find_disturbance_frequencies,
    okid,
)

WAVE_RAD_S = 0.6


def _wave(samples, phase=1.0, omega=WAVE_RAD_S):
    return 2e7 * np.cos(omega * np.arange(samples) * SAMPLE_TIME_S + phase)


def _relative(found, true):
    return float(np.max(np.abs(found - true).max(axis=(0, 2)) / np.abs(true).max(axis=(0, 2))))


def test_the_model_alone_is_that_of_okid_and_a_decaying_disturbance_is_no_ship():
    u, truth = pulses(1), plant()
    y = truth.respond(u, np.zeros_like(u))
    model = arx(u, y, 12, sample_time_s=SAMPLE_TIME_S)
    found = okid(u, y, 12, sample_time_s=SAMPLE_TIME_S).arx
    np.testing.assert_array_equal(model.alpha, found.alpha)
    np.testing.assert_array_equal(model.beta, found.beta)
    rates = (0.02, -0.01)
    late_s = SAMPLE_TIME_S * (np.arange(len(u)) - len(u))
    drifting = y + 0.3 * np.exp(-0.02 * SAMPLE_TIME_S * np.arange(len(u)))[:, None]
    drifting += 0.1 * np.exp(0.01 * late_s)[:, None]
    told = okid(u, drifting, 2, sample_time_s=SAMPLE_TIME_S, disturbance_decay_rates_1_s=rates)
    assert _relative(told.markov, truth.markov(401)) < 1e-7
    assert _relative(okid(u, drifting, 2, sample_time_s=SAMPLE_TIME_S).markov, told.markov) > 1e-4
    for wrong in ((0.0,), (0.1, 0.1), (np.nan,)):
        with pytest.raises(ValueError, match="decay"):
            arx(u, y, 12, sample_time_s=SAMPLE_TIME_S, disturbance_decay_rates_1_s=wrong)


@pytest.mark.parametrize(("order", "outputs"), [(2, 2), (30, 2), (120, 2), (200, 1)])
def test_exact_data_give_markov_parameters_poles_and_zeros(order, outputs):
    u, truth = pulses(1), plant()
    y = truth.respond(u, np.zeros_like(u))[:, :outputs]
    result = okid(u, y, order, sample_time_s=SAMPLE_TIME_S)
    assert _relative(result.markov, truth.markov(401)[:, :outputs]) < 1e-8
    system = realized(result, 4)
    expected = truth.state_space()[:outputs, 0]
    order_of = np.argsort
    poles, right = system.poles(), expected.poles()
    np.testing.assert_allclose(
        poles[order_of(poles.imag)], right[order_of(right.imag)], atol=1e-8, rtol=0
    )
    for i in range(outputs):
        zeros, wanted = control.zeros(system[i, 0]), control.zeros(expected[i, 0])
        # the realized system has one zero far out, where the true one has none
        near = zeros[np.abs(zeros) < 1e3]
        np.testing.assert_allclose(
            near[order_of(near.imag)], wanted[order_of(wanted.imag)], atol=1e-8, rtol=0
        )


@pytest.mark.parametrize("order", [30, 120])
def test_wave_of_known_frequency_and_unknown_phase_leaves_the_model_exact(order):
    u, truth = pulses(1), plant()
    y = truth.respond(u, _wave(len(u)))
    result = okid(
        u, y, order, disturbance_frequencies_rad_s=[WAVE_RAD_S], sample_time_s=SAMPLE_TIME_S
    )
    assert _relative(result.markov, truth.markov(401)) < 1e-8
    assert response_error(realized(result, 4), truth).max() < 1e-8


def test_wave_of_unknown_frequency_and_phase_gives_the_same_model():
    u, truth = pulses(1), plant()
    calm = noisy(truth.respond(u, np.zeros_like(u)), 0.01, 2)
    y = calm + truth.respond(np.zeros_like(u), _wave(len(u), 2.0, 0.6173))
    frequencies = find_disturbance_frequencies(u, y, sample_time_s=SAMPLE_TIME_S)
    assert frequencies == pytest.approx([0.6173], abs=2e-4)
    quiet = realized(okid(u, calm, 120, sample_time_s=SAMPLE_TIME_S), 4)
    rough = realized(
        okid(u, y, 120, disturbance_frequencies_rad_s=frequencies, sample_time_s=SAMPLE_TIME_S),
        4,
    )
    assert response_error(quiet, truth).max() < 0.005
    assert response_error(rough, truth).max() < 0.005


def test_without_its_basis_a_low_order_is_ruined_by_a_wave_and_a_high_one_is_not():
    u, truth = pulses(1), plant()
    y = noisy(truth.respond(u, _wave(len(u))), 0.01, 2)
    error = {
        p: response_error(realized(okid(u, y, p, sample_time_s=SAMPLE_TIME_S), 4), truth).max()
        for p in (30, 120)
    }
    assert error[30] > 0.05
    assert error[120] < 0.01


def test_offset_and_drift_are_taken_out_by_their_basis():
    u, truth = pulses(1), plant()
    time_s = np.arange(len(u)) * SAMPLE_TIME_S
    still = truth.respond(u, np.zeros_like(u))
    heel = still + np.outer(0.02 + 1e-5 * time_s, [1.0, 5.0])
    markov = truth.markov(401)
    found = okid(u, heel, 8, disturbance_polynomial_degree=1, sample_time_s=SAMPLE_TIME_S)
    assert _relative(found.markov, markov) < 1e-8


def test_arx_predicts_the_record_and_markov_parameters_are_its_pulse_response():
    u = pulses(1)
    y = noisy(plant().respond(u, np.zeros_like(u)), 0.01, 2)
    result = okid(u, y, 20, sample_time_s=SAMPLE_TIME_S)
    errors = (y - result.arx.predict(u[:, None], y))[20:]
    covariance = errors.T @ errors / (result.rows - result.rank)
    np.testing.assert_allclose(result.residual_covariance, covariance, rtol=1e-8)
    pulse = np.zeros((300, 1))
    pulse[0] = 1.0
    np.testing.assert_allclose(
        result.markov[:300, :, 0], result.arx.simulate(pulse), rtol=1e-9, atol=1e-15
    )


def test_observer_of_the_identified_model_predicts_like_the_arx_model():
    u, truth = pulses(1), plant()
    y = noisy(truth.respond(u, np.zeros_like(u)), 0.01, 2)
    result = okid(u, y, 40, sample_time_s=SAMPLE_TIME_S)
    system = realized(result, 4)
    a, b, c = (np.asarray(part) for part in (system.A, system.B, system.C))
    # the observer's Markov parameters are C A^(k-1) K
    size = y.std(axis=0)[:, None]
    gains = result.observer_gain / size
    powers = [c @ np.linalg.matrix_power(a, k) / size for k in range(len(gains))]
    gain = np.linalg.lstsq(np.vstack(powers), gains.reshape(-1, 2), rcond=None)[0]
    d = np.asarray(system.D)[:, 0]
    state, errors = np.zeros(4), np.empty_like(y)
    for k in range(len(u)):
        errors[k] = y[k] - c @ state - d * u[k]
        state = a @ state + b[:, 0] * u[k] + gain @ errors[k]
    assert np.all(np.std(errors[200:], axis=0) < 1.1 * np.sqrt(np.diag(result.residual_covariance)))
    assert response_error(system, truth).max() < 0.01


def test_two_inputs_are_told_apart():
    u, moment = pulses(1), 4e2 * pulses(2)
    y = plant().respond(u, moment)
    result = okid(np.column_stack([u, moment]), y, 10, sample_time_s=SAMPLE_TIME_S)
    truth = plant()
    both = control.ss(truth.a, truth.b, truth.c, np.zeros((2, 2)), SAMPLE_TIME_S)
    found = frequency_response(realized(result, 4))
    np.testing.assert_allclose(found, frequency_response(both), rtol=1e-8)


def test_units_of_the_record_do_not_matter():
    u = pulses(1)
    y = noisy(plant().respond(u, np.zeros_like(u)), 0.01, 2)
    pascals = okid(u, y, 20, sample_time_s=SAMPLE_TIME_S).markov
    other = okid(u * 1e-5, y * [57.3, 100.0], 20, sample_time_s=SAMPLE_TIME_S).markov
    np.testing.assert_allclose(other / [[57.3e5], [100e5]], pascals, rtol=1e-6, atol=1e-20)


def test_gaps_are_left_out_and_time_goes_on_through_them():
    u, truth = pulses(1), plant()
    y = truth.respond(u, _wave(len(u)))
    y[500:530] = np.nan
    u[1500] = np.nan
    y[1800, 1] = np.inf
    result = okid(u, y, 30, disturbance_frequencies_rad_s=[WAVE_RAD_S], sample_time_s=SAMPLE_TIME_S)
    assert _relative(result.markov, truth.markov(401)) < 1e-8
    assert result.rows == 2500 - 30 - (30 + 30) - (1 + 30) - (1 + 30)


def test_excitation_order_is_reported():
    time_s = np.arange(2500) * SAMPLE_TIME_S
    u = 1e4 * (np.sin(0.5 * time_s) + np.sin(2.0 * time_s) + np.sin(5.0 * time_s))
    assert okid(u, plant().respond(u, 0 * u), 20, sample_time_s=SAMPLE_TIME_S).excitation_order == 6
    assert (
        okid(
            pulses(1), plant().respond(pulses(1), 0 * u), 20, sample_time_s=SAMPLE_TIME_S
        ).excitation_order
        == 21
    )


def _refused(reason, u, y, order=20):
    with pytest.raises(IdentificationError, match=reason):
        okid(u, y, order, sample_time_s=SAMPLE_TIME_S)


def test_records_that_tell_nothing_are_refused_with_the_reason():
    u = pulses(1)
    y = noisy(plant().respond(u, np.zeros_like(u)), 0.01, 2)
    time_s = np.arange(len(u)) * SAMPLE_TIME_S
    _refused("input 0 does not move", np.full_like(u, 3e4), y)
    _refused("output 1 does not move", u, y * [1, 0])
    _refused("persistently exciting of order 2 only", np.sin(0.5 * time_s), y)
    _refused("usable rows cannot determine", u[:70], y[:70])
    _refused("no row without a gap", u * np.nan, y)
    _refused("input 0 holds values up to .* a unit is wrong", u * 1e80, y)
    _refused("output 0 stays at its largest value", u, np.minimum(y, 0.7 * y.max(axis=0)))
    _refused(
        "output 1 stays at its smallest .* as gaps", u, np.maximum(y, [-1, -0.7 * y[:, 1].max()])
    )
    holed = y.copy()
    holed[::15] = np.nan
    _refused("no stretch of the record", u, holed)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"order": 0}, "order must be a positive integer"),
        ({"order": 2.5}, "order must be a positive integer"),
        ({"sample_time_s": 0.0}, "sample_time_s must be positive"),
        ({"disturbance_frequencies_rad_s": [0.0]}, "must be positive"),
        ({"disturbance_frequencies_rad_s": [0.5, 0.5]}, "distinct"),
        ({"disturbance_polynomial_degree": -1}, "0 or more"),
    ],
)
def test_bad_arguments_are_named(arguments, message):
    with pytest.raises(ValueError, match=message):
        okid(
            pulses(1),
            plant().respond(pulses(1), pulses(2)),
            **{"sample_time_s": SAMPLE_TIME_S, **arguments},  # type: ignore[arg-type]
        )


@pytest.mark.parametrize("function", [okid, find_disturbance_frequencies])
def test_no_sample_time_is_assumed(function):
    parameter = inspect.signature(function).parameters["sample_time_s"]
    assert parameter.default is inspect.Parameter.empty


@pytest.mark.parametrize("step", [1e-3, 1e-2, 0.1, 0.5])
@pytest.mark.parametrize("noise", [0.0, 0.02])
def test_coarse_steps_of_a_sensor_are_not_taken_for_clipping(step, noise):
    # a regular wave holds its peak for longest, and of the same height again and again
    time_s = np.arange(2500) * SAMPLE_TIME_S
    for period_s in (10.0, 10.47, 12.0):
        u = pulses(1)
        y = np.sin(2 * np.pi / period_s * time_s) + 1e-6 * u
        y += noise * np.random.default_rng(1).standard_normal(len(u))
        assert okid(u, step * np.round(y / step), 4, sample_time_s=SAMPLE_TIME_S).rows == 2496


def test_what_a_clipped_sensor_does_to_a_model_is_refused_before_it_matters():
    u, truth = pulses(1), plant()
    y = noisy(truth.respond(u, np.zeros_like(u)), 0.01, 2)
    for part in np.linspace(0.5, 1.0, 26):
        limit = part * np.abs(y[:, 0]).max()
        clipped = np.column_stack([np.clip(y[:, 0], -limit, limit), y[:, 1]])
        try:
            result = okid(u, clipped, 120, sample_time_s=SAMPLE_TIME_S)
        except IdentificationError:
            continue
        assert response_error(realized(result, 4), truth).max() < 0.03


def test_records_of_the_wrong_shape_are_refused():
    with pytest.raises(ValueError, match="y has 10 samples and u has 9"):
        okid(np.zeros(9), np.zeros(10), sample_time_s=SAMPLE_TIME_S)
    with pytest.raises(ValueError, match="u must have shape"):
        okid(np.zeros((10, 2, 2)), np.zeros(10), sample_time_s=SAMPLE_TIME_S)


def test_fast_sample_of_the_band_holds_the_resonance():
    # the tests above measure errors over this band: it must hold both modes
    frequencies = np.abs(plant().poles_rad_s())
    assert BAND_RAD_S[0] < frequencies.min() < frequencies.max() < BAND_RAD_S[-1]
