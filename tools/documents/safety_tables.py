"""Tables of the fault campaign, false alarms and the week."""

from typing import Any

from tools.documents.rows import Rows, Table, number

LEAST_RATE = 0.01


def fault_times(result: dict[str, Any]) -> Rows:
    """When each fault was found and the pump at zero, a row a fault."""
    times = ("found_ms", "limit_ms", "zero_ms", "zero_limit_ms")
    return [
        ["row", "found, ms", "limit", "zero, ms", "limit",
         "roll variance over the passive ship's", "called", "seas not passed"],
        *(
            [
                f"`{row['id']}`",
                *(number(row[name], ".0f") for name in times),
                number(row["roll_ratio"], ".2f"),
                " ".join(row["codes"]),
                ", ".join(dict.fromkeys(
                    why.partition(":")[0].removeprefix("seed ") for why in row["problems"]
                )),
            ]
            for row in result["rows"]
        ),
    ]  # fmt: skip


def false_alarms(result: dict[str, Any]) -> Rows:
    """What was found in the hours of each law, sea by sea."""
    seas = list(dict.fromkeys(run["sea"] for run in result["runs"]))
    found: dict[str, dict[str, str]] = {}
    for run in result["runs"]:
        words = [f"{name} in {len(hours)}" for name, hours in run["found_in_hours"].items()]
        cell = f"{', '.join(words) or 'none'} of {run['hours']}"
        found.setdefault(run["law"], {})[run["sea"]] = cell
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


def twin_errors(result: dict[str, Any]) -> Rows:
    """The passive ship beside the twin, where a law in a sea came nearest to ROLL_AMPLIFIED."""
    nearest: dict[tuple[str, str], dict[str, Any]] = {}
    for run in sorted(result["runs"], key=lambda run: -run["share"]):
        nearest.setdefault((run["law"], run["sea"]), run)
    return [
        ["law", "sea", "over its threshold", "roll over the twin's", "over the passive ship's",
         "the same over twelve periods"],
        *(
            [f"`{run['law']}`", run["sea"], *(number(run[name], ".2f") for name in (
                "share", "ratio_of_twin", "ratio_of_passive_ship", "over_twelve_periods"))]
            for run in nearest.values()
        ),
    ]  # fmt: skip


def monitor_costs(result: dict[str, dict[str, float]]) -> Rows:
    """Processor time of each monitor, the dearest first."""
    rows = sorted(result.items(), key=lambda item: -item[1]["in_the_loop_us_a_tick"])
    return [
        ["monitor", "ticks from call to call", "in the loop, us a tick", "by itself"],
        *(
            [
                name,
                f"{cost['ticks_between_calls']:.3g}",
                f"{cost['in_the_loop_us_a_tick']:.2f}",
                f"{cost['in_a_row_us_a_tick']:.2f}",
            ]
            for name, cost in rows
        ),
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


TABLES: dict[str, Table] = {
    "fault times": ("fault_campaign", fault_times),
    "false alarms": ("false_alarms", false_alarms),
    "false alarm rates": ("false_alarms", false_alarm_rates),
    "twin errors": ("twin_errors", twin_errors),
    "monitor costs": ("cost_monitors", monitor_costs),
    "week": ("week", week),
}
