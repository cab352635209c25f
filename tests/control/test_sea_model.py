"""The sea's model: its spectrum is the spectrum, its forecast the best there is."""

import numpy as np
import pytest
from scipy.linalg import solve_discrete_lyapunov, solve_toeplitz

from utank_hil.control.sea_model import SeaModel
from utank_hil.dynamics.sampling import state_space_response
from utank_hil.sea import jonswap

SPECTRUM = jonswap(4.7, 10.0)
TS = 0.2


def sea(**changes) -> SeaModel:
    settings = {"order": 16, "floor": 1e-4, **changes}
    return SeaModel(tuple(SPECTRUM.frequency_hz), tuple(SPECTRUM.density), **settings)


def test_response_of_the_shaping_filter_has_the_shape_of_the_spectrum():
    omega = np.linspace(0.5, 2.0, 200)
    model = sea(smoothing_rad_s=0.005)
    found = state_space_response(model.shaping_filter(TS), np.exp(1j * omega * TS))[:, 0, 0]
    density = np.abs(found) ** 2 * TS / np.pi
    expected = model.slope_density(omega)
    # the model smooths the steps between the bands
    assert np.abs(density - expected).max() < 0.1 * expected.max()


def test_variance_of_the_shaping_filter_is_that_of_the_slope():
    model = sea()
    shaping = model.shaping_filter(TS)
    covariance = solve_discrete_lyapunov(shaping.A, shaping.B @ shaping.B.T)
    variance = (shaping.C @ covariance @ shaping.C.T).item()
    omega = np.linspace(0.01, np.pi / TS, 20_000)
    assert variance == pytest.approx(np.trapezoid(model.slope_density(omega), omega), rel=0.02)


@pytest.mark.parametrize("order", [4, 8, 16, 32])
def test_model_is_stable_at_any_order(order):
    shaping = sea(order=order).shaping_filter(TS)
    assert np.abs(np.linalg.eigvals(shaping.A)).max() < 1


def test_no_state_has_the_sign_that_the_eigensolver_happened_to_give():
    """Releases of scipy differ in it, and a law of other signs looks like another law."""
    for order in (4, 8, 16, 32):
        assert (sea(order=order).shaping_filter(TS).C >= 0).all()


def test_one_step_forecast_error_is_that_of_a_long_regression():
    # an AR model of order 300 from the exact autocovariance: Levinson, no spectral factorization
    model = sea(floor=1e-3)
    omega = np.linspace(1e-4, np.pi / TS, 60_000)
    density = model.slope_density(omega)
    density += model.floor * density.max()
    lags = TS * np.arange(301)
    step = omega[1] - omega[0]
    covariance = np.array([(density * np.cos(omega * lag)).sum() * step for lag in lags])
    weights = solve_toeplitz(covariance[:-1], covariance[1:])
    error = covariance[0] - weights @ covariance[1:]
    shaping = model.shaping_filter(TS)
    assert (shaping.C @ shaping.B).item() ** 2 == pytest.approx(error, rel=0.1)


@pytest.mark.parametrize("sample_time_s", [0.2, 0.1, 0.05, 0.02, 0.01])
def test_front_of_the_sea_is_as_steep_at_any_sample_time(sample_time_s):
    omega = np.linspace(0.05, 2.0, 400)
    model = sea(order=8, floor=1.3e-3)
    shaping = model.shaping_filter(sample_time_s)
    found = state_space_response(shaping, np.exp(1j * omega * sample_time_s))[:, 0, 0]
    density = np.abs(found) ** 2 * sample_time_s / np.pi
    expected = model.slope_density(omega)
    expected += model.floor * expected.max()
    calm = omega < 0.5  # below the front there is little but the floor
    assert density[calm].sum() == pytest.approx(expected[calm].sum(), rel=0.2)
    assert density[~calm].sum() == pytest.approx(expected[~calm].sum(), rel=0.02)


def test_sample_time_with_too_few_samples_for_the_order_is_refused():
    assert len(sea(order=15).shaping_filter(10.0).A) == 15
    with pytest.raises(ValueError, match=r"order 16 must be below 16, the samples in 160 s"):
        sea(order=16).shaping_filter(10.0)


@pytest.mark.parametrize("field", ["effective_slope", "order", "floor", "smoothing_rad_s"])
def test_bad_values_are_refused_by_name(field):
    with pytest.raises(ValueError, match=field):
        sea(**{field: 0})


def test_a_flat_calm_is_refused():
    with pytest.raises(ValueError, match="energy"):
        SeaModel((0.1, 0.2), (0.0, 0.0))


def test_a_sea_known_by_its_slope_is_the_sea_known_by_its_height():
    omega = np.geomspace(0.1, 5.0, 600)
    given = sea()
    model = SeaModel.of_slope(omega, given.slope_density(omega), order=16)
    inside = np.linspace(0.5, 2.0, 50)
    difference = np.abs(model.slope_density(inside) - given.slope_density(inside))
    assert difference.max() < 0.05 * given.slope_density(inside).max()
