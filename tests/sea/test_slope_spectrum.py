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
    assert found.tp_s == pytest.approx(2 * np.pi / OMEGA[np.argmax(found.density)])


@pytest.mark.parametrize(
    ("omega", "density", "deviation", "words"),
    [
        ([0.1], [1.0], None, "two or more"),
        ([0.1, 0.2], [1.0], None, "as many densities"),
        ([0.1, 0.2, 0.4], [1.0] * 3, None, "equally spaced"),
        ([0.0, 0.1], [1.0] * 2, None, "positive"),
        ([0.1, 0.2], [1.0, -1.0], None, "density must be"),
        ([0.1, 0.2], [1.0, 1.0], [1.0, np.nan], "deviation must be"),
    ],
)
def test_what_is_no_spectrum_is_refused(omega, density, deviation, words):
    given = [None if part is None else np.array(part) for part in (omega, density, deviation)]
    with pytest.raises(ValueError, match=words):
        SlopeSpectrum(*given)
