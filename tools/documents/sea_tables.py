"""Tables of seas, voyages and what was estimated of them."""

import math
from typing import Any

from tools.documents.rows import Rows, Table, number, points, share


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


TABLES: dict[str, Table] = {
    "many seas": ("many_seas", many_seas),
    "renewed seas": ("renewed_seas", renewed_seas),
    "planning": ("constrained_campaign", planning),
    "voyage stages": ("renewed_voyage", voyage_stages),
    "sea estimates": ("sea_estimates", sea_errors),
    "stiffness by loading": ("sea_estimates", stiffness_by_loading),
    "storm shares": ("share_of_possible", storm_shares),
    "february hours": ("february_hours", february_hours),
    "shipped scenarios": ("shipped_scenarios", scenarios),
}
