"""Spectra from scattered estimates: against integration, and against the truth."""

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.signal import welch
from scipy.stats import norm

from utank_hil.identification import smooth_spectrum
from utank_hil.identification.smooth_spectrum import SmoothSpectrum, bandwidth_rad_s, coefficients


def test_coefficients_are_a_one_sided_density():
    white = np.random.default_rng(1).standard_normal((20_000, 1)) * 3.0
    omega = np.arange(0.5, 15, bandwidth_rad_s(len(white), 0.2, 5))
    density = np.mean(np.abs(coefficients(white, 0.2, omega, 5)[0]) ** 2)
    frequency, expected = welch(white[:, 0], 5.0, nperseg=1024)
    assert density == pytest.approx(9.0 / (np.pi / 0.2), rel=0.03)
    assert density == pytest.approx(np.mean(expected[frequency > 0.1]) / (2 * np.pi), rel=0.03)


def test_a_straight_line_is_no_spectrum():
    line = np.column_stack([3.0 + 1e-3 * np.arange(6000.0)])
    assert np.abs(coefficients(line, 0.2, np.array([0.02, 0.5]), 4)).max() < 1e-9


def test_likelihood_of_one_estimate_is_its_integral(monkeypatch):
    # one frequency: the prior is a normal distribution of the logarithm
    monkeypatch.setattr(smooth_spectrum, "_LEVEL_SPREAD", 0.5)
    spread = np.hypot(2.0, 0.5)

    def likelihood(estimate, noise):
        def integrand(log_density):
            total = np.exp(log_density) + noise
            prior = norm.pdf(log_density, np.log(0.1 * estimate), spread)
            return float(total**-40 * np.exp(-40 * estimate / total) * prior)

        return float(np.log(quad(integrand, -8, 8, points=[np.log(estimate)])[0]))

    def found(estimate, noise):
        spectrum = SmoothSpectrum(np.array([1.0]), 40)
        return spectrum.find(np.array([estimate]), np.array([noise])).log_likelihood

    # the constant of Laplace's approximation cancels in a difference
    for estimate, noise in ((2.0, 0.1), (0.7, 0.1), (2.0, 0.5)):
        assert found(estimate, noise) - found(1.0, 0.1) == pytest.approx(
            likelihood(estimate, noise) - likelihood(1.0, 0.1), abs=0.02
        )


def test_spectrum_and_its_deviation_hold_the_truth():
    omega = np.linspace(0.2, 2.0, 120)
    truth = np.exp(-(((omega - 0.6) / 0.15) ** 2)) + 0.2 / (1 + (omega / 1.2) ** 6)
    noise = np.full_like(omega, 0.02)
    errors = []
    for seed in range(20):
        scatter = np.random.default_rng(seed).gamma(4, 1 / 4, omega.shape)
        spectrum = SmoothSpectrum(omega, 4)
        off = spectrum.find((truth + noise) * scatter, noise).mean - np.log(truth)
        clear = truth > noise
        errors.append((off / np.sqrt(spectrum.covariance().diagonal()))[clear])
    assert np.sqrt(np.mean(np.square(errors))) == pytest.approx(1.0, abs=0.2)
    assert abs(np.mean(errors)) < 0.3
