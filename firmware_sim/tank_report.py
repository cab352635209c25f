"""Properties of a tank as table and JSON, for `init` and `design tank`."""

import math
from collections.abc import Sequence
from dataclasses import asdict
from typing import Any

from rich.table import Table

from utank_hil.analysis.tank_filling import Filling
from utank_hil.analysis.tank_prediction import LoadingPoint, RollPrediction
from utank_hil.analysis.tank_sizing import TankCost
from utank_hil.console.ship_report import power_words, tonnes
from utank_hil.console.terminal import new_table
from utank_hil.control.optimal_tank import TankFigures

Rows = list[tuple[str, str]]

_ACTIVE = "  active tank, against passive"
_NEEDS = (
    "level it needs, significant",
    "pressure it needs, significant",
    "shaft power it needs, mean",
)


def cost_rows(cost: TankCost) -> Rows:
    """Rows of a tank's cost to the ship, and of its capacity."""
    share, loss_m = cost.share_of_displacement, cost.gm_loss_m
    return [
        ("water", tonnes(1e3 * cost.water_t) + ("" if share is None else f", {share:.1%}")),
        (
            "free surface takes",
            f"{cost.stability_taken:.1%}"
            + (" of the stability" if loss_m is None else f", {loss_m:.2f} m of GM"),
        ),
        ("period of the water", f"{cost.water_period_s:.2f} s"),
        ("damping ratio of the water", f"{cost.damping_ratio:.3f}"),
        ("usable level", f"{cost.usable_level_m:.2f} m"),
        ("wave slope that it holds", f"{math.degrees(cost.slope_capacity_rad):.1f}°"),
    ]


def figure_rows(figures: TankFigures) -> Rows:
    """Rows of the parameters that determine the tank's response."""
    return [
        ("duct area", f"{figures.duct_area_m2:.2f} m²"),
        ("frequency per roll frequency", f"{figures.frequency_ratio:.3f}"),
        ("mass ratio", f"{figures.mass_ratio:.4f}"),
        ("coupling ratio", f"{figures.coupling_ratio:.3f}"),
        ("greatest roll per static roll", f"{figures.peak:.2f}"),
    ]


def roll_rows(found: RollPrediction) -> Rows:
    """Rows of expected roll, and of the pump's effect on it."""
    active = found.active
    rows = [
        ("roll RMS without tank", _degrees(found.without_tank_rad)),
        (
            "  passive tank",
            f"{_degrees(found.passive.roll_rms_rad)}, {less(found.passive_below_no_tank)}",
        ),
    ]
    if active is None or found.mean_power_w is None:
        return [*rows, (_ACTIVE, "none"), *((text, "") for text in _NEEDS)]
    return [
        *rows,
        (_ACTIVE, f"{_degrees(active.roll_rms_rad)}, {less(found.active_below_passive)}"),
        *zip(
            _NEEDS,
            (
                f"{2 * active.level_rms_m:.2f} m",
                f"{2e-3 * active.pressure_rms_pa:.1f} kPa",
                power_words(found.mean_power_w),
            ),
            strict=True,
        ),
    ]


def loading_table(points: Sequence[LoadingPoint]) -> Table:
    """Table of the roll at other loadings."""
    title = "Other loadings: the same tank and law, roll RMS in °"
    figures = ("roll period", "without tank", "passive tank", "active tank")
    table = new_table(title, *figures, names=())
    for point in points:
        rolls = (point.without_tank_rad, point.passive_rad, point.active_rad)
        cells = ("" if roll is None else f"{math.degrees(roll):.2f}" for roll in rolls)
        table.add_row(f"×{point.period_scale:g}", *cells)
    return table


def filling_table(found: Sequence[Filling], present_m: float, sea: str) -> Table:
    """Table of filling advice by loading."""
    figures = ("GM m", "roll s", "level m", "water t", "water s", "GM loss m", "passive")
    caption = (
        f"level: still water above the duct, {present_m:.2f} m in the file; passive: roll against "
        f"no tank in {sea}; *: bound by the tank's height"
    )
    table = new_table("Filling", *figures, names=("load t",), caption=caption)
    for each in found:
        table.add_row(
            f"{each.displacement_t:.5g}",
            f"{each.gm_m:.2f}",
            f"{each.roll_period_s:.1f}",
            f"{'' if each.tuned else '* '}{each.level_m:.2f}",
            f"{each.water_t:.4g}",
            f"{each.water_period_s:.1f}",
            f"{each.gm_loss_m:.2f}",
            less(each.passive_below_no_tank),
        )
    return table


def prediction_json(found: RollPrediction) -> dict[str, Any]:
    """Prediction in SI units."""
    active = found.active
    return {
        "without_tank_rad": found.without_tank_rad,
        "passive": asdict(found.passive),
        "active": None if active is None else asdict(active),
        "mean_power_w": found.mean_power_w,
        "passive_below_no_tank": found.passive_below_no_tank,
        "active_below_passive": found.active_below_passive,
        "no_law": found.no_law or None,
    }


def less(share: float | None) -> str:
    """Reduction of roll in words, also a negative one; empty without one."""
    if share is None:
        return ""
    return f"{abs(share):.0%} {'more' if share < 0 else 'less'}"


def _degrees(angle_rad: float) -> str:
    return f"{math.degrees(angle_rad):.2f}°"
