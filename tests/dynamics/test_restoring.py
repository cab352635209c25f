import math
from dataclasses import replace

import numpy as np
import pytest
from roll_energy import LEVERS, PATTI, THESIS_SHIP, ship_potential

from utank_hil.dynamics import RollShip
from utank_hil.dynamics.ship import restoring


def test_odd_polynomial_is_evaluated_as_written():
    ship = RollShip(1.0, 2.0, restoring_odd_nm=(-3.0, 0.5))
    roll = np.linspace(-2, 2, 41)
    np.testing.assert_allclose(
        restoring(ship).moment_nm(roll), 2 * roll - 3 * roll**3 + 0.5 * roll**5, atol=1e-14
    )


def test_levers_are_met_and_the_slope_at_zero_is_the_stiffness():
    table = restoring(LEVERS)
    heel = LEVERS.gz_step_rad * np.arange(len(LEVERS.gz_m))
    np.testing.assert_allclose(table.moment_nm(heel), 5e7 * np.array(LEVERS.gz_m), atol=1e-6)
    np.testing.assert_allclose(table.moment_nm(-heel), -5e7 * np.array(LEVERS.gz_m), atol=1e-6)
    assert table.moment_nm(1e-6) / 1e-6 == pytest.approx(LEVERS.stiffness_nm_rad, rel=1e-5)


@pytest.mark.parametrize("ship", [LEVERS, PATTI, THESIS_SHIP])
def test_energy_is_the_work_of_the_moment(ship):
    roll, step = np.linspace(-1.5, 1.5, 61), 1e-5
    slope = (ship_potential(ship, roll + step) - ship_potential(ship, roll - step)) / (2 * step)
    np.testing.assert_allclose(slope, restoring(ship).moment_nm(roll), rtol=1e-4, atol=1.0)


def test_levers_of_a_ship_with_other_figures_scale_with_its_stiffness():
    stiffer = LEVERS.with_figures(LEVERS.inertia_kg_m2, 1.2 * LEVERS.stiffness_nm_rad, 0.0)
    roll = np.linspace(-1.5, 1.5, 61)
    np.testing.assert_allclose(
        restoring(stiffer).moment_nm(roll), 1.2 * restoring(LEVERS).moment_nm(roll), atol=1e-6
    )


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"restoring_odd_nm": (1.0,)}, "exclude each other"),
        ({"gz_m": (0.1, 0.2, 0.3, 0.4)}, "first of them 0"),
        ({"gz_m": (0.0, 0.2, 0.3)}, "at least 4"),
        ({"gz_step_rad": 0.0}, "gz_step_rad must be positive"),
        ({"displacement_n": math.inf}, "displacement_n must be positive"),
        ({"gz_m": (0.0, 0.2, math.nan, 0.1)}, "finite"),
        ({"wind_moment_nm": math.inf}, "wind_moment_nm"),
        ({"damping_nms_rad": -1.0}, "damping_nms_rad"),
    ],
)
def test_bad_ships_are_refused_by_name(change, message):
    with pytest.raises(ValueError, match=message):
        replace(LEVERS, **change)
