"""The thresholds of a tank of round numbers."""

import math
from dataclasses import astuple, replace

import pytest
from moving_ship import CONFIG

from utank_hil.safety.monitors.thresholds import SensorFigures, thresholds_of

W0 = 0.6
G = 9.80665
# 2H + L At / Ap = 2 g / w0^2
TANK = replace(
    CONFIG.vessel.tank,
    width_m=20.0,
    height_m=5.0,
    reservoir_area_m2=30.0,
    duct_area_m2=20.0 * 30.0 / (2 * G / W0**2 - 2 * 5.0),
    density_kg_m3=1025.0,
    headroom_m=4.0,
)
SHIP = replace(CONFIG.plant.ship, stiffness_nm_rad=1e9)
LIMITS = replace(CONFIG.plant.limits, pressure_pa=40e3)
PLANT = replace(CONFIG.plant, ship=SHIP, tank=TANK, limits=LIMITS)


def test_every_threshold_is_what_the_documents_say_of_ship_and_sensors():
    found = thresholds_of(PLANT, 0.35, SensorFigures(1e-4, 4e-4, 0.003))
    expected = {
        "tank_period_s": 2 * math.pi / 0.6,
        # nothing moves faster than a roll of 0.35 at twice w0, or the level at its limit
        "roll_spike_rad": 3e-3,
        "roll_most_rad_s": 0.42,
        "rate_spike_rad_s": 0.012,
        "rate_most_rad_s2": 0.504,
        "level_spike_m": 0.03,
        "level_most_m_s": 4.8,
        # five times the noise; of the sum of two levels 3.75
        "roll_noise_rad": 5e-4,
        "rate_noise_rad_s": 2e-3,
        "level_noise_m": 0.01125,
        # six times that of the roll and of 15 s of its rate, of which half is remembered
        "drift_rad": 6 * math.sqrt(1e-8 + 16e-8 * 0.075),
        "roll_still_rad": 5e-4,
        "level_still_m": 0.009,
        "volume_m": 0.15,
        "least_roll_push_m2_s2": math.radians(0.2) * 0.6 * G * 20.0,
        "least_pump_push_m2_s2": 4e3 / 1025.0,
        "gauge_push_m2_s2": 2 * G * 0.003 / math.sqrt(2),
        "zero_push_m2_s2": G * 20.0 * math.radians(0.3),
        "steady_push_m2_s2": 20.0 * (G * math.radians(0.3) + 0.05 * G),
        "motion_late_s": 1 / 3,
        "pressure_error_pa": 6e3,
        "free_rotor_pa_m": 0.2 * 1025.0 * G,
        "pressure_limit_pa": 40e3,
        "unconfirmed_share": 0.25,
        "degraded_share": 0.5,
        "amplified_roll_rad": math.radians(0.5),
        "of_hull": False,
    }
    assert {name: getattr(found, name) for name in found.__slots__} == pytest.approx(expected)


def test_coarse_gauges_and_a_low_roof_move_the_thresholds_that_hang_on_them():
    coarse = thresholds_of(PLANT, 0.35, SensorFigures(level_noise_m=0.04))
    assert coarse.volume_m == pytest.approx(0.24)
    low = replace(PLANT, tank=replace(TANK, headroom_m=1.0))
    assert thresholds_of(low, 0.35, SensorFigures()).level_most_m_s == pytest.approx(1.2)
    for of_hull in (True, False):
        assert thresholds_of(low, 0.35, SensorFigures(), of_hull=of_hull).of_hull is of_hull


@pytest.mark.parametrize(("share", "pressure_pa"), [(0.2501, 20e3), (0.25, 80e3), (0.1, 200e3)])
def test_a_pump_that_is_strong_for_her_size_has_less_than_a_quarter_until_the_water_obeyed(
    share, pressure_pa
):
    """Steady heel: K phi = rho g At L h, and 2 g h = P / rho + g L phi."""
    push_nm = TANK.reservoir_area_m2 * TANK.width_m * pressure_pa
    free_surface = TANK.density_kg_m3 * G * TANK.reservoir_area_m2 * TANK.width_m**2
    stiffness = 0.5 * (free_surface + share * push_nm / math.radians(0.25))
    plant = replace(
        PLANT,
        ship=replace(PLANT.ship, stiffness_nm_rad=stiffness),
        limits=replace(PLANT.limits, pressure_pa=pressure_pa),
    )
    found = thresholds_of(plant, 0.35, SensorFigures()).unconfirmed_share
    assert found == pytest.approx(min(share, 0.25), rel=3e-3)


def test_degraded_is_half_of_what_takes_her_to_her_roll_limit():
    """A ship that stands 0.1 rad at 24 kPa by linear theory, K phi = rho g At L h, of 40 kPa."""
    push_nm = TANK.reservoir_area_m2 * TANK.width_m * 24e3
    free_surface = TANK.density_kg_m3 * G * TANK.reservoir_area_m2 * TANK.width_m**2
    soft = replace(PLANT.ship, stiffness_nm_rad=0.5 * (free_surface + push_nm / 0.1))
    found = thresholds_of(replace(PLANT, ship=soft), 0.1, SensorFigures()).degraded_share
    assert found == pytest.approx(0.3, rel=0.05)
    assert thresholds_of(replace(PLANT, ship=soft), 0.5, SensorFigures()).degraded_share == 0.5


def test_sensors_are_as_their_makers_say_within_their_ranges():
    assert astuple(SensorFigures()) == (2e-4, 5e-4, 0.005)
    assert astuple(SensorFigures(2e-3, 1e-2, 0.05)) == (2e-3, 1e-2, 0.05)
    least = (1e-6, 1e-6, 1e-4)
    assert astuple(SensorFigures(*least)) == least
    below = ((9e-7, 5e-4, 5e-3), (2e-4, 9e-7, 5e-3), (2e-4, 5e-4, 9e-5))
    for figures in (*below, (2.1e-3, 5e-4, 5e-3), (2e-4, 1.05e-2, 5e-3), (2e-4, 5e-4, 0.051)):
        with pytest.raises(ValueError, match="must be"):
            SensorFigures(*figures)
    for index in range(3):
        with pytest.raises(ValueError, match=r"^sensors .* must be"):
            SensorFigures(*(0.0 if k == index else 1e-3 for k in range(3)))
