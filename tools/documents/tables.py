"""The documents' tables that are made from docs/evidence.

Such a table stands between `<!-- table: NAME -->` and `<!-- end of table -->`, and below it the
command and date of its numbers.
"""

import math
import re
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

from tools.evidence.parts import PARTS, Part
from tools.evidence.record import Record, read
from utank_hil.thesis.figure import Verdict, printed_text

DOCS = Path(__file__).resolve().parents[2] / "docs"
PLACE = re.compile(r"(<!-- table: (.*?) -->\n)(.*?)(<!-- end of table -->)", re.S)
Rows = list[list[str]]  # the heading first
Law = dict[str, float | None]
LEAST_RATE = 0.01
GRID = "+-30 % roll period, 0.8 to 1.25 of the inertia, +-20 % gain, 0 or 20 ms later"


class TableError(Exception):
    """A table that can't be made."""


def number(value: float | None, form: str) -> str:
    """A number as written; nothing where there is none."""
    return "" if value is None else format(value, form)


def law_margins(result: dict[str, dict[str, Law]]) -> Rows:
    """What each law stands, a column a law."""
    laws = result["margins"]

    def row(name: str, column: str, form: str, limit: str, beyond: str = "any") -> list[str]:
        cells = (
            number(law[column], form) or beyond if column in law else "" for law in laws.values()
        )
        return [name, *cells, limit]

    return [
        ["", *laws, "asked for"],
        row("peak sensitivity", "peak of S", ".2f", "2 or less"),
        row("the same, 20 ms later", "S 20 ms late", ".2f", "stable"),
        row("least gain factor that keeps it stable", "gain from", ".2f", "0.8 or less"),
        row("greatest gain factor that does", "gain to", ".2f", "1.2 or more"),
        row("phase margin, deg", "phase margin °", ".0f", ""),
        row("extra delay that destabilizes, s", "delay margin s", ".3f", "above 0.020", "above 5"),
        row("pole of the law itself", "law's pole", ".3f", ""),
        row(f"greatest eigenvalue, {GRID}", "worst pole", ".4f", "below 1"),
        row("list under a steady moment, without washout", "list, no washout", ".2f", ""),
    ]


def passive_optimum(result: dict[str, dict[str, dict[str, float]]]) -> Rows:
    """The best passive tanks, and the first ship's."""
    return [
        ["tank", "frequency ratio", "damping ratio", "greatest roll per static roll"],
        *(
            [name, *(f"{row[column]:.3f}" for column in list(row)[:2]),
             f"{row['greatest roll per static']:.2f}"]
            for name, row in result["passive"].items()
        ),
    ]  # fmt: skip


def printed_laws(result: dict[str, dict[str, dict[str, float]]]) -> Rows:
    """Largest deviations from the printed coefficients."""
    shares = ("16 roll-only", "8 on u and roll", "4 on tank angle")
    return [
        ["ship", "roll damping, N m s", "tank damping", *shares],
        *(
            [
                name,
                f"{row['roll damping N m s']:.3g}",
                f"{row['tank damping']:.3f}",
                *(f"{100 * row[share]:.2g} %" for share in shares),
            ]
            for name, row in result["printed"].items()
            if "tank damping" in row
        ),
    ]


def printed_index(result: dict[str, dict[str, dict[str, float]]]) -> Rows:
    """Performance indices relative to DPC (roll)."""
    laws = ["GPC (roll)", "DPC (roll, level)", "GPC (roll, level)"]
    return [
        ["relative to DPC (roll)", *laws],
        *(
            [name, *(f"{row[law]:.3f}" for law in laws)]
            for name, row in result["index"].items()
        ),
    ]  # fmt: skip


def step_costs(result: dict[str, dict[str, float]]) -> Rows:
    """Cost of a step of each controller."""
    return [
        ["law", "p50, us", "p99", "max", "bytes held in a step", "bytes kept"],
        *(
            [
                name,
                *(f"{cost[key]:.1f}" for key in ("p50_us", "p99_us")),
                *(f"{cost[key]:.0f}" for key in ("max_us", "held_bytes", "kept_bytes")),
            ]
            for name, cost in result.items()
        ),
    ]


def errata_terms(result: dict[str, Any]) -> Rows:
    """Every printed term that differs from first principles."""
    return [
        ["equation", "term", "printed coefficient", "first principles"],
        *([name, *(f"`{cell}`" for cell in cells)] for name, *cells in result["errata"]),
    ]


def thesis_figures(result: dict[str, Any]) -> Rows:
    """One row a figure of the source."""
    rows = [["figure", "", "greatest deviation", "holds", "in part", "does not", "open"]]
    for figure in result["figures"]:
        name = [figure["key"], figure["title"]]
        if figure["word"]:
            rows.append([*name, f"{figure['word']}: nothing to compute", "", "", "", ""])
            continue
        known = [row["deviation"] for row in figure["rows"] if row["deviation"] is not None]
        verdicts = [check["verdict"] for check in figure["checks"]]
        counts = (str(verdicts.count(verdict) or "") for verdict in Verdict)
        rows.append([*name, f"{max(known, key=abs):+.2%}" if known else "", *counts])
    return rows


def thesis_numbers(result: dict[str, Any]) -> Rows:
    """One row a printed number of the source."""
    return [
        ["figure", "number", "printed", "ours", "", "deviation", "reason"],
        *(
            [
                figure["key"],
                row["quantity"],
                printed_text(row),
                number(row["ours"], ".5g"),
                row["unit"],
                number(row["deviation"], "+.2%"),
                row["reason"],
            ]
            for figure in result["figures"]
            for row in figure.get("rows", ())
        ),
    ]


def thesis_statements(result: dict[str, Any]) -> Rows:
    """One row a statement of the source's text."""
    return [
        ["figure", "the text says", "", "measured"],
        *(
            [figure["key"], check["statement"], f"**{check['verdict']}**", check["measured"]]
            for figure in result["figures"]
            for check in figure.get("checks", ())
        ),
    ]


def scenarios(result: dict[str, Any]) -> Rows:
    """Every run of every shipped scenario."""
    linear = {(row["scenario"], row["run"]): row["roll_rms_rad"] for row in result["rows"]
              if row["plant"] == "linear"}  # fmt: skip

    def cells(row: dict[str, Any]) -> list[str]:
        alike, roll_rad = linear.get((row["scenario"], row["run"])), row["roll_rms_rad"]
        power_w, passive = row["power_mean_w"], row["run"] == "passive"
        return [
            row["scenario"],
            row["run"],
            f"{math.degrees(roll_rad):.2f}",
            number(row["roll_below_no_tank"], ".1%"),
            "" if passive else number(row["roll_below_passive"], ".1%"),
            number(row["strikes"], ".0f"),
            "" if power_w is None else f"{power_w / 1e3:.3g}",
            f"{roll_rad / alike - 1:+.1%}" if alike else "",
        ]

    headings = ("scenario", "run", "roll RMS, °", "below no tank", "below passive", "strikes",
                "shaft power, kW", "roll against linear plant")  # fmt: skip
    return [
        list(headings),
        *(cells(row) for row in result["rows"] if row["plant"] is None and row["run"]),
    ]


def thesis_contest(result: dict[str, Any]) -> Rows:
    """Who capsizes, a row a law and pump."""
    (table,) = (figure["table"] for figure in result["figures"] if figure["key"] == "contest")
    return [table["headings"], *table["rows"]]


def share(value: dict[str, float]) -> str:
    """A share in per cent with its interval."""
    half = value.get("half_width")
    return f"{value['mean']:.0%}" + ("" if half is None else f" ± {100 * half:.0f}")


def points(value: dict[str, float]) -> str:
    """A difference in per cent with its interval."""
    return f"{100 * value['mean']:.1f} ± {100 * value['half_width']:.1f}"


def many_seas(result: dict[str, Any]) -> Rows:
    """Shares of the possible, a row a sea."""
    mean = "mean of the first sixteen"
    rows = dict(result["seas"]) | ({mean: result[mean]} if mean in result else {})
    laws = [name for name in next(iter(rows.values())) if name != "passive_deg"]
    return [
        ["sea", "passive, °", *laws],
        *(
            [
                name,
                number(row.get("passive_deg"), ".2f"),
                *(share(row[law]) if law in row else "" for law in laws),
            ]
            for name, row in rows.items()
        ),
    ]


def renewed_seas(result: dict[str, Any]) -> Rows:
    """Share, roll and power of the laws under way, a row a sea."""
    mean, own = "mean of the first sixteen", "renewed"
    rows = result["seas"] | ({mean: result[mean]} if mean in result else {})
    laws = [name for name, law in next(iter(rows.values())).items() if isinstance(law, dict)]
    return [
        ["sea", "passive, °", *laws, f"{own}: below passive", *(f"{law}, kW" for law in laws)],
        *(
            [
                name,
                number(row.get("passive_deg"), ".2f"),
                *(share(row[law]["share"]) for law in laws),
                number(row[own]["below_passive"]["mean"], ".1%"),
                *(f"{row[law]['power_w']['mean'] / 1e3:.0f}" for law in laws),
            ]
            for name, row in rows.items()
        ),
    ]


def planning(result: dict[str, Any]) -> Rows:
    """Planned laws beside the same laws clipped, a row a sea and pump."""

    def level_m(case: dict[str, Any], law: str) -> str:
        return f"{max(run['level_peak_m'] for run in case['runs'][law]):.2f}"

    return [
        ["sea and pump", "Hs, Tp", "passive", "`gpc.yaml`", "clipped", "constrained", "below, %",
         "self-tuned clipped", "self-tuned", "below, %",
         "greatest level, m: clipped, constrained, self-tuned"],
        *(
            [
                case["name"],
                f"{case['hs_m']:.2f} m, {case['tp_s']:.1f} s",
                *(f"{case['roll_rms_deg'][law]:.3f}"
                  for law in ("passive", "GPC_ROLL", "clipped", "constrained")),
                points(case["below"]["clipped"]),
                *(f"{case['roll_rms_deg'][law]:.3f}"
                  for law in ("self-tuned clipped", "self-tuned")),
                points(case["below"]["self-tuned clipped"]),
                ", ".join(level_m(case, law) for law in ("clipped", "constrained", "self-tuned")),
            ]
            for case in result["cases"]
        ),
    ]  # fmt: skip


def voyage_stages(result: dict[str, Any]) -> Rows:
    """The renewed law beside the one that was given the truth, a row a stage."""
    return [
        ["stage", "passive, °", "renewed, °", "knows the truth, °", "share, renewed",
         "share, knows the truth", "lost, points"],
        *(
            [
                row["stage"],
                *(f"{row[f'{name}_deg']:.3f}" for name in ("passive", "renewed", "told")),
                *(f"{row[f'{name}_share']:.1%}" for name in ("renewed", "told")),
                points(row["lost_share"]),
            ]
            for row in result["stages"]
        ),
    ]  # fmt: skip


def sea_errors(result: dict[str, Any]) -> Rows:
    """Errors of the estimates in per cent, a row a law, record length and sea."""

    def spread(row: dict[str, float], name: str) -> str:
        if row.get(name) is None:
            return ""
        return f"{100 * row[name]:+.1f} ± {100 * row[name + '_scatter']:.1f}"

    def percent(row: dict[str, float], name: str) -> str:
        return "" if row.get(name) is None else f"{100 * row[name]:.1f}"

    return [
        ["law", "min", "sea", "parts", "sea, ship known", "moment RMS", "stated", "Hs", "Tp",
         "density, dB", "stiffness where known", "stated", "period where known"],
        *(
            [
                row["law"], f"{row['minutes']:g}", row["sea"], str(row["parts"]),
                f"{row['sea_good']}, {row['ship_good']}",
                spread(row, "moment"), percent(row, "stated"), spread(row, "height"),
                spread(row, "peak"), f"{row['spectrum_db']:.1f}", spread(row, "stiffness"),
                percent(row, "stiffness_deviation"), spread(row, "period"),
            ]
            for row in result["errors"]
        ),
    ]  # fmt: skip


def stiffness_by_loading(result: dict[str, Any]) -> Rows:
    """How well stiffness, and with it GM, is known under way, a row a loading."""
    return [
        ["record, min", "roll period, s", "records", "known", "within 5 %", "greatest error"],
        *(
            [
                *(f"{row[name]:g}" for name in ("minutes", "period_s")),
                *(str(row[name]) for name in ("parts", "told", "within")),
                number(row["worst"], ".1%"),
            ]
            for row in result["loadings"]
        ),
    ]


def storm_shares(result: dict[str, Any]) -> Rows:
    """Each law in the storm hour, between the passive tank and the clairvoyant."""

    def row(name: str, law: dict[str, float]) -> list[str]:
        part, of = law.get("share"), law.get("pressure_rms_pa")
        peak_w = law.get("power_peak_w")
        return [
            name,
            number(law["roll_rms_deg"], ".3f"),
            "" if part is None else f"{100 * part:.1f} ± {100 * law['share_half_width']:.1f} %",
            number(law.get("share_of_causal"), ".3f"),
            number(law.get("level_peak_m"), ".2f"),
            number(None if of is None else of / 1e3, ".1f"),
            number(None if peak_w is None else peak_w / 1e6, ".2f"),
            number(law.get("peak_sensitivity"), ".2f"),
            number(law.get("worst_radius"), ".4f"),
        ]

    return [
        ["", "roll RMS, deg", "share of the possible", "of the causal bound's", "highest level, m",
         "pressure RMS, kPa", "peak power, MW", "peak sensitivity",
         "largest eigenvalue"],
        *(row(name, law) for name, law in result["rows"].items()),
    ]  # fmt: skip


def february_hours(result: dict[str, Any]) -> Rows:
    """The measured hours in bands of the passive roll."""
    law = "self-tuning"
    bands: dict[str, list[dict[str, Any]]] = {}
    for group in result["groups"]:
        passive_deg = math.degrees(group["runs"]["passive"]["roll_rms_rad"]["mean"])
        edge = next(edge for edge in (0.25, 0.5, 1.0, math.inf) if passive_deg < edge)
        for name in ("all", f"below {edge:g}°" if edge < math.inf else "above 1°"):
            bands.setdefault(name, []).append(group["runs"][law])
    rows = [["passive roll RMS", "hours", "below passive, mean", "in the worst hour",
             "hours wholly above passive", "shaft power, mean kW", "energy, MWh"]]  # fmt: skip
    for name in sorted(bands, key=lambda name: (name == "all", name[0] == "a", name)):
        below = [run["roll_below_passive"] for run in bands[name]]
        power_kw = [run["power_mean_w"]["mean"] / 1e3 for run in bands[name]]
        rows.append(
            [
                name,
                str(len(below)),
                f"{sum(each['mean'] for each in below) / len(below):.1%}",
                share(min(below, key=lambda each: each["mean"])),
                str(sum(each["mean"] + each["half_width"] < 0 for each in below)),
                f"{sum(power_kw) / len(power_kw):.0f}",
                f"{sum(power_kw) / 1e3:.1f}",
            ]
        )
    return rows


def fault_times(result: dict[str, Any]) -> Rows:
    """When each fault was found and the pump at zero, a row a fault."""
    times = ("found_ms", "limit_ms", "zero_ms", "zero_limit_ms")
    return [
        ["row", "found, ms", "limit", "zero, ms", "limit",
         "roll variance over the passive ship's", "called"],
        *(
            [
                f"`{row['id']}`",
                *(number(row[name], ".0f") for name in times),
                number(row["roll_ratio"], ".2f"),
                " ".join(row["codes"]),
            ]
            for row in result["rows"]
        ),
    ]  # fmt: skip


def false_alarms(result: dict[str, Any]) -> Rows:
    """What was found in the hours of each law, sea by sea."""
    seas = list(dict.fromkeys(run["sea"] for run in result["runs"]))
    found: dict[str, dict[str, str]] = {}
    for run in result["runs"]:
        words = [f"{name} in {hours}" for name, hours in run["found_in_hours"].items()]
        found.setdefault(run["law"], {})[run["sea"]] = f"{', '.join(words) or 'none'}"
    return [
        ["law", *seas],
        *([f"`{law}`", *(cells.get(sea, "") for sea in seas)] for law, cells in found.items()),
    ]


def false_alarm_rates(result: dict[str, Any]) -> Rows:
    """Tail of the hourly maxima, a row a monitor."""
    rows = sorted(result["by_monitor"].items(), key=lambda item: -item[1]["rate_per_hour"])

    def rate(each: dict[str, float]) -> str:
        times = 1e3 * each["rate_per_hour"]
        return f"{float(f'{times:.2g}'):g}" if times >= LEAST_RATE else f"below {LEAST_RATE}"

    return [
        ["statistic", "hours", "largest over its threshold", "beyond it, times in 1000 h"],
        *([name, str(each["hours"]), f"{each['largest']:.2f}", rate(each)] for name, each in rows),
    ]


def week(result: dict[str, Any]) -> Rows:
    """What the process took at the beginning, in the middle and at the end of the week."""
    samples = [dict(zip(result["samples"]["head"], row, strict=True))
               for row in result["samples"]["rows"]]  # fmt: skip
    return [
        ["hour", "resident, MB", "objects", "descriptors", "tick, us"],
        *(
            [f"{each['hours']:.0f}", f"{each['resident_mb']:.1f}", f"{each['objects']:.0f}",
             f"{each['descriptors']:.0f}", f"{each['tick_us']:.2f}"]
            for each in (samples[0], *samples[23::24])
        ),
    ]  # fmt: skip


# name in the document: the part it is made from, and how
TABLES: dict[str, tuple[str, Callable[[Any], Rows]]] = {
    "law margins": ("linear_law_tables", law_margins),
    "passive optimum": ("linear_law_tables", passive_optimum),
    "printed laws": ("linear_law_tables", printed_laws),
    "printed index": ("linear_law_tables", printed_index),
    "step costs": ("cost_controllers", step_costs),
    "many seas": ("many_seas", many_seas),
    "renewed seas": ("renewed_seas", renewed_seas),
    "planning": ("constrained_campaign", planning),
    "voyage stages": ("renewed_voyage", voyage_stages),
    "sea estimates": ("sea_estimates", sea_errors),
    "stiffness by loading": ("sea_estimates", stiffness_by_loading),
    "storm shares": ("share_of_possible", storm_shares),
    "february hours": ("february_hours", february_hours),
    "fault times": ("fault_campaign", fault_times),
    "false alarms": ("false_alarms", false_alarms),
    "false alarm rates": ("false_alarms", false_alarm_rates),
    "week": ("week", week),
    "shipped scenarios": ("shipped_scenarios", scenarios),
    "errata terms": ("thesis_derivation", errata_terms),
    "thesis figures": ("thesis_figures", thesis_figures),
    "thesis numbers": ("thesis_figures", thesis_numbers),
    "thesis contest": ("thesis_figures", thesis_contest),
    "thesis statements": ("thesis_figures", thesis_statements),
}


def source(part: Part, kept: Record) -> str:
    """Where the numbers are from."""
    data = f"evidence/{kept['part']}.json"
    command = kept["command"].removesuffix(" --json")
    before = "" if kept["command"] == part.command else f" as it was at {kept['commit']}"
    return f"`{command}`{before}, {kept['date']}; machine, versions and commit: [{data}]({data})."


def table(name: str) -> str:
    """A table and its source as Markdown.

    Raises
    ------
    TableError
        If there is no such table, or no result that it can be made from.
    """
    if name not in TABLES:
        raise TableError(f"no table {name!r}: there are {', '.join(TABLES)}")
    part_name, rows_of = TABLES[name]
    part = next(part for part in PARTS if part.name == part_name)
    kept = read(part)
    if kept is None:
        raise TableError(f"run `python -m tools.evidence --part {part_name}` first")
    heading, *rows = (
        "|".join(f" {cell} " if cell else " " for cell in row) for row in rows_of(kept["result"])
    )
    lines = [heading, "|".join(["---"] * (heading.count("|") + 1)), *rows]
    drawn = "\n".join(f"|{line}|" for line in lines)
    return f"{drawn}\n\n{source(part, kept)}\n"


def pages() -> Iterator[tuple[Path, str]]:
    """Each document that has such tables, with the tables made anew.

    Raises
    ------
    TableError
        With the document, as `table`.
    """
    for document in sorted(DOCS.rglob("*.md")):
        text = document.read_text(encoding="utf-8")
        if not PLACE.search(text):
            continue
        try:
            yield document, PLACE.sub(lambda found: found[1] + table(found[2]) + found[4], text)
        except TableError as error:
            raise TableError(f"{document}: {error}") from error
