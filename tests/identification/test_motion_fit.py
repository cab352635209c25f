"""Ship and waves from the motion alone, against the simulated truth."""

import numpy as np
import pytest
from rolling_ship import PLANT, SAMPLE_TIME_S, SHIP, SUBSTEPS, loaded, motion_in, wave_moment_nm
from scipy.signal import welch

from utank_hil.identification.motion_fit import KNOWN_SPREAD, fit_motion
from utank_hil.sea import jonswap

SETTLED = 500
SEA = jonswap(3.0, 9.5)


def fitted(moment_nm, motion, **options):
    """The fit, and the root mean square of the true moment within its band, by Welch's method."""
    found = fit_motion(motion[SETTLED:], PLANT, SAMPLE_TIME_S, **options)  # type: ignore[arg-type]
    frequency, density = welch(
        moment_nm[SETTLED * SUBSTEPS :], SUBSTEPS / SAMPLE_TIME_S, nperseg=4096
    )
    low, high = found.waves.omega_rad_s[[0, -1]] / (2 * np.pi)
    inside = (frequency >= low) & (frequency <= high)
    return found, float(np.sqrt(density[inside].sum() * frequency[1]))


@pytest.mark.parametrize(("period_s", "inertia"), [(8.8, 1.0), (12.57, 1.1), (16.3, 1.0)])
def test_loading_and_waves_are_found_while_the_pump_works(period_s, inertia):
    ship = loaded(period_s, inertia)
    moment_nm = wave_moment_nm(SEA, 1300.0, seed=2)
    found, true_nm = fitted(moment_nm, motion_in(moment_nm, ship))
    assert found.ship.stiffness_nm_rad == pytest.approx(ship.stiffness_nm_rad, rel=0.05)
    assert found.ship.natural_frequency_rad_s == pytest.approx(
        ship.natural_frequency_rad_s, rel=0.03
    )
    assert found.deviation[0] < 0.02
    assert found.period_deviation < 0.02
    # stiffness and inertia err together, so that the period is known better than either
    assert found.period_deviation < 0.5 * np.hypot(*found.deviation[:2])
    assert found.waves.rms_rad * found.ship.stiffness_nm_rad == pytest.approx(true_nm, rel=0.1)
    assert found.clear > 0.9


@pytest.mark.evidence
def test_a_passive_tank_does_not_tell_ship_from_waves_and_says_so():
    moment_nm = wave_moment_nm(SEA, 1300.0, seed=2)
    found, _ = fitted(moment_nm, motion_in(moment_nm, most_pa=0.0))
    assert found.deviation[0] > 0.05


def test_waves_on_a_known_ship_with_a_passive_tank():
    moment_nm = wave_moment_nm(SEA, 1300.0, seed=2)
    found, true_nm = fitted(moment_nm, motion_in(moment_nm, most_pa=0.0), spread=KNOWN_SPREAD)
    assert found.waves.rms_rad * found.ship.stiffness_nm_rad == pytest.approx(true_nm, rel=0.1)
    assert found.waves.hs_m(0.5) == pytest.approx(3.0, rel=0.12)
    assert found.waves.omega_rad_s[np.argmax(found.waves.elevation_density(0.5))] == pytest.approx(
        2 * np.pi / 9.5, rel=0.1
    )


def test_two_wave_systems_are_two_peaks():
    moment_nm = wave_moment_nm(jonswap(2.0, 14.0), 1300.0, seed=3)
    moment_nm += wave_moment_nm(jonswap(2.0, 6.0), 1300.0, seed=4)
    found, _ = fitted(moment_nm, motion_in(moment_nm))
    omega, height = found.waves.omega_rad_s, found.waves.elevation_density(0.5)
    swell, between, wind = (
        height[(omega > low) & (omega < high)].max()
        for low, high in ((0.4, 0.5), (0.65, 0.8), (0.95, 1.15))
    )
    assert swell > 5 * between
    assert wind > 2 * between


def test_noise_alone_is_not_clear():
    rng = np.random.default_rng(1)
    noise = rng.standard_normal((6000, 3)) * [2e-4, 5e-4, 3.5e-3]
    assert fit_motion(noise, PLANT, SAMPLE_TIME_S, KNOWN_SPREAD).clear < 0.5


@pytest.mark.evidence
def test_noise_of_the_level_gauge_is_not_taken_for_waves():
    rng = np.random.default_rng(1)
    noise = rng.standard_normal((6000, 3)) * [2e-8, 5e-8, 3.5e-2]
    # through the water's weight it looks like a moment of 1e-4 rad; most of it is taken off
    assert fit_motion(noise, PLANT, SAMPLE_TIME_S, KNOWN_SPREAD).waves.rms_rad < 5e-5


def test_the_configured_ship_is_only_where_the_search_begins():
    moment_nm = wave_moment_nm(SEA, 1300.0, seed=5)
    motion = motion_in(moment_nm, loaded(10.0))
    found, _ = fitted(moment_nm, motion)
    assert found.ship.stiffness_nm_rad / SHIP.stiffness_nm_rad == pytest.approx(1.579, rel=0.05)
