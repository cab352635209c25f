"""The shipped designs hold the promised robustness; the check finds what fails."""

import dataclasses

import pytest

from utank_hil.analysis.robustness import robustness
from utank_hil.control import DPC_ROLL_LEVEL, GPC_ROLL
from utank_hil.dynamics import RollShip, Tank

SHIP = RollShip(1.9275e9, 1.9275e9 * 0.25, 4.87e7)
TANK = Tank(17.1, 4.88, 17.11, 6.22, lz_m=1.83, damping_ratio=0.10)


def judge(design):
    return robustness(design.law(SHIP, TANK), SHIP, TANK, design.predictor.measured)


@pytest.mark.parametrize("design", [GPC_ROLL, DPC_ROLL_LEVEL], ids=["gpc", "dpc"])
def test_default_designs_hold_what_is_promised(design):
    found = judge(design)
    assert found.failures() == ()
    assert found.nominal.peak_sensitivity <= 1.75
    assert found.late_peak_sensitivity <= 1.05 * found.nominal.peak_sensitivity
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
