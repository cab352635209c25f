import numpy as np
import pytest

from utank_hil.analysis.motion.statistics import exceedance


def test_half_the_amplitudes_of_two_alternating_waves_are_above_the_smaller():
    time = np.arange(0, 400, 0.01)
    wave = np.where((time // (2 * np.pi)) % 2 == 0, 1.0, 2.0) * np.sin(time)
    np.testing.assert_allclose(exceedance(wave, np.array([0.5, 1.5, 2.5])), [1, 0.5, 0], atol=0.01)


@pytest.mark.slow
def test_a_narrow_banded_gaussian_motion_is_rayleigh():
    rng = np.random.default_rng(3)
    time = np.arange(0, 40_000, 0.5)
    frequency = 0.5 + 0.02 * rng.standard_normal(200)
    phase = rng.uniform(0, 2 * np.pi, 200)
    roll = np.cos(np.outer(time, frequency) + phase).sum(axis=1) / 10  # variance one
    levels = np.array([0.5, 1.0, 1.5, 2.0])
    np.testing.assert_allclose(
        exceedance(roll, levels), np.exp(-((levels / roll.std()) ** 2) / 2), atol=0.02
    )


def test_a_list_does_not_count():
    roll = np.sin(np.arange(0, 100, 0.1))
    levels = np.array([0.3, 0.9])
    np.testing.assert_allclose(exceedance(roll + 5, levels), exceedance(roll, levels))


def test_record_without_a_half_cycle_is_refused():
    with pytest.raises(ValueError, match="no whole half-cycle"):
        exceedance(np.linspace(0, 1, 50), np.array([0.1]))
