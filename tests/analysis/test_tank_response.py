"""Roll of ship and tank in regular waves, and the sea that a law expects of a roll moment."""

import math

import numpy as np
import pytest

from utank_hil.analysis.loop.sea_response import CalmSeaError, at_work
from utank_hil.analysis.tank_response import expected_sea, roll_curves
from utank_hil.analysis.tank_sizing import TankRoom, size_tank
from utank_hil.configuration.ship_keys import WrittenShip
from utank_hil.control import DesignPlant, PumpLimits
from utank_hil.control.optimal_tank import roll_magnification, ship_ratios
from utank_hil.sea import EffectiveSlope, Harmonics, Sea, jonswap

SHIP = WrittenShip(displacement_t=1900, gm_m=0.9, roll_period_s=9.5, damping_ratio=0.05).ship()
TANK = size_tank(SHIP, TankRoom.in_hull(63, 9.5)).tank
PLANT = DesignPlant(SHIP, TANK, limits=PumpLimits(12e3, 24e3, 1.4))
WAVES = Sea.irregular(jonswap(1.5, 9.5), seed=1).roll_moment(
    SHIP.stiffness_nm_rad, EffectiveSlope(0.7)
)


def test_the_expected_sea_has_the_slope_of_the_waves():
    w = np.linspace(0.01, 4 * SHIP.natural_frequency_rad_s, 20_000)
    density = expected_sea(SHIP, WAVES).slope_density(w)
    kept = WAVES.frequency_rad_s < w[-1]
    variance = np.square(WAVES.amplitude[kept]).sum() / 2 / SHIP.stiffness_nm_rad**2
    assert np.trapezoid(density, w) == pytest.approx(variance, rel=0.02)
    assert w[density.argmax()] == pytest.approx(2 * math.pi / 9.5, rel=0.06)


def test_waves_too_short_to_roll_the_ship_are_refused():
    ripples = Harmonics(np.ones(1), np.full(1, 1.5), np.zeros(1))
    assert 2 < 1.5 / SHIP.natural_frequency_rad_s < 4
    with pytest.raises(CalmSeaError, match="does not roll the ship"):
        expected_sea(SHIP, ripples)


def test_curves_are_those_of_the_dimensionless_response():
    curves = roll_curves(PLANT, WAVES, None)
    tank = at_work(PLANT, WAVES).tank
    ratios, own_rad_s = ship_ratios(SHIP, tank)
    q = 2 * math.pi / curves.period_s / own_rad_s
    water = tank.natural_frequency_rad_s / own_rad_s
    found = np.abs(roll_magnification(q, water, tank.damping_ratio, ratios))
    assert curves.passive / found == pytest.approx(curves.passive[0] / found[0], rel=1e-6)
    assert curves.without_tank.max() == pytest.approx(1 / (2 * 0.05), rel=0.01)
    assert curves.active is None
    peak_s = curves.sea_period_s[curves.sea.argmax()]
    assert peak_s == pytest.approx(9.5, rel=0.06)
