"""Laws side by side."""

import io
import math

import numpy as np
import pytest
from rich.console import Console
from rolling_ship import SHIP, TANK
from shipped_designs import GPC_ROLL

from utank_hil.analysis.loop.comparison import Loop, compare, comparison_table
from utank_hil.analysis.loop.sea_response import CalmSeaError
from utank_hil.analysis.loop.trade import trade
from utank_hil.control import DesignPlant, PredictiveLaw
from utank_hil.sea import Harmonics

pytestmark = pytest.mark.slow

WAVES = Harmonics(np.array([1e7, 2e7]), np.array([0.48, 0.62]), np.zeros(2))
GPC = Loop("GPC", GPC_ROLL.law(DesignPlant(SHIP, TANK)), ("roll_rad",))
# pushes the water the wrong way, hard
WRONG = Loop(
    "wrong",
    PredictiveLaw(np.zeros((1, 1, 1)), np.full((1, 1, 1), 1e8), np.zeros((1, 1, 1)), 0.2),
    ("roll_rad",),
)


def test_reductions_are_those_of_the_root_mean_squares():
    rows = compare([GPC], DesignPlant(SHIP, TANK), WAVES)
    assert [row.name for row in rows] == ["no tank", "passive", "GPC"]
    rms = [row.motion.roll_rms_rad for row in rows]
    assert rows[0].roll_below_no_tank == 0
    assert rows[1].roll_below_passive == 0
    assert rows[2].roll_below_no_tank == pytest.approx(1 - rms[2] / rms[0])
    assert rows[2].roll_below_passive == pytest.approx(1 - rms[2] / rms[1])
    assert rows[2].margins.peak_sensitivity < 2
    assert rows[2].index_rad_pa > 0


def test_an_unstable_law_has_no_figures():
    row = compare([WRONG], DesignPlant(SHIP, TANK), WAVES)[2]
    assert row.motion is None
    assert row.margins.radius > 1


def test_the_table_says_what_the_rows_hold():
    console = Console(width=200, record=True, file=io.StringIO())
    rows = compare([GPC, WRONG], DesignPlant(SHIP, TANK), WAVES)
    console.print(comparison_table(rows, "Two laws"))
    text = console.export_text()
    gpc, wrong = (next(x for x in text.splitlines() if name in x) for name in ("GPC", "wrong"))
    assert f"{math.degrees(rows[2].motion.roll_rms_rad):.2f}" in gpc
    assert f"{rows[2].roll_below_passive:.1%}" in gpc
    assert "unstable" in wrong


@pytest.mark.parametrize("amplitude_nm", [0.0, 1.0])
def test_a_sea_that_does_not_roll_the_ship_is_refused_by_name(amplitude_nm):
    calm = Harmonics(np.array([amplitude_nm]), np.array([0.5]), np.zeros(1))
    with pytest.raises(CalmSeaError, match="does not roll the ship"):
        compare([GPC], DesignPlant(SHIP, TANK), calm)
    with pytest.raises(CalmSeaError, match="does not roll the ship"):
        trade(GPC_ROLL, DesignPlant(SHIP, TANK), calm)
