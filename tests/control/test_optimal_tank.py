"""The best passive tank: closed form against the coupled model, and that it is the best."""

import numpy as np
import pytest

from utank_hil.control.optimal_tank import (
    ShipTankRatios,
    passive_optimum,
    roll_magnification,
    ship_ratios,
)
from utank_hil.dynamics import RollShip, Tank, coupled_model
from utank_hil.dynamics.linear import coupled_matrices

SHIP = RollShip(1.9275e9, 1.9275e9 * 0.25, 4.87e7)
TANK = Tank(17.1, 4.88, 17.11, 6.22, lz_m=1.83, damping_ratio=0.10)
WAVES = np.geomspace(0.1, 4, 40_000)  # misses a peak by less than 1e-6 of it


def test_magnification_is_that_of_the_coupled_model():
    ratios, frequency = ship_ratios(SHIP, TANK)
    f = TANK.natural_frequency_rad_s / frequency
    q = np.array([0.0, 0.3, 0.8, 1.0, 1.3, 2.0])
    static_roll = 1 / coupled_matrices(SHIP, TANK)[2][0, 0]
    expected = coupled_model(SHIP, TANK)(1j * q * frequency)[0, 1] / static_roll
    np.testing.assert_allclose(roll_magnification(q, f, 0.10, ratios), expected, rtol=1e-9)


@pytest.mark.parametrize("mass_ratio", [0.02, 0.05, 0.1])
@pytest.mark.parametrize("roll_damping_ratio", [0.0, 0.05])
@pytest.mark.parametrize("static_coupling", [None, 1.4])
def test_optimum_has_no_better_neighbour_and_two_equal_peaks(
    mass_ratio, roll_damping_ratio, static_coupling
):
    ratios = ShipTankRatios(mass_ratio, 0.25, roll_damping_ratio, static_coupling)
    found = passive_optimum(ratios)

    def response(f, xi):
        return np.abs(roll_magnification(WAVES, f, xi, ratios))

    best = response(found.frequency_ratio, found.damping_ratio)
    assert best.max() == pytest.approx(found.peak, rel=1e-4)
    for f_factor in (0.99, 1.0, 1.01):
        for xi_factor in (0.9, 1.0, 1.1):
            near = response(found.frequency_ratio * f_factor, found.damping_ratio * xi_factor)
            assert near.max() >= found.peak * (1 - 1e-6)
    peaks = best[1:-1][(best[1:-1] > best[:-2]) & (best[1:-1] > best[2:])]
    assert len(peaks) == 2
    assert peaks[0] == pytest.approx(peaks[1], rel=1e-3)


def test_trends_of_the_thesis():
    # frequency ratio close to one; more mass: more damping, less roll
    found = [passive_optimum(ShipTankRatios(mu, 0.25, 0.025)) for mu in (0.02, 0.05, 0.1)]
    assert all(0.9 < one.frequency_ratio < 1.1 for one in found)
    damping = [one.damping_ratio for one in found]
    assert damping == sorted(damping)
    peaks = [one.peak for one in found]
    assert peaks == sorted(peaks, reverse=True)


@pytest.mark.parametrize(
    ("bad", "name"),
    [
        ((0.0, 0.2, 0.0), "mass_ratio"),
        ((1.2, 0.2, 0.0), "mass_ratio"),
        ((0.05, np.nan), "coupling_ratio"),
        ((0.05, 1, -1), "roll_damping_ratio"),
        ((0.05, 1, np.inf), "roll_damping_ratio"),
        ((0.05, 1, 0.0, np.nan), "static_coupling"),
        ((0.05, 1, 0.0, -np.inf), "static_coupling"),
    ],
)
def test_ratios_out_of_range_are_refused_by_name(bad, name):
    with pytest.raises(ValueError, match=f"{name} must"):
        ShipTankRatios(*bad)
