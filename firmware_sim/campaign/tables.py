"""Tables of a campaign."""

import math
from typing import Any

from rich.table import Table

from firmware_sim.figures import NO_TANK
from utank_hil.console.terminal import new_table

Figure = dict[str, Any]
_FEW = 4  #: Cases from which on Student's factor, below 3.2, leaves an interval to judge by.


def interval(figure: Figure, scale: float, digits: int) -> str:
    """Format a mean with the half width of its interval."""
    if figure["mean"] is None:
        return ""
    mean = f"{scale * figure['mean'] + 0.0:.{digits}f}"
    width = figure["half_width"]
    return mean if width is None else f"{mean} ± {scale * width:.{digits}f}"


def runs_table(groups: list[dict[str, Any]], title: str) -> Table:
    """Table with a row for each run of each group."""
    power = _power(groups)
    marked = any(run["marked"] for group in groups for run in group["runs"].values())
    figures = (
        "cases", "roll\nRMS °", "below\npassive %", "max.\nroll °", "level\npeak\nm",
        f"power\n{power[1]}", *(["not\ncounted"] if marked else []),
    )  # fmt: skip
    counts = [run["roll_rms_rad"]["cases"] for group in groups for run in group["runs"].values()]
    few = "; few cases: more seeds narrow it" if min(counts, default=_FEW) < _FEW else ""
    caption = f"mean ± 95 % of the mean{few}"
    table = new_table(title, *figures, names=("run", *_short_keys(groups)), caption=caption)
    for group in groups:
        for run, found in group["runs"].items():
            marks = [f"{count} {mark}" for mark, count in found["marked"].items()]
            worst = found["worst"]["roll_max_rad"]
            passive = "" if run == "passive" else interval(found["roll_below_passive"], 100, 0)
            table.add_row(
                run,
                *(_short(value) for value in group["parameters"].values()),
                str(found["roll_rms_rad"]["cases"]),
                interval(found["roll_rms_rad"], 180 / math.pi, 2),
                passive,
                f"{math.degrees(worst):.1f}",
                _mean(found["level_peak_m"], 1, 2),
                _mean(found["power_mean_w"], power[0], 1),
                *([", ".join(marks)] if marked else []),
            )
    return table


def pairs_table(groups: list[dict[str, Any]]) -> Table:
    """Table of the paired comparison of laws in the same waves."""
    table = new_table(
        "In the same waves, pair by pair",
        *("pairs", "roll RMS below it %", "difference °"),
        names=("run", "against", *_short_keys(groups)),
        caption="mean ± 95 % of the mean",
    )
    for group in groups:
        pairs = [(pair["against"], pair) for pair in group["paired"]]
        pairs += [("first row's", pair) for pair in group["beside_first"]]
        for against, pair in pairs:
            table.add_row(
                pair["run"],
                against,
                *(_short(value) for value in group["parameters"].values()),
                str(pair["roll_rms_difference_rad"]["cases"]),
                interval(pair["share_below"], 100, 1),
                interval(pair["roll_rms_difference_rad"], 180 / math.pi, 3),
            )
    return table


def _mean(figure: Figure, scale: float, digits: int) -> str:
    return interval({**figure, "half_width": None}, scale, digits)


def _power(groups: list[dict[str, Any]]) -> tuple[float, str]:
    """Scale and unit of power in which the largest mean has at most three digits."""
    means = [
        found["power_mean_w"]["mean"] or 0.0
        for group in groups
        for run, found in group["runs"].items()
        if run != NO_TANK
    ]
    return (1e-6, "mean\nMW") if max(means, default=0.0) >= 1e6 else (1e-3, "mean\nkW")


def _short_keys(groups: list[dict[str, Any]]) -> list[str]:
    """Shortest unambiguous suffixes of the keys that define groups."""
    keys = list(groups[0]["parameters"]) if groups else []
    short = []
    for key in keys:
        parts = key.split(".")
        ends = (".".join(parts[-count:]) for count in range(1, len(parts)))
        others = [other for other in keys if other != key]
        short.append(next((e for e in ends if not any(o.endswith(e) for o in others)), key))
    return short


def _short(value: Any) -> str:
    """Format the value of a key; empty in cases that do not name it."""
    if value is None:
        return ""
    return f"{value:g}" if isinstance(value, float) else str(value)
