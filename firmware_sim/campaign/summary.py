"""Summary of a campaign: means with confidence intervals, and paired comparison of laws.

Cases that share a seed met the same random waves, those of one day of a file the same weather, and
those of a draw the same ship. So an interval is the widest of those whose independent units are the
cases, and the values of each key that is averaged over.
"""

import itertools
import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final

from firmware_sim.campaign.simulations import FAILED, OK
from firmware_sim.campaign.stopping import Stopping
from firmware_sim.campaign.store import METRICS, Results
from firmware_sim.campaign.study import Scalar, Stop
from firmware_sim.figures import LEAST_ROLL_RAD, NO_TANK
from utank_hil.analysis.motion.statistics import clustered_interval

ROLL: Final = "roll_rms_rad"
_TIME: Final = re.compile(r"\d{4}-\d\d-\d\d(?=T)")
_OF_CASES: Final = ("case", "index", "waves")  #: What a case has beside the varied keys.
Units = Mapping[str, tuple[Scalar | tuple[Scalar, ...], ...]]
"""What a case shares with others, by its name: a value for each way to share."""
Figure = dict[str, float | int | None]
"""Mean, half width of its 95 % confidence interval (None for one case), and number of cases."""


@dataclass(frozen=True, slots=True)
class Group:
    """Cases that differ only in the keys averaged over."""

    parameters: dict[str, Scalar]  #: Varied keys that the cases have in common.
    rows: list[list[dict[str, Any]]]  #: Rows of each case that succeeded.
    planned: int
    #: failed, lost: number of cases that failed or were lost.
    failed: int
    lost: int

    @property
    def runs(self) -> list[str]:
        """Names of the runs in order."""
        return list(dict.fromkeys(str(row["run"]) for rows in self.rows for row in rows))

    def of_run(self, run: str) -> list[dict[str, Any]]:
        """Rows of one run."""
        return [row for rows in self.rows for row in rows if row["run"] == run]


def groups_of(results: Results) -> list[Group]:
    """Groups of a campaign with the rows that count by `Stopping`."""
    by_group: dict[tuple[Scalar, ...], list[str]] = {}
    for each in results.cases:
        by_group.setdefault(tuple(each[key] for key in results.keys), []).append(each["case"])
    written = results.about.get("configuration", {}).get("stop")
    stopping = Stopping(None if written is None else Stop.model_validate(written), by_group)
    stopping.add(row for rows in results.rows.values() for row in rows)
    groups = []
    for group, names in by_group.items():
        different, used = dict.fromkeys(names), dict.fromkeys(stopping.used(group))
        found = [results.rows[name] for name in used if name in results.rows]
        states = [rows[0]["status"] for rows in found]
        groups.append(
            Group(
                dict(zip(results.keys, group, strict=True)),
                [rows for rows in found if rows[0]["status"] == OK],
                len(different),
                states.count(FAILED),
                len(states) - states.count(FAILED) - states.count(OK),
            )
        )
    return groups


def units_of(results: Results) -> Units:
    """Seed, day of a file or other value of each averaged key, and all drawn values together."""
    averaged = results.about.get("configuration", {}).get("average_over", ())
    own = {*_OF_CASES, *results.keys, *averaged}

    def unit(value: Scalar) -> Scalar:
        day = _TIME.match(value) if isinstance(value, str) else None
        return value if day is None else day[0]

    return {
        case["case"]: (
            *(unit(case[key]) for key in averaged if key in case and key not in results.keys),
            tuple(value for key, value in case.items() if key not in own),
        )
        for case in results.cases
    }


def figure(values: Sequence[tuple[str, float]], units: Units) -> Figure:
    """Mean and confidence interval of values by their cases; NaN values are left out."""
    known = [(case, value) for case, value in values if not math.isnan(value)]
    mean, half_width = known[0][1] if known else None, None
    if len(known) > 1:
        cases, numbers = zip(*known, strict=True)
        ways = zip(*(units[case] for case in cases), strict=True)
        found = [clustered_interval(numbers, way) for way in (cases, *ways) if len(set(way)) > 1]
        mean, half_width = max(found, key=lambda each: each.half_width)
    return {"mean": mean, "half_width": half_width, "cases": len(known)}


def summary(results: Results) -> list[dict[str, Any]]:
    """Figures of every group, ready for JSON."""
    groups = groups_of(results)
    cases = {case["case"]: case for case in results.cases}
    units = units_of(results)
    own = {"case", "index", *results.keys}
    pairs = {
        name: tuple(value for key, value in case.items() if key not in own)
        for name, case in cases.items()
    }  # Cases of two groups that differ in the keys of groups alone.
    return [
        {
            "parameters": group.parameters,
            "planned": group.planned,
            "counted": len(group.rows),
            "failed": group.failed,
            "lost": group.lost,
            "runs": {run: _run(group, run, cases, units) for run in group.runs},
            "paired": _paired(group, units),
            "beside_first": [] if group is groups[0] else _beside(groups[0], group, pairs, units),
        }
        for group in groups
    ]


def failures(results: Results) -> dict[str, int]:
    """Number of cases without a result, by reason."""
    reasons: dict[str, int] = {}
    for rows in results.rows.values():
        if rows[0]["status"] != OK:
            reasons[rows[0]["reason"]] = reasons.get(rows[0]["reason"], 0) + 1
    return reasons


def _run(
    group: Group, run: str, cases: Mapping[str, dict[str, Any]], units: Units
) -> dict[str, Any]:
    rows = group.of_run(run)
    counted = [row for row in rows if not row["mark"]]
    marks = [row["mark"] for row in rows if row["mark"]]
    made: dict[str, Any] = {
        name: figure([(row["case"], row[name]) for row in counted], units) for name in METRICS
    }
    made["marked"] = {mark: marks.count(mark) for mark in dict.fromkeys(marks)}
    # the maximum covers all cases: a ship that capsized had the worst one
    worst = max(rows, key=lambda row: row[ROLL])
    made["worst"] = {name: worst[name] for name in ("mark", ROLL, "roll_max_rad")}
    made["worst"] |= cases[worst["case"]]
    return made


def _paired(group: Group, units: Units) -> list[dict[str, Any]]:
    """Roll RMS of each run against those before it, paired by case and so by waves."""
    runs = [run for run in group.runs if run != NO_TANK]
    counted = [{row["run"]: row for row in rows if not row["mark"]} for rows in group.rows]
    pairs = []
    for against, run in itertools.combinations(runs, 2):
        both = [
            (rows[run]["case"], rows[against][ROLL], rows[run][ROLL])
            for rows in counted
            if run in rows and against in rows
        ]
        if both:
            pairs.append({"run": run, "against": against, **_pair(both, units)})
    return pairs


def _beside(
    first: Group, group: Group, pairs_of: Mapping[str, tuple[Any, ...]], units: Units
) -> list[dict[str, Any]]:
    """Roll RMS of each run against the same run of the first group, in the same waves."""
    pairs = []
    for run in group.runs:
        there, here = (
            {pairs_of[row["case"]]: row for row in each.of_run(run) if not row["mark"]}
            for each in (first, group)
        )
        both = [
            (row["case"], there[name][ROLL], row[ROLL])
            for name, row in here.items()
            if name in there
        ]
        if both:
            pairs.append({"run": run, **_pair(both, units)})
    return pairs


def _pair(both: list[tuple[str, float, float]], units: Units) -> dict[str, Figure]:
    """Mean difference of paired roll values, and mean relative reduction."""
    shares = [(case, 1 - one / other) for case, other, one in both if other >= LEAST_ROLL_RAD]
    return {
        "roll_rms_difference_rad": figure(
            [(case, one - other) for case, other, one in both], units
        ),
        "share_below": figure(shares, units),
    }
