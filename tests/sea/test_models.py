import itertools
import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import quad

from utank_hil.sea import ittc, jonswap, pierson_moskowitz
from utank_hil.sea.spectrum import developed_peak_period_s, ittc_density, jonswap_density

heights = st.floats(0.1, 20.0)
periods = st.floats(2.0, 25.0)


def integral(density, peak):
    """m0 by adaptive quadrature, the peak and the jump of sigma on the ends of intervals."""
    ends = [0.3, 0.8, 1.0, 1.2, 2.0, 10.0, 1000.0]
    return sum(
        quad(lambda u: float(density(np.array(u * peak))) * peak, a, b, epsabs=0, epsrel=1e-11)[0]
        for a, b in itertools.pairwise(ends)
    )


@given(heights, periods, st.floats(1.0, 7.0))
def test_jonswap_integrates_to_the_significant_height_exactly(hs, tp, gamma):
    m0 = integral(lambda omega: jonswap_density(omega, hs, tp, gamma), 2 * math.pi / tp)
    assert 4 * math.sqrt(m0) == pytest.approx(hs, rel=1e-10)


@given(heights, periods)
def test_ittc_integrates_to_the_significant_height_exactly(hs, tp):
    m0 = integral(lambda omega: ittc_density(omega, hs, tp), 2 * math.pi / tp)
    assert 4 * math.sqrt(m0) == pytest.approx(hs, rel=1e-10)


@given(heights)
def test_pierson_moskowitz_is_the_printed_formula(hs):
    g = 9.80665
    omega = np.linspace(0.2, 5, 200)
    printed = 8.1e-3 * g**2 / omega**5 * np.exp(-4 * 8.1e-3 * (g / hs) ** 2 / omega**4)
    computed = ittc_density(omega, hs, developed_peak_period_s(hs))
    np.testing.assert_allclose(computed, printed, rtol=1e-10, atol=1e-290)
    of_sea = pierson_moskowitz(hs)
    expected = ittc_density(2 * math.pi * of_sea.frequency_hz, hs, developed_peak_period_s(hs))
    np.testing.assert_allclose(of_sea.density, 2 * math.pi * expected)


def test_jonswap_without_enhancement_is_ittc_and_with_it_peaks_gamma_times_higher():
    omega = np.linspace(0.0, 5, 500)
    np.testing.assert_allclose(
        jonswap_density(omega, 3.0, 9.0, 1.0), ittc_density(omega, 3.0, 9.0), rtol=1e-14
    )
    peak = np.array([2 * math.pi / 9.0, 5.0])
    ratio = jonswap_density(peak, 3.0, 9.0, 3.3) / ittc_density(peak, 3.0, 9.0)
    assert ratio[0] / ratio[1] == pytest.approx(3.3)
    # one sigma off the peak, 0.07 below and 0.09 above, the exponent has fallen to exp(-1/2)
    beside = peak[0] * np.array([0.93, 1.09])
    ratio_beside = jonswap_density(beside, 3.0, 9.0, 3.3) / ittc_density(beside, 3.0, 9.0)
    np.testing.assert_allclose(ratio_beside / ratio[1], 3.3 ** math.exp(-0.5), rtol=1e-10)
    # the usual fit of the normalisation, DNV-RP-C205 3.5.5.5, is good to 2 %
    assert ratio[1] == pytest.approx(1 - 0.287 * math.log(3.3), rel=0.02)


def test_ittc_is_the_bretschneider_formula_of_the_1978_conference():
    hs, tp = 4.0, 11.0
    t1 = tp / 1.296  # mean period
    omega = np.linspace(0.4, 2.5, 100)
    printed = 173 * hs**2 / t1**4 / omega**5 * np.exp(-691 / t1**4 / omega**4)
    np.testing.assert_allclose(ittc_density(omega, hs, tp), printed, rtol=0.01)


@pytest.mark.parametrize(
    "spectrum", [jonswap(4.7, 10.0), ittc(4.7, 10.0), pierson_moskowitz(4.7), jonswap(4.7, 10.0, 7)]
)
def test_sampled_spectrum_keeps_height_but_for_the_tail(spectrum):
    assert spectrum.hs_m == pytest.approx(4.7, rel=1e-4)
    assert spectrum.hs_m < 4.7


def test_sampled_spectrum_keeps_periods():
    assert jonswap(4.7, 10.0).tp_s == pytest.approx(10.0)
    # Bretschneider: Tz = 0.710 Tp
    assert ittc(4.7, 10.0).tz_s == pytest.approx(7.10, rel=0.01)


def test_density_is_zero_at_and_near_zero_frequency():
    omega = np.array([0.0, 1e-6, 0.05])
    assert np.all(jonswap_density(omega, 5.0, 10.0) == 0)


@pytest.mark.parametrize("bad", [0.0, -1.0, math.nan, math.inf])
def test_bad_parameters_are_refused_by_name(bad):
    with pytest.raises(ValueError, match="hs_m"):
        jonswap(bad, 10.0)
    with pytest.raises(ValueError, match="hs_m"):
        pierson_moskowitz(bad)
    with pytest.raises(ValueError, match="tp_s"):
        ittc_density(np.ones(1), 1.0, bad)
    with pytest.raises(ValueError, match="gamma"):
        jonswap(1.0, 10.0, gamma=bad)
