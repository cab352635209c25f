"""Waves of a record: against an independent integration of ship and tank."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from utank_hil.analysis.motion.wave_slope import beam_sea, wave_slope
from utank_hil.dynamics import RollModel, RollShip, Tank

STEP_S = 0.1
TANK = Tank(17.1, 4.88, 17.11, 6.22, lz_m=1.83, damping_ratio=0.1)
INSIDE = slice(400, -400)  # The ends are tapered, and the reflection is only continuous.
OMEGA, SLOPE_RAD, PHASE = np.array(
    [[0.41, 0.55, 0.83, 1.27, 2.1], [0.4, 0.6, 1.2, 0.8, 0.5], range(5)]
)


def slope_at(time_s):
    return np.radians(SLOPE_RAD) @ np.cos(np.multiply.outer(OMEGA, time_s).T + PHASE).T


def sailed(pump_pa, **keys):
    """Roll and level of a ship in known waves, by scipy's integration at a tolerance of 1e-9."""
    ship = RollShip(1.9275e9, 4.81875e8, 4.81875e7, quadratic_damping_nms2_rad2=2e8, **keys)
    model = RollModel(ship, TANK)

    def rate(time_s, state):
        slope = slope_at(time_s)
        return model.derivative(
            state,
            pump_pa * np.sin(0.6 * time_s),
            ship.stiffness_nm_rad * slope,
            sway_m_s2=9.80665 * slope * (ship.sway_of_slope or 0.0),
        )

    time_s = STEP_S * np.arange(4000)
    found = solve_ivp(
        rate, (0, time_s[-1]), np.zeros(4), t_eval=time_s, rtol=1e-9, atol=1e-11, method="DOP853"
    )
    assert abs(found.y[2]).max() < TANK.level_limit_m  # No impact, whose roll rate is a step.
    return model, time_s, found.y[0], found.y[2]


@pytest.mark.parametrize(
    ("pump_pa", "keys"),
    [(0.0, {}), (8e3, {}), (8e3, {"sway_of_slope": 0.8}), (0.0, {"wind_moment_nm": 2e7})],
)
def test_the_slope_is_found_whatever_the_pump_does(pump_pa, keys):
    model, time_s, roll_rad, level_m = sailed(pump_pa, **keys)
    slope_rad, heeling_nm = wave_slope(roll_rad, level_m, STEP_S, model)
    error = slope_rad - slope_at(time_s)
    assert np.std(error[INSIDE]) < 1e-3 * np.std(slope_at(time_s))
    assert abs(heeling_nm) < 0.01 * np.std(slope_at(time_s)) * model.ship.stiffness_nm_rad


def test_a_wind_that_the_file_does_not_know_is_the_heeling_moment():
    _, _, roll_rad, level_m = sailed(0.0, wind_moment_nm=2e7)
    known, *_ = sailed(0.0)
    slope_rad, heeling_nm = wave_slope(roll_rad, level_m, STEP_S, known)
    assert heeling_nm == pytest.approx(2e7, rel=0.02)
    assert abs(slope_rad.mean()) < 1e-12


@pytest.mark.parametrize("coefficient", [1.0, 0.5])
def test_components_make_the_slope_again(coefficient):
    time_s = STEP_S * np.arange(6000)
    sea = beam_sea(slope_at(time_s), STEP_S, coefficient)
    again = coefficient * sea.slope.series(STEP_S, len(time_s))
    assert np.std((again - slope_at(time_s))[INSIDE]) < 0.005 * np.std(again)
    assert abs(again[[0, -1]]).max() < 0.005  # It begins and ends calm.


def test_calm_water_has_no_components():
    assert len(beam_sea(np.zeros(2000), STEP_S).omega_rad_s) == 0
