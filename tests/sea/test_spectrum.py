import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from utank_hil.sea import Spectrum
from utank_hil.sea.spectrum import band_edges

# "Description of NDBC wave spectra", www.ndbc.noaa.gov/faq/wavespectra.shtml:
# first and last centre, bandwidth
NDBC_BANDS = (
    (0.02, 0.02, 0.010),
    (0.0325, 0.0925, 0.005),
    (0.1, 0.35, 0.010),
    (0.365, 0.485, 0.020),
)


def ndbc_table():
    centres, widths = [], []
    for first, last, width in NDBC_BANDS:
        count = round((last - first) / width) + 1
        centres += list(first + width * np.arange(count))
        widths += [width] * count
    return np.array(centres), np.array(widths)


def test_bandwidths_are_those_of_ndbc_table():
    centres, widths = ndbc_table()
    assert centres.size == 47
    edges = band_edges(centres)
    np.testing.assert_allclose(np.diff(edges)[:, 0], widths, rtol=1e-9)
    np.testing.assert_allclose(edges.mean(axis=1), centres, rtol=1e-9)


@given(st.lists(st.floats(0.001, 0.1), min_size=2, max_size=30))
def test_bands_hold_their_centre_and_never_overlap(steps):
    centres = np.cumsum(steps)
    edges = band_edges(centres)
    assert np.all(edges[:, 0] < centres)
    assert np.all(centres < edges[:, 1])
    assert np.all(edges[:, 0] >= 0)
    assert np.all(edges[1:, 0] >= edges[:-1, 1])


def test_moments_are_the_integrals_over_the_bands():
    spectrum = Spectrum(np.array([0.1, 0.2, 0.3]), np.array([1.0, 3.0, 0.5]))
    fine = np.linspace(0.05, 0.35, 300_001)
    fine = (fine[1:] + fine[:-1]) / 2
    step = 0.3 / 300_000
    density = np.select([fine < 0.15, fine < 0.25], [1.0, 3.0], 0.5)
    for order in (0, 1, 2, 4):
        expected = np.sum(fine**order * density) * step
        assert spectrum.moment(order) == pytest.approx(expected, rel=1e-7)
    assert spectrum.hs_m == pytest.approx(4 * math.sqrt(0.45))
    assert spectrum.tp_s == pytest.approx(5.0)


def test_flat_calm_has_no_period():
    calm = Spectrum(np.array([0.1, 0.2]), np.zeros(2))
    assert calm.hs_m == 0
    assert math.isnan(calm.tp_s)
    assert math.isnan(calm.tz_s)


@pytest.mark.parametrize(
    ("from_deg", "course_deg", "heading"),
    [
        (180.0, 0.0, 0.0),  # from the south on a northerly course: following
        (0.0, 0.0, math.pi),  # head sea
        (270.0, 0.0, math.pi / 2),  # from the west, port side, travelling to starboard
        (90.0, 0.0, -math.pi / 2),
        (45.0, 135.0, math.pi / 2),
    ],
)
def test_heading_is_the_direction_of_travel_relative_to_the_ship(from_deg, course_deg, heading):
    spectrum = Spectrum(np.array([0.1, 0.2]), np.ones(2), np.full(2, from_deg))
    np.testing.assert_allclose(spectrum.heading_rad(course_deg), heading, atol=1e-12)


def test_missing_direction_matters_only_where_there_is_energy():
    frequency = np.array([0.1, 0.2])
    direction = np.array([np.nan, 90.0])
    assert Spectrum(frequency, np.array([0.0, 1.0]), direction).heading_rad(0.0)[1] < 0
    with pytest.raises(ValueError, match=r"no direction at 0\.1 Hz"):
        Spectrum(frequency, np.ones(2), direction).heading_rad(0.0)
    with pytest.raises(ValueError, match="has no directions"):
        Spectrum(frequency, np.ones(2)).heading_rad(0.0)


@pytest.mark.parametrize(
    ("frequency", "density", "message"),
    [
        ([0.1], [1.0], "two or more"),
        ([0.1, 0.2], [1.0], "two or more"),
        ([0.2, 0.1], [1.0, 1.0], "increasing"),
        ([0.0, 0.1], [1.0, 1.0], "positive"),
        ([0.1, 0.2], [1.0, -1.0], "zero or more"),
        ([0.1, 0.2], [1.0, math.nan], "finite"),
    ],
)
def test_bad_spectra_are_refused(frequency, density, message):
    with pytest.raises(ValueError, match=message):
        Spectrum(np.array(frequency), np.array(density))
    with pytest.raises(ValueError, match="one value per frequency"):
        Spectrum(np.array([0.1, 0.2]), np.ones(2), np.ones(3))
