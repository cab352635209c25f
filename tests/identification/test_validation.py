"""Validation tells a good model from each kind of bad one."""

import numpy as np
import pytest
from roll_plant import SAMPLE_TIME_S, noisy, plant, pulses

from utank_hil.control import ARX
from utank_hil.identification import IdentificationError, okid, validate


def _arx_record(seed, samples=4000):
    """A record whose one-step errors are white by construction."""
    rng = np.random.default_rng(seed)
    model = ARX(
        np.array([[[1.6, 0.1], [0.0, 1.2]], [[-0.8, 0.0], [0.1, -0.5]]]),
        np.array([[[0.0], [0.0]], [[1.0], [0.5]], [[0.2], [-0.4]]]),
        0.2,
    )
    u = np.repeat(rng.standard_normal(samples // 5), 5)
    y = np.zeros((samples, 2))
    for k in range(2, samples):
        y[k] = (
            model.alpha[0] @ y[k - 1]
            + model.alpha[1] @ y[k - 2]
            + model.beta[1] @ u[k - 1 : k]
            + model.beta[2] @ u[k - 2 : k - 1]
            + 0.1 * rng.standard_normal(2)
        )
    return model, u, y


def test_true_model_has_white_errors():
    result = validate(*_arx_record(1))
    assert np.abs(result.residual_correlation).max() < 4 / np.sqrt(result.rows)
    assert result.residual_correlation.shape == (25, 2)


def test_fit_is_that_of_the_prediction_by_the_model_itself():
    model, u, y = _arx_record(1)
    result = validate(model, u, y)
    errors = (y - model.predict(u[:, None], y))[25:]
    expected = 1 - np.sqrt(np.mean(errors**2, axis=0)) / np.std(y[25:], axis=0)
    np.testing.assert_allclose(result.one_step_fit, expected, rtol=1e-9)


def test_a_wrong_input_path_fits_worse_and_a_low_order_is_not_white():
    model, u, y = _arx_record(1)
    right = validate(model, u, y)
    wrong = validate(ARX(model.alpha, model.beta * 1.2, 0.2), u, y)
    assert np.all(wrong.one_step_fit < right.one_step_fit)
    low = validate(okid(u, y, 1, sample_time_s=SAMPLE_TIME_S).arx, u, y)
    assert np.abs(low.residual_correlation).max() > 10 / np.sqrt(low.rows)


def test_an_exact_model_predicts_exactly_through_gaps_and_waves():
    truth, u = plant(), pulses(1)
    wave = 2e7 * np.cos(0.6 * np.arange(len(u)) * SAMPLE_TIME_S)
    y = truth.respond(u, wave)
    y[1000] = np.nan
    model = ARX.from_state_space(truth.state_space(), 4)
    assert validate(model, u, y, [0.6]).one_step_fit.min() > 1 - 1e-9
    assert validate(model, u, y).one_step_fit.max() < 1 - 1e-6


def test_held_out_record_of_the_ship_is_predicted():
    truth, u, v = plant(), pulses(1), pulses(2)
    model = okid(u, noisy(truth.respond(u, 0 * u), 0.01, 1), 60, sample_time_s=SAMPLE_TIME_S).arx
    result = validate(model, v, noisy(truth.respond(v, 0 * v), 0.01, 2))
    assert result.one_step_fit.min() > 0.985


def test_offset_beside_which_a_model_was_identified_is_no_error_of_it():
    model, u, y = _arx_record(3)
    upright = validate(model, u, y, disturbance_polynomial_degree=0)
    for heel in (5.0, -500.0):
        heeled = validate(model, u, y + heel, disturbance_polynomial_degree=0)
        for name in ("one_step_fit", "residual_correlation"):
            expected = getattr(upright, name)
            np.testing.assert_allclose(getattr(heeled, name), expected, rtol=0, atol=1e-7)
        blind = validate(model, u, y + heel)
        assert blind.one_step_fit.max() < upright.one_step_fit.min()


def test_record_that_does_not_fit_is_refused():
    model, u, y = _arx_record(1)
    with pytest.raises(ValueError, match="2 outputs and 1 inputs, the record 1 and 1"):
        validate(model, u, y[:, 0])
    with pytest.raises(IdentificationError, match="does not move"):
        validate(model, 0 * u, y)
    with pytest.raises(IdentificationError, match="longer than the order"):
        validate(model, u[:20], y[:20])
    with pytest.raises(IdentificationError, match=r"5 predictions are too few .* 25 lags"):
        validate(model, u[:30], y[:30])
    with pytest.raises(ValueError, match="lags must be a positive integer, got 0"):
        validate(model, u, y, lags=0)
    late = np.where(np.arange(len(u)) < len(u) - 5, 0.0, u)
    with pytest.raises(IdentificationError, match="input 0 does not move in the samples that"):
        validate(model, late, y)
    with pytest.raises(IdentificationError, match="predictions of this record overflow"):
        validate(ARX(1e300 * model.alpha, model.beta, 0.2), u, y)


def test_units_of_the_record_do_not_matter():
    model, u, y = _arx_record(1)
    scale = np.array([1e-30, 1e30])
    other = ARX(
        model.alpha * scale[:, None] / scale,
        model.beta * scale[:, None] / 1e-20,
        model.sample_time_s,
    )
    one, two = validate(model, u, y), validate(other, 1e-20 * u, scale * y)
    np.testing.assert_allclose(two.one_step_fit, one.one_step_fit)
    np.testing.assert_allclose(two.residual_correlation, one.residual_correlation, atol=1e-9)
