from dataclasses import replace

import numpy as np
import pytest
from integrated_roll import integrated_roll

from utank_hil.analysis.loop.sea_response import roll_without_tank
from utank_hil.dynamics.ship import RollShip
from utank_hil.sea import EffectiveSlope, Harmonics, Sea, jonswap

SHIP = RollShip(inertia_kg_m2=1.9275e9, stiffness_nm_rad=4.81875e8, damping_nms_rad=4.81875e7)


@pytest.mark.slow
@pytest.mark.parametrize(
    "moment",
    [
        Harmonics(np.array([2e7]), np.array([0.5]), np.array([0.7])),  # at resonance
        Harmonics(np.array([2e7, -3e7]), np.array([0.3, 1.4]), np.array([2.0, -0.3])),
        Harmonics(np.array([1e7]), np.array([0.0]), np.array([0.0])),  # a constant heel
        Sea.irregular(jonswap(4.7, 10.0), 5, components=64).roll_moment(
            SHIP.stiffness_nm_rad, EffectiveSlope(0.5)
        ),
    ],
)
def test_closed_form_equals_integration_of_the_equation_of_motion(moment):
    time_s = 0.05 * np.arange(4001)
    roll = roll_without_tank(SHIP, moment, 0.05, len(time_s))
    expected = integrated_roll(SHIP, moment, time_s)[0]
    assert np.abs(expected).max() > 0.01
    np.testing.assert_allclose(roll, expected, rtol=0, atol=1e-8 * np.abs(expected).max())
    assert abs(roll[0]) < 1e-15


def test_step_only_samples_the_answer():
    moment = Harmonics(np.array([2e7]), np.array([0.55]), np.array([0.1]))
    fine = roll_without_tank(SHIP, moment, 0.1, 1001)
    coarse = roll_without_tank(SHIP, moment, 1.0, 101)
    np.testing.assert_allclose(fine[::10], coarse, rtol=0, atol=1e-14)


def test_wind_heels_the_ship_to_where_her_stiffness_holds_it():
    calm = Harmonics(np.zeros(1), np.ones(1), np.zeros(1))
    roll = roll_without_tank(replace(SHIP, wind_moment_nm=2e7), calm, 1.0, 3000)
    assert roll[0] == 0
    assert roll.max() > 1.8 * 2e7 / 4.81875e8  # a gust overshoots
    assert roll[-1] == pytest.approx(2e7 / 4.81875e8, rel=1e-9)


def test_overdamped_ship_is_refused():
    heavy = RollShip(inertia_kg_m2=1e9, stiffness_nm_rad=2.5e8, damping_nms_rad=1.01e9)
    moment = Harmonics(np.array([2e7]), np.array([0.55]), np.array([0.1]))
    with pytest.raises(ValueError, match="overdamped"):
        roll_without_tank(heavy, moment, 0.1, 10)
