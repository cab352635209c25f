import numpy as np
import pytest

from utank_hil.sea import Sea, jonswap
from utank_hil.sea.sea import PassingSea

YOUNG, OLD = jonswap(1.5, 6.0), jonswap(4.0, 11.0)


def drawn(seed, **sizes):
    return PassingSea.drawn([100.0, 500.0], [YOUNG, OLD], seed, heading_rad=[0.2, 1.4], **sizes)


def test_sea_of_one_spectrum_is_the_sea_that_is_drawn_from_it():
    alone = Sea.irregular(OLD, 3, heading_rad=0.7, spreading=10.0)
    passing = PassingSea.drawn([0.0], [OLD], 3, heading_rad=[0.7], spreading=10.0)
    for sea in (passing, PassingSea.of(alone)):
        amplitude_m, heading_rad = sea.at(1e4)
        np.testing.assert_allclose(amplitude_m, alone.amplitude_m, rtol=1e-12)
        np.testing.assert_array_equal(sea.omega_rad_s, alone.omega_rad_s)
        np.testing.assert_allclose(np.sin(heading_rad), np.sin(alone.heading_rad), atol=1e-12)


@pytest.mark.parametrize(
    ("time_s", "share"), [(0.0, 0.0), (100.0, 0.0), (200.0, 0.25), (500.0, 1.0), (1e5, 1.0)]
)
def test_variance_passes_linearly_between_spectra(time_s, share):
    amplitude_m, heading_rad = drawn(1).at(time_s)
    expected = (1 - share) * YOUNG.moment(0) + share * OLD.moment(0)
    assert (amplitude_m**2).sum() / 2 == pytest.approx(expected, rel=1e-9)
    if share in (0.0, 1.0):
        there = amplitude_m > 1e-6
        np.testing.assert_allclose(heading_rad[there], 1.4 if share else 0.2, atol=1e-9)
    else:
        assert heading_rad.min() >= 0.2 - 1e-9
        assert heading_rad.max() <= 1.4 + 1e-9


def test_mean_over_seeds_has_each_spectrum_and_the_one_in_between():
    edges = np.linspace(0.3, 2.4, 8)
    for time_s, share in ((100.0, 0.0), (300.0, 0.5), (500.0, 1.0)):
        found = np.zeros(len(edges) - 1)
        for seed in range(60):
            sea = drawn(seed, components=256)
            energy = sea.at(time_s)[0] ** 2 / 2
            found += np.histogram(sea.omega_rad_s, edges, weights=energy)[0] / 60
        expected = np.zeros_like(found)
        for spectrum, weight in ((YOUNG, 1 - share), (OLD, share)):
            fine = spectrum.band_edges_hz
            inner = np.clip(2 * np.pi * fine[:, :, None], edges[:-1], edges[1:]) / (2 * np.pi)
            expected += weight * spectrum.density @ (inner[:, 1] - inner[:, 0])
        np.testing.assert_allclose(found, expected, atol=0.01 * expected.sum())
