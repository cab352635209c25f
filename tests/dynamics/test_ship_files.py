"""The ships in configs/ships say what their sources say."""

import math
from pathlib import Path

import pytest

from utank_hil.configuration import Vessel, load_config
from utank_hil.dynamics import RollModel
from utank_hil.dynamics.ship import restoring

SHIPS = Path(__file__).parents[2] / "configs" / "ships"


def vessel(name):
    return load_config(SHIPS / f"{name}.yaml", Vessel)


@pytest.mark.parametrize("file", sorted(SHIPS.glob("*.yaml")), ids=lambda file: file.stem)
def test_every_ship_loads_and_stands_upright(file):
    found = load_config(file, Vessel)
    model = RollModel(found.ship, found.tank)
    assert not model.derivative([0.0] * 4).any()
    assert model.derivative([0.01, 0, found.tank.width_m / 2 * math.tan(0.01), 0])[1] < 0
    assert found.pump.duct_area_m2 == found.tank.duct_area_m2


def test_patti_b_has_table_4_1():
    ship = vessel("patti_b").ship
    assert ship.stiffness_nm_rad == pytest.approx(2.366e6 * 0.2138)
    assert ship.restoring_odd_nm == pytest.approx((-2.366e6 * 0.6713,))
    vanishing_rad = math.sqrt(0.2138 / 0.6713)
    assert restoring(ship).moment_nm(vanishing_rad) == pytest.approx(0.0, abs=1.0)


def test_naval_vessel_has_its_published_derivatives():
    ship = vessel("naval_vessel").ship
    assert ship.inertia_kg_m2 == pytest.approx(2.3763e6 + 7.74e5)
    assert ship.stiffness_nm_rad == pytest.approx(1014 * 9.81 * 1.1 * 357, rel=1e-4)
    assert ship.restoring_odd_nm == pytest.approx((0.325 * 1014 * 357 * 9.81,), rel=1e-4)
