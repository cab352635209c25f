"""Laws side by side, and the pictures of them."""

import io
import math
from pathlib import Path

import matplotlib.image
import numpy as np
import pytest
from rich.console import Console
from rolling_ship import SHIP, TANK
from shipped_designs import GPC_ROLL

from utank_hil.analysis.loop.comparison import Loop, compare, comparison_table
from utank_hil.analysis.loop.sea_response import CalmSeaError
from utank_hil.analysis.loop.trade import trade
from utank_hil.control import PD_MEASURED, DesignPlant, PredictiveLaw, design_pd
from utank_hil.dynamics import Tank
from utank_hil.pictures.loops import draw_bode, draw_nyquist
from utank_hil.pictures.records import draw_phase, draw_time
from utank_hil.pictures.style import COLORS
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
SIDES = ((0x00, 0x72, 0xB2), (0xD5, 0x5E, 0x00))


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


def pixels(path: Path, rgb: tuple[int, int, int]) -> np.ndarray:
    image = matplotlib.image.imread(path)[..., :3]
    return np.argwhere(np.abs(image - np.array(rgb) / 255).max(axis=-1) < 0.02)


def test_bode_and_nyquist_draw_a_curve_for_each_law(tmp_path: Path):
    loops = [GPC, Loop("PD", design_pd(SHIP, TANK), PD_MEASURED)]
    for draw in (draw_bode, draw_nyquist):
        path = draw(loops, DesignPlant(SHIP, TANK), tmp_path / "two.png", "Two laws")
        assert path == tmp_path / "two.png"
        assert all(len(pixels(path, rgb)) > 1000 for rgb in SIDES)


def test_bode_of_a_ship_with_hardly_any_water_peaks_at_her_roll_frequency(tmp_path: Path):
    zero = PredictiveLaw(np.zeros((1, 1, 1)), np.zeros((1, 1, 1)), np.zeros((1, 1, 1)), 0.2)
    tank = Tank(17.1, 4.88, 1e-3, 1e-3, damping_ratio=0.9)
    path = draw_bode(
        [Loop("none", zero, ("roll_rad",))], DesignPlant(SHIP, tank), tmp_path / "b.png", ""
    )
    rows, columns = pixels(path, SIDES[0]).T
    curve = columns < 0.6 * columns.max()  # leaves the legend out
    peak = columns[curve][rows[curve] == rows[curve].min()].mean()
    # the axis goes from a fifth to five times the roll frequency, so the peak is in its middle
    assert peak == pytest.approx((columns.min() + columns.max()) / 2, rel=0.01)


def test_more_laws_than_colours_are_refused(tmp_path: Path):
    for draw in (draw_bode, draw_nyquist):
        with pytest.raises(ValueError, match=f"got {len(COLORS)}"):
            draw([GPC] * len(COLORS), DesignPlant(SHIP, TANK), tmp_path / "many.png", "Many")


def test_records_are_drawn_over_time_and_in_the_plane(tmp_path: Path):
    time = np.linspace(0, 60, 600)
    roll = {"passive": np.sin(time), "GPC": 0.5 * np.sin(time)}
    path = draw_time(
        time, {"Roll (°)": roll, "Level (m)": {"GPC": roll["GPC"]}}, tmp_path / "t.png", "T"
    )
    blue = pixels(path, SIDES[0])
    assert len(blue) > 1000
    plane = {name: (x, np.cos(time)) for name, x in roll.items()}
    path = draw_phase(plane, ("Roll (°)", "Roll rate (°/s)"), tmp_path / "p.png", "P")
    assert len(pixels(path, SIDES[0])) > 1000


def test_no_record_and_too_many_are_refused(tmp_path: Path):
    time = np.zeros(2)
    for number in (0, len(COLORS) + 1):
        records = {str(n): time for n in range(number)}
        with pytest.raises(ValueError, match=f"got {number}"):
            draw_time(time, {"x": records}, tmp_path / "t.png", "None")


@pytest.mark.parametrize("amplitude_nm", [0.0, 1.0])
def test_a_sea_that_does_not_roll_the_ship_is_refused_by_name(amplitude_nm):
    calm = Harmonics(np.array([amplitude_nm]), np.array([0.5]), np.zeros(1))
    with pytest.raises(CalmSeaError, match="does not roll the ship"):
        compare([GPC], DesignPlant(SHIP, TANK), calm)
    with pytest.raises(CalmSeaError, match="does not roll the ship"):
        trade(GPC_ROLL, DesignPlant(SHIP, TANK), calm)
