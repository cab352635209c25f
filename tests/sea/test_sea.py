import math
import re
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import stats

from utank_hil.sea import EffectiveSlope, Sea, Spectrum, jonswap, load_ndbc

SEAS = Path(__file__).parents[2] / "configs" / "seas"
STORM = load_ndbc(
    SEAS / "ndbc_41010_2019-02_spectral_density.txt", SEAS / "ndbc_41010_2019-02_mean_direction.txt"
).at("2019-02-10T05:40")
G = 9.80665


@pytest.mark.parametrize("spectrum", [STORM, jonswap(3.0, 8.0, 5.0)])
@pytest.mark.parametrize("components", [1, 16, 512, 2000])
def test_every_sea_has_the_variance_of_the_spectrum(spectrum, components):
    sea = Sea.irregular(spectrum, seed=3, components=components)
    assert sea.elevation.variance == pytest.approx(spectrum.moment(0), rel=1e-12)


@pytest.mark.parametrize("spectrum", [STORM, jonswap(3.0, 8.0, 5.0)])
def test_mean_over_seeds_is_the_spectrum_band_by_band(spectrum):
    edges = spectrum.band_edges_hz
    energy = np.zeros(spectrum.density.size)
    seeds = 400
    for seed in range(seeds):
        sea = Sea.irregular(spectrum, seed, components=40)  # few, so that most bins straddle bands
        band = np.searchsorted(edges[:, 1], sea.omega_rad_s / (2 * np.pi))
        np.add.at(energy, band, sea.amplitude_m**2 / 2)
    target = spectrum.density * np.diff(edges)[:, 0]
    # at worst one component in the band or not: binomial with share p of the largest component
    largest = 4 * spectrum.moment(0) / 40
    allowed = 5 * np.sqrt(target * largest / seeds) + 1e-6
    assert np.all(np.abs(energy / seeds - target) < allowed)
    # and so are the moments that slope and its rate live on, to sampling accuracy
    assert energy.sum() / seeds == pytest.approx(spectrum.moment(0), rel=1e-9)


def test_measured_variance_and_periodogram_of_a_series_are_those_of_the_spectrum():
    step, count, seeds = 0.5, 1 << 13, 20
    taper = np.hanning(count)
    power = np.zeros(count // 2 + 1)
    variance = 0.0
    for seed in range(seeds):
        series = Sea.irregular(STORM, seed).elevation.series(step, count)
        variance += series.var() / seeds
        power += np.abs(np.fft.rfft(series * taper)) ** 2 / seeds
    density = 2 * power * step / np.sum(taper**2)
    frequency = np.fft.rfftfreq(count, step)
    assert variance == pytest.approx(STORM.moment(0), rel=0.06)
    for low, high in ((0.06, 0.08), (0.08, 0.09), (0.09, 0.105), (0.105, 0.155), (0.155, 0.355)):
        ours = density[(frequency >= low) & (frequency < high)].sum() * frequency[1]
        overlap = np.clip(np.minimum(STORM.band_edges_hz[:, 1], high), low, None) - np.clip(
            STORM.band_edges_hz[:, 0], low, high
        )
        assert ours == pytest.approx(STORM.density @ np.maximum(overlap, 0), rel=0.12)


def test_elevation_is_gaussian():
    # far apart, so that the samples are nearly independent
    samples = np.concatenate(
        [Sea.irregular(STORM, seed).elevation.series(61.7, 60) for seed in range(100)]
    )
    scale = math.sqrt(STORM.moment(0))
    assert stats.kstest(samples / scale, "norm").pvalue > 0.01
    assert stats.kurtosis(samples) == pytest.approx(0.0, abs=5 * math.sqrt(24 / samples.size))


def test_nothing_repeats_within_an_hour():
    series = Sea.irregular(STORM, seed=1).elevation.series(0.5, 7200)
    spectrum = np.fft.rfft(series, 2 * series.size)
    overlap = np.arange(series.size, 0, -1)
    correlation = np.fft.irfft(np.abs(spectrum) ** 2)[: series.size] / overlap / series.var()
    assert correlation[0] == pytest.approx(1.0, rel=0.01)
    # after five minutes, as far as half the hour; an evenly spaced sum of 512 comes back to 1
    assert np.max(np.abs(correlation[600:3600])) < 0.35


def test_even_spacing_would_fail_the_test_above():
    frequency = 0.0006 * np.arange(84, 484)  # repeats after 1667 s
    times = np.arange(7200) * 0.5
    series = np.cos(2 * np.pi * np.multiply.outer(times, frequency) + np.arange(400) ** 2).sum(1)
    lag = round(1 / 0.0006 / 0.5)
    assert np.corrcoef(series[:-lag], series[lag:])[0, 1] > 0.9


def test_a_seed_is_the_same_sea_in_every_numpy():
    first = Sea.irregular(STORM, seed=1)
    again = Sea.irregular(STORM, seed=1)
    other = Sea.irregular(STORM, seed=2)
    np.testing.assert_array_equal(first.phase_rad, again.phase_rad)
    np.testing.assert_array_equal(first.omega_rad_s, again.omega_rad_s)
    assert not np.any(first.phase_rad == other.phase_rad)
    # golden: PCG64's raw stream is part of numpy's compatibility promise
    raw = Sea.irregular(STORM, seed=1, components=2)
    np.testing.assert_allclose(raw.phase_rad / (2 * np.pi), GOLDEN_PHASES, rtol=1e-12)


# third and fourth double of numpy.random.Generator(PCG64(1)).random()
GOLDEN_PHASES = [0.14415961271963373, 0.9486494471372439]


def test_slope_is_the_gradient_of_the_surface_towards_starboard():
    """Elevation at two points a little apart across the ship, from the components."""
    sea = Sea.irregular(STORM, 5, heading_rad=STORM.heading_rad(70.0), spreading=10, speed_m_s=6.0)
    t, dy = 12.3, 1e-4

    def surface(y):
        k = sea.omega_rad_s**2 / G
        encounter = sea.omega_rad_s - k * 6.0 * np.cos(sea.heading_rad)
        angle = encounter * t - k * np.sin(sea.heading_rad) * y + sea.phase_rad
        return float(sea.amplitude_m @ np.cos(angle))

    gradient = (surface(dy) - surface(-dy)) / (2 * dy)
    assert sea.elevation.at(t) == pytest.approx(surface(0.0), rel=1e-9)
    # starboard side of the surface up is a negative roll
    assert sea.slope.at(t) == pytest.approx(-gradient, rel=1e-6)


def test_ship_that_takes_no_notice_of_time_lies_along_the_slope():
    sea = Sea.irregular(STORM, seed=2)
    stiffness = 4.8e8
    moment = sea.roll_moment(stiffness, EffectiveSlope(0.5))
    times = np.linspace(0, 100, 50)
    np.testing.assert_allclose(moment.at(times) / stiffness, 0.5 * sea.slope.at(times), atol=1e-12)


def test_regular_wave_moment_has_the_closed_form_amplitude_and_lead():
    sea = Sea.regular(2.0, 0.6, heading_rad=math.pi / 3)
    moment = sea.roll_moment(1e8, EffectiveSlope(0.7))
    k = 0.36 / G
    assert moment.amplitude[0] == pytest.approx(1e8 * 0.7 * k * 2.0 * math.sin(math.pi / 3))
    assert moment.at(0.0) == pytest.approx(0.0, abs=1e-6)
    # crest at t = 0 travelling to starboard: a quarter period before, she leaned to starboard
    assert moment.at(-math.pi / 2 / 0.6) > 0


def test_waves_from_the_other_side_roll_the_other_way_and_head_seas_not_at_all():
    port = Sea.regular(1.0, 0.7, heading_rad=math.pi / 2).slope
    starboard = Sea.regular(1.0, 0.7, heading_rad=-math.pi / 2).slope
    times = np.linspace(0, 20, 30)
    np.testing.assert_allclose(port.at(times), -starboard.at(times), atol=1e-15)
    assert np.max(np.abs(Sea.regular(1.0, 0.7, heading_rad=math.pi).slope.at(times))) < 1e-15


def test_overtaken_waves_keep_their_shape_in_time():
    sea = Sea.regular(1.0, 1.2, heading_rad=0.2, speed_m_s=20.0, phase_rad=0.4)
    encounter = float(sea.encounter_rad_s[0])
    assert encounter < 0
    times = np.linspace(0, 30, 40)
    assert sea.elevation.frequency_rad_s[0] == -encounter
    np.testing.assert_allclose(sea.elevation.at(times), np.cos(encounter * times + 0.4), atol=1e-12)
    expected = 1.44 / G * math.sin(0.2) * np.cos(encounter * times + 0.4 + math.pi / 2)
    np.testing.assert_allclose(sea.slope.at(times), expected, atol=1e-12)


@pytest.mark.parametrize("exponent", [0.0, 1.0, 10.0, 75.0])
def test_spreading_has_the_circular_moments_of_cosine_2s(exponent):
    sea = Sea.irregular(STORM, 1, components=4000, heading_rad=1.0, spreading=exponent)
    offset = sea.heading_rad - 1.0
    # Longuet-Higgins: E cos(theta) = s / (s + 1), E cos(2 theta) = s (s - 1) / ((s + 1)(s + 2))
    first = exponent / (exponent + 1)
    second = exponent * (exponent - 1) / ((exponent + 1) * (exponent + 2))
    assert np.cos(offset).mean() == pytest.approx(first, abs=2e-3)
    assert np.cos(2 * offset).mean() == pytest.approx(second, abs=2e-3)
    assert np.sin(offset).mean() == pytest.approx(0.0, abs=2e-3)
    assert abs(np.corrcoef(offset, sea.omega_rad_s)[0, 1]) < 0.1


def test_measured_directions_set_the_heading_band_by_band():
    sea = Sea.irregular(STORM, 1, heading_rad=STORM.heading_rad(0.0))
    edges = STORM.band_edges_hz
    for omega, heading in zip(sea.omega_rad_s, sea.heading_rad, strict=True):
        band = np.flatnonzero(
            (edges[:, 0] * 2 * np.pi <= omega) & (omega <= edges[:, 1] * 2 * np.pi)
        )
        assert heading in STORM.heading_rad(0.0)[band]


def test_band_without_energy_between_two_with_it_gets_no_components():
    gap = Spectrum(np.array([0.05, 0.10, 0.15, 0.20]), np.array([0.0, 2.0, 0.0, 1.0]))
    frequency = Sea.irregular(gap, 1, components=300).omega_rad_s / (2 * np.pi)
    inside = ((frequency > 0.075) & (frequency < 0.125)) | (frequency > 0.175)
    assert np.all(inside)


@given(
    st.floats(0.0, 1.0), st.floats(0.0, 10.0), st.floats(0.0, 40.0), st.floats(-math.pi, math.pi)
)
def test_effective_slope_never_exceeds_its_long_wave_limit(coefficient, depth, beam, heading):
    slope = EffectiveSlope(coefficient, depth, beam)
    k = np.geomspace(1e-9, 1.0, 50)
    factor = slope.factor(k, np.full(50, heading))
    assert np.all(np.abs(factor) <= coefficient * (1 + 1e-12))
    assert factor[0] == pytest.approx(coefficient, rel=1e-6)


def test_beam_filter_is_the_height_difference_between_the_sides():
    k, heading, beam = 0.05, 0.9, 18.0
    factor = EffectiveSlope(1.0, beam_m=beam).factor(np.array([k]), np.array([heading]))
    across = k * math.sin(heading)
    # zeta = cos(-across y + pi/2) = sin(across y): steepest at the centre line
    rise = (math.sin(across * beam / 2) - math.sin(-across * beam / 2)) / beam
    assert factor[0] == pytest.approx(rise / across, rel=1e-12)


def test_depth_filter_is_the_decay_of_wave_motion_in_deep_water():
    factor = EffectiveSlope(1.0, depth_m=4.0).factor(np.array([0.05]), np.array([math.pi / 2]))
    assert factor[0] == pytest.approx(math.exp(-0.2))


@pytest.mark.parametrize("bad", [-0.1, math.nan, math.inf])
def test_bad_effective_slopes_are_refused_by_name(bad):
    for name in ("coefficient", "depth_m", "beam_m"):
        with pytest.raises(ValueError, match=name):
            EffectiveSlope(**{name: bad})


def test_bad_seas_are_refused():
    with pytest.raises(ValueError, match="no energy"):
        Sea.irregular(Spectrum(np.array([0.1, 0.2]), np.zeros(2)), 1)
    with pytest.raises(ValueError, match="one component or more"):
        Sea.irregular(STORM, 1, components=0)
    with pytest.raises(ValueError, match="spreading"):
        Sea.irregular(STORM, 1, spreading=-1.0)
    with pytest.raises(ValueError, match="non-negative"):
        Sea.irregular(STORM, -1)
    with pytest.raises(ValueError, match="omega_rad_s"):
        Sea.regular(1.0, 0.0)


def test_an_hour_of_one_seed_scatters_as_the_document_says():
    """Relative deviation of an hour's Hs over seeds, and what Gaussian theory gives.

    Theory: the variance of the variance of T seconds is the integral of S^2 over T. Of components
    with random phases it is the sum over pairs of the energies times sinc^2 of half the phase
    between.
    """
    hour_s = 3600.0
    page = (Path(__file__).parents[2] / "docs" / "sea.md").read_text(encoding="utf-8")
    words = " ".join(page.split())
    pattern = r"deviation of ([\d.]+) % over the seeds, where Gaussian theory gives ([\d.]+)"
    written = re.search(pattern, words)
    assert written is not None

    width = np.diff(STORM.band_edges_hz, axis=1)[:, 0]
    theory = math.sqrt(width @ STORM.density**2 / hour_s) / (width @ STORM.density) / 2
    sea = Sea.irregular(STORM, seed=1)
    energy, turns = sea.amplitude_m**2 / 2, sea.omega_rad_s * hour_s / (2 * np.pi)
    pairs = np.outer(energy, energy) * np.sinc(np.subtract.outer(turns, turns)) ** 2
    found = math.sqrt(pairs.sum() - np.trace(pairs)) / energy.sum() / 2
    assert [100 * found, 100 * theory] == pytest.approx(
        list(map(float, written.groups())), rel=0.02
    )
