import dataclasses

import numpy as np
import pytest
from rolling_ship import SHIP, TANK

from utank_hil.control.optimal_tank import best_passive_tank, tank_figures
from utank_hil.dynamics import coupled_model
from utank_hil.dynamics.linear import coupled_matrices


def peak(tank):
    """Greatest roll per static roll K / k_phiphi, from the coupled model itself."""
    roll = np.abs(coupled_model(SHIP, tank)(1j * np.linspace(0.3, 0.8, 5001))[0, 1])
    return float(roll.max() * coupled_matrices(SHIP, tank)[2][0, 0])


def test_figures_are_those_of_the_coupled_model():
    figures = tank_figures(SHIP, TANK)
    assert figures.peak == pytest.approx(peak(TANK), rel=1e-3)
    assert figures.frequency_ratio == pytest.approx(1.179, abs=0.001)


@pytest.mark.slow
def test_no_neighbour_of_the_best_tank_has_a_lower_peak():
    best = best_passive_tank(SHIP, TANK)
    least = peak(best)
    assert least < 0.6 * tank_figures(SHIP, TANK).peak
    for key in ("duct_area_m2", "damping_ratio"):
        for factor in (0.9, 1.1):
            other = dataclasses.replace(best, **{key: factor * getattr(best, key)})
            assert peak(other) > least


def test_what_is_not_designed_stays():
    best = best_passive_tank(SHIP, TANK)
    kept = dataclasses.replace(
        best, duct_area_m2=TANK.duct_area_m2, damping_ratio=TANK.damping_ratio
    )
    assert kept == TANK


def test_a_ship_too_fast_for_her_reservoirs_is_refused():
    fast = dataclasses.replace(SHIP, stiffness_nm_rad=16 * SHIP.stiffness_nm_rad)
    with pytest.raises(ValueError, match="can't be as fast as the best"):
        best_passive_tank(fast, TANK)
