"""The spectrum of the wave moment: its integrals and what it says of the waves."""

import numpy as np
import pytest

from utank_hil.sea import EffectiveSlope, SlopeSpectrum
from utank_hil.sea.spectrum import jonswap_density

OMEGA = np.arange(0.1, 2.5, 0.01)


def slope_of(hs_m, tp_s, coefficient):
    """JONSWAP on the beam, by the moment that the ship's model of waves gives."""
    moment = np.abs(EffectiveSlope(coefficient).moment(OMEGA, np.full(OMEGA.size, np.pi / 2), 1.0))
    return SlopeSpectrum(OMEGA, jonswap_density(OMEGA, hs_m, tp_s) * moment**2)


def test_height_and_period_of_a_beam_sea_come_back():
    found = slope_of(3.0, 9.0, 0.5)
    assert found.hs_m(0.5) == pytest.approx(3.0, rel=0.01)
    assert found.hs_m(0.25) == pytest.approx(6.0, rel=0.01)
    height = found.elevation_density(0.5)
    assert 2 * np.pi / OMEGA[np.argmax(height)] == pytest.approx(9.0, rel=0.02)


def test_rms_is_the_integral_of_what_a_law_is_designed_with():
    found = slope_of(3.0, 9.0, 0.5)
    fine = np.linspace(0.05, 3.0, 20_000)
    assert found.rms_rad == pytest.approx(
        np.sqrt(np.trapezoid(found.slope_density(fine), fine)), rel=1e-3
    )
    assert found.slope_density(np.array([0.05, 2.6])).tolist() == [0.0, 0.0]


@pytest.mark.parametrize(
    ("omega", "density", "words"),
    [
        ([0.1], [1.0], "two or more"),
        ([0.1, 0.2], [1.0], "as many densities"),
        ([0.1, 0.2, 0.4], [1.0] * 3, "equally spaced"),
        ([0.0, 0.1], [1.0] * 2, "positive"),
        ([0.1, 0.2], [1.0, -1.0], "density must be"),
        ([0.1, 0.2], [1.0, np.nan], "density must be"),
    ],
)
def test_what_is_no_spectrum_is_refused(omega, density, words):
    with pytest.raises(ValueError, match=words):
        SlopeSpectrum(np.array(omega), np.array(density))
