"""Properties of a tank as tables, for `init` and `design`."""

import math
from collections.abc import Callable, Sequence

from rich.table import Table

from firmware_sim.prediction import Expected, Loading, peaks
from firmware_sim.report_tables import in_one_unit, like_largest
from utank_hil.analysis.motion.statistics import Interval, PumpStatistics
from utank_hil.analysis.tank_filling import Filling
from utank_hil.analysis.tank_sizing import TankCost
from utank_hil.analysis.tank_sweep import SweptTank
from utank_hil.console.ship_report import power_words, three_digits, tonnes
from utank_hil.console.terminal import new_table
from utank_hil.control.optimal_tank import TankFigures

Rows = list[tuple[str, str]]

_LAWS = ("first law", "renewed")


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


def roll_rows(found: Sequence[Expected]) -> Rows:
    """Rows of expected roll, and of what the pump does for it: the words of a bench.

    `found` is of one law, or of the first and the renewed one; peaks are those over both.
    """
    first, most = found[0], peaks(found)

    def of_each(text: str, words: Callable[[Expected], str]) -> Rows:
        if len(found) == 1:
            return [(text, words(first))]
        return [(f"{text}, {law}", words(of)) for law, of in zip(_LAWS, found, strict=True)]

    most_words = ("",) * 3
    if most is not None:
        flow = f"{most.level_m:.2f} m, {three_digits(most.flow_m3_s)} m³/s"
        most_words = f"{most.pressure_pa / 1e3:.1f} kPa", flow, power_words(most.power_w)
    return [
        ("roll RMS without tank", _degrees(first.without_tank_rad)),
        ("  passive tank", _degrees(first.passive_rad)),
        ("  below no tank", percent(first.passive_below_no_tank)),
        *of_each("  active tank", lambda of: _degrees(of.active_rad)),
        *of_each("  below passive", lambda of: percent(of.active_below_passive)),
        *of_each("pressure RMS", lambda of: _kilopascals(of.pump)),
        *of_each("shaft power mean", lambda of: _watts(of.mean_power_w)),
        *zip(("pressure at most", "level, flow at most", "shaft power at most"), most_words,
             strict=True),
    ]  # fmt: skip


def interval_words(found: Expected, scenario: str) -> str:
    """Meaning of the rows of `roll_rows`, for a caption."""
    return f"roll and pump in {scenario}; ±: 95 % of its benches of {found.window_s:.0f} s"


def loading_table(loadings: Sequence[Loading]) -> Table:
    """Table of the roll at other loadings; marked where the law rolls the ship more."""
    title = "Other loadings: the same tank and law, roll RMS in °"
    figures = ("roll period", "without tank", "passive tank", "active tank")
    count = 3 if all(each.expected.active_rad is None for each in loadings) else 4
    table = new_table(title, *figures[:count], names=())
    for each in loadings:
        cells = [_degrees(roll, "") for roll in rolls(each.expected)][: count - 1]
        gain = each.expected.active_below_passive
        if gain is not None and gain.mean < 0:
            cells[-1] = f"* {cells[-1]}"
            table.caption = "*: more than passive; a bench gives the law up there (ROLL_AMPLIFIED)"
        table.add_row(f"×{each.period_scale:g}", *cells)
    return table


def rolls(found: Expected) -> tuple[Interval | None, Interval | None, Interval | None]:
    """Roll RMS in rad without tank, with it passive and active."""
    return found.without_tank_rad, found.passive_rad, found.active_rad


def filling_table(found: Sequence[Filling], present_m: float, sea: str) -> Table:
    """Table of filling advice by loading."""
    figures = ("GM m", "roll s", "level m", "water t", "water s", "GM loss m", "passive")
    caption = (
        f"level: still water above the duct, {present_m:.2f} m in the file; passive: roll against "
        f"no tank in {sea}; *: bound by the tank's height"
    )
    table = new_table("Filling", *figures, names=("load t",), caption=caption)
    waters_t = like_largest([each.water_t for each in found], 4)
    loads_t = like_largest([each.displacement_t for each in found], 4)
    for each, load_t, water_t in zip(found, loads_t, waters_t, strict=True):
        table.add_row(
            load_t,
            f"{each.gm_m:.2f}",
            f"{each.roll_period_s:.1f}",
            f"{'' if each.tuned else '* '}{each.level_m:.2f}",
            water_t,
            f"{each.water_period_s:.1f}",
            f"{each.gm_loss_m:.2f}",
            less(each.passive_below_no_tank),
        )
    return table


def sweep_table(found: Sequence[SweptTank]) -> Table:
    """Roll of other passive tanks, by share of stability and by frequency."""
    ratios = sorted({each.frequency_ratio for each in found})
    table = new_table(
        "Other tanks, passive: roll RMS in °",
        *(f"{ratio:g}" for ratio in ratios),
        names=("stability", "water t"),
        caption="by stability taken, and by the water's frequency per roll frequency; linear",
    )
    for share in sorted({each.stability_share for each in found}):
        row = {each.frequency_ratio: each for each in found if each.stability_share == share}
        water_t = [each.water_t for each in row.values()]
        cells = (
            f"{math.degrees(row[ratio].roll_rms_rad):.2f}" if ratio in row else ""
            for ratio in ratios
        )
        table.add_row(f"{share:.0%}", f"{min(water_t):.4g} to {max(water_t):.4g}", *cells)
    return table


def less(share: float | None) -> str:
    """Reduction of roll in words, also a negative one; empty without one."""
    if share is None:
        return ""
    return f"{abs(share):.0%} {'more' if share < 0 else 'less'}"


def percent(share: Interval | None) -> str:
    """A share and its interval in percent; empty without one."""
    if share is None:
        return ""
    return f"{round(share.mean, 2) + 0.0:.0%} ± {share.half_width:.0%}"  # no -0%


def _kilopascals(pump: PumpStatistics | None) -> str:
    return "" if pump is None else f"{pump.pressure_rms_pa / 1e3:.1f} kPa"


def _watts(power_w: Interval | None) -> str:
    if power_w is None:
        return ""
    unit, (mean, width) = in_one_unit(power_w, "W")
    return f"{mean} ± {width} {unit}"


def _degrees(angle_rad: Interval | None, unit: str = "°") -> str:
    if angle_rad is None:
        return ""
    return " ± ".join(f"{math.degrees(value):.2f}{unit}" for value in angle_rad)
