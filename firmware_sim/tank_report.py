"""What a tank is and does, as a table and as JSON: for `init` and `design tank`."""

import math
from collections.abc import Sequence
from dataclasses import asdict
from typing import Any

from rich.table import Table

from utank_hil.analysis.tank_prediction import LoadingPoint, RollPrediction
from utank_hil.analysis.tank_sizing import TankCost

Rows = list[tuple[str, str]]


def cost_rows(cost: TankCost) -> Rows:
    """What a tank takes from the ship, and what it can hold."""
    share, loss_m = cost.share_of_displacement, cost.gm_loss_m
    return [
        ("water", f"{cost.water_t:.3g} t" + ("" if share is None else f", {share:.1%}")),
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


def roll_rows(found: RollPrediction) -> Rows:
    """Expected roll, and what the pump does for it."""
    active = found.active
    rows = [
        ("roll RMS without tank", _degrees(found.without_tank_rad)),
        (
            "  passive tank",
            f"{_degrees(found.passive.roll_rms_rad)}, {found.passive_below_no_tank:.0%} less",
        ),
    ]
    if active is None or found.mean_power_w is None:
        return [*rows, ("  active tank", "none"), *3 * [("", "")]]
    return [
        *rows,
        (
            "  active tank",
            f"{_degrees(active.roll_rms_rad)}, {found.active_below_passive:.0%} less than passive",
        ),
        ("level it needs, significant", f"{2 * active.level_rms_m:.2f} m"),
        ("pressure it needs, significant", f"{2e-3 * active.pressure_rms_pa:.1f} kPa"),
        ("shaft power it needs, mean", power(found.mean_power_w)),
    ]


def loading_table(points: Sequence[LoadingPoint]) -> Table:
    """Roll at other loadings."""
    table = Table(title="Other loadings: the same tank and law, roll RMS in °")
    for heading in ("roll period", "without tank", "passive tank", "active tank"):
        table.add_column(heading, justify="right", no_wrap=True)
    for point in points:
        rolls = (point.without_tank_rad, point.passive_rad, point.active_rad)
        cells = ("" if roll is None else f"{math.degrees(roll):.2f}" for roll in rolls)
        table.add_row(f"×{point.period_scale:g}", *cells)
    return table


def prediction_json(found: RollPrediction) -> dict[str, Any]:
    """A prediction in SI units."""
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


def power(value_w: float) -> str:
    """A power in the unit that fits."""
    return f"{value_w / 1e6:.2f} MW" if abs(value_w) >= 1e6 else f"{value_w / 1e3:.3g} kW"


def _degrees(angle_rad: float) -> str:
    return f"{math.degrees(angle_rad):.2f}°"
