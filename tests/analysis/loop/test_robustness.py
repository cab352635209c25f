"""The shipped designs hold the promised robustness; the check finds what fails."""

import dataclasses

import numpy as np
import pytest
from shipped_designs import DPC_ROLL_LEVEL, GPC_ROLL

from utank_hil.analysis.loop.margins import (
    EXTRA_DELAY_S,
    GAINS,
    INERTIA_SCALES,
    PERIOD_SCALES,
    closed_loop_radius,
    robustness,
)
from utank_hil.control import DesignPlant
from utank_hil.control.gain import GainLaw
from utank_hil.dynamics import RollShip, Tank
from utank_hil.dynamics.linear import STATES, pump_model
from utank_hil.dynamics.sampling import sample

pytestmark = pytest.mark.slow

SHIP = RollShip(1.9275e9, 1.9275e9 * 0.25, 4.87e7)
TANK = Tank(17.1, 4.88, 17.11, 6.22, lz_m=1.83, damping_ratio=0.10)


def judge(design):
    return robustness(
        design.law(DesignPlant(SHIP, TANK)), DesignPlant(SHIP, TANK), design.predictor.measured
    )


def test_the_worst_of_both_tanks_counts():
    law, measured = GPC_ROLL.law(DesignPlant(SHIP, TANK)), GPC_ROLL.predictor.measured
    calm = dataclasses.replace(TANK, damping_ratio=0.02)
    ends = [robustness(law, DesignPlant(SHIP, tank), measured) for tank in (TANK, calm)]
    found = robustness(law, DesignPlant(SHIP, TANK, calm=calm), measured)
    assert found.worst_radius == max(end.worst_radius for end in ends)
    assert found.late_radius == max(end.late_radius for end in ends)
    assert found.nominal.peak_sensitivity == max(end.nominal.peak_sensitivity for end in ends)
    assert ends[0] != ends[1]


@pytest.mark.parametrize("design", [GPC_ROLL, DPC_ROLL_LEVEL], ids=["gpc", "dpc"])
def test_default_designs_hold_what_is_promised(design):
    found = judge(design)
    assert found.failures() == ()
    assert found.nominal.peak_sensitivity <= 1.75
    assert found.nominal.gain_high > 2
    assert found.nominal.delay_margin_s > 0.5


def test_aggressive_design_is_found_out():
    hard = dataclasses.replace(GPC_ROLL, output_weight=(3e15,))
    failures = judge(hard).failures()
    assert any("peak sensitivity" in failure for failure in failures)
    assert any("roll period" in failure for failure in failures)


@pytest.mark.parametrize("field", ["late_radius", "worst_radius"])
def test_what_is_not_a_number_is_no_margin(field):
    found = judge(GPC_ROLL)
    assert dataclasses.replace(found, **{field: float("nan")}).failures()
    for name in ("radius", "peak_sensitivity"):
        nominal = dataclasses.replace(found.nominal, **{name: float("nan")})
        assert dataclasses.replace(found, nominal=nominal).failures()


def radii(law, **scales):
    """Greatest radius over the pump's gains with a number of the ship scaled."""
    ship = dataclasses.replace(SHIP, **{n: v * getattr(SHIP, n) for n, v in scales.items()})
    plant = sample(pump_model(ship, TANK, STATES), law.sample_time_s, 0.05, 0.1)
    return max(closed_loop_radius(law, plant, gain) for gain in GAINS)


def test_a_law_that_only_another_inertia_destabilizes_is_found_out():
    law = GainLaw(np.array([[-4.2554e6, 1.6122e7, 9.8309e4, 6.4011e3]]), 0.05)
    by_stiffness = [radii(law, stiffness_nm_rad=scale**-2) for scale in PERIOD_SCALES]
    by_inertia = [radii(law, inertia_kg_m2=scale) for scale in INERTIA_SCALES]
    assert max(by_stiffness) < 1 < max(by_inertia)
    found = robustness(law, DesignPlant(SHIP, TANK), STATES)
    assert found.worst_radius >= max(by_inertia)
    assert found.worst_inertia_scale == INERTIA_SCALES[int(np.argmax(by_inertia))]
    assert any("of the ship's inertia" in failure for failure in found.failures())


@pytest.mark.parametrize("gains", [(0.0, 3e5, 0.0, 2e4), (1e6, 6e6, 1e4, 2e4)])
def test_the_worst_of_the_grid_is_the_worst_of_all_ships_gains_and_delays(gains):
    law = GainLaw(np.array([gains]), 0.05)
    found = robustness(law, DesignPlant(SHIP, TANK), STATES)
    worst = 0.0
    changes = [{"stiffness_nm_rad": scale**-2} for scale in PERIOD_SCALES]
    changes += [{"inertia_kg_m2": scale} for scale in INERTIA_SCALES]
    for change in changes:
        ship = dataclasses.replace(SHIP, **{n: v * getattr(SHIP, n) for n, v in change.items()})
        for late in (0.0, EXTRA_DELAY_S):
            plant = sample(pump_model(ship, TANK, STATES), 0.05, 0.05 + late, 0.1)
            worst = max(worst, *(closed_loop_radius(law, plant, gain) for gain in GAINS))
    assert found.worst_radius == pytest.approx(worst, abs=1e-12)
