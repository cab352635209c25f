"""Square-root recursive least squares against the batch solution, and over days."""

import numpy as np
import pytest
from roll_plant import SAMPLE_TIME_S, noisy, plant, pulses

from utank_hil.base.arrays import FloatArray
from utank_hil.identification import RecursiveArx
from utank_hil.identification.lag_regression import LagRegression

SCALE = ([0.05, 2.5], [2.5e4])


def _run(model: RecursiveArx, u: FloatArray, y: FloatArray) -> FloatArray:
    return np.array([model.update(u[k : k + 1], y[k]) for k in range(len(u))])


def _record(
    seed: int, period_s: float = 12.566, noise: float = 0.01
) -> tuple[FloatArray, FloatArray]:
    u = pulses(seed)
    return u, noisy(plant(period_s).respond(u, 0 * u), noise, seed)


def test_estimate_is_the_batch_solution_with_the_same_weights() -> None:
    u, y = _record(1)
    model = RecursiveArx(6, *SCALE, SAMPLE_TIME_S, forgetting=0.995)
    errors = _run(model, u, y)
    z = np.column_stack([y, u]) / np.concatenate(SCALE)
    matrix, targets = LagRegression(z, 2, 6, np.empty((0, len(z)))).matrix()
    weights = 0.995 ** (0.5 * np.arange(len(matrix))[::-1])
    # the prior counts as rows from before the first, by now forgotten
    prior = 1e-8 * np.eye(matrix.shape[1])
    stacked = np.vstack([matrix * weights[:, None], prior])
    wanted = np.vstack([targets * weights[:, None], np.zeros((len(prior), 2))])
    expected = np.linalg.lstsq(stacked, wanted, rcond=None)[0]
    alpha1 = expected[1:3].T * np.array(SCALE[0])[:, None] / SCALE[0]
    np.testing.assert_allclose(model.arx.alpha[0], alpha1, rtol=1e-4)
    np.testing.assert_allclose(
        model.arx.beta[0][:, 0], expected[0] * SCALE[0] / SCALE[1][0], rtol=1e-3, atol=1e-12
    )
    # and the errors it gave are those of predicting ahead
    assert np.isnan(errors[:6]).all()
    late = model.arx.predict(u[-500:, None], y[-500:])[6:] - y[-494:]
    assert np.std(late[:, 0]) == pytest.approx(np.std(errors[-494:, 0]), rel=0.1)


def test_change_of_the_ship_is_followed() -> None:
    u, y = _record(1, noise=1e-3)
    v, w = _record(2, 7.5, noise=1e-3)
    model = RecursiveArx(6, *SCALE, SAMPLE_TIME_S, forgetting=0.99)
    _run(model, u, y)
    before = model.arx.alpha
    _run(model, v, w)
    fresh = RecursiveArx(6, *SCALE, SAMPLE_TIME_S, forgetting=0.99)
    _run(fresh, v, w)
    np.testing.assert_allclose(model.arx.alpha, fresh.arx.alpha, atol=1e-4)
    assert np.abs(model.arx.alpha - before).max() > 0.01


def test_gap_teaches_nothing_and_its_neighbours_are_left_out() -> None:
    u, y = _record(1)
    model = RecursiveArx(6, *SCALE, SAMPLE_TIME_S)
    _run(model, u[:500], y[:500])
    assert np.isnan(model.update(u[500], [np.nan, y[500, 1]])).all()
    errors = _run(model, u[501:508], y[501:508])
    assert np.isnan(errors[:6]).all()
    assert np.abs(errors[6] / np.std(y, axis=0)).max() < 0.05
    assert model.updates == 500 - 6 + 1


def test_number_that_is_no_measurement_is_a_gap_and_spoils_nothing() -> None:
    u, y = _record(1)
    spoiled, gapped = RecursiveArx(6, *SCALE, SAMPLE_TIME_S), RecursiveArx(6, *SCALE, SAMPLE_TIME_S)
    for model, value in ((spoiled, 1e300), (gapped, np.nan)):
        v = u.copy()
        v[700] = value
        _run(model, v, y)
    np.testing.assert_array_equal(spoiled.arx.alpha, gapped.arx.alpha)
    assert np.isfinite(spoiled.arx.alpha).all()


@pytest.mark.evidence
def test_stays_stable_over_half_a_day_with_hours_of_still_water() -> None:
    # 200000 samples of 0.2 s are 11 hours; the middle half has no signal but the last bit of noise
    model = RecursiveArx(4, *SCALE, SAMPLE_TIME_S, forgetting=0.99)
    u, y = _record(1)
    for _ in range(20):
        _run(model, u, y)
    for _ in range(100_000):
        model.update([0.0], [0.0, 0.0])
    errors = np.zeros(0)
    for _ in range(20):
        errors = _run(model, u, y)
    assert model.updates > 199_000
    fresh = RecursiveArx(4, *SCALE, SAMPLE_TIME_S, forgetting=0.99)
    _run(fresh, u, y)
    np.testing.assert_allclose(model.arx.alpha, fresh.arx.alpha, atol=1e-6)
    assert np.isfinite(errors[4:]).all()
    gram = model._root @ model._root.T
    assert np.linalg.eigvalsh(gram).min() > 0


def test_bad_parameters_are_refused() -> None:
    with pytest.raises(ValueError, match="forgetting"):
        RecursiveArx(4, *SCALE, SAMPLE_TIME_S, forgetting=0.0)
    with pytest.raises(ValueError, match="order"):
        RecursiveArx(0, *SCALE, SAMPLE_TIME_S)
    with pytest.raises(ValueError, match="scales"):
        RecursiveArx(4, [0.0], [1.0], SAMPLE_TIME_S)
    with pytest.raises(ValueError, match="sample_time_s"):
        RecursiveArx(4, *SCALE, sample_time_s=-1)
