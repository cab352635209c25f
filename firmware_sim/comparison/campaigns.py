"""Comparison of campaigns, case by case where the waves are the same."""

import math
from pathlib import Path
from typing import Any

import numpy as np

from firmware_sim.campaign.metrics import METRICS
from firmware_sim.campaign.store import Results, read_results
from firmware_sim.campaign.summary import Group, groups_of
from firmware_sim.comparison.difference import (
    CompareError,
    Comparison,
    Difference,
    differing,
    independent,
    paired,
    same_runs,
)

_Figures = dict[str, dict[str, float]]  # Metrics by the waves of a case.


def compare_campaigns(reference: Path, others: list[Path]) -> list[Comparison]:
    """Compare campaigns with the first one, group by group and run by run.

    Raises `CompareError` if the campaigns vary different keys, or share no group or no run.
    """
    first = read_results(reference)
    return [each for other in others for each in _compared(first, other)]


def _compared(first: Results, path: Path) -> list[Comparison]:
    second = read_results(path)
    if set(first.keys) != set(second.keys):
        here, there = (", ".join(each.keys) or "nothing" for each in (second, first))
        raise CompareError(
            f"{path}: varies {here}, the reference {there}: only like can be compared"
        )
    remarks = differing(
        *({**each.about, **each.about["configuration"]} for each in (first, second))
    )
    groups = {_key(group): group for group in groups_of(second)}
    shared = [group for group in groups_of(first) if _key(group) in groups]
    if not shared:
        raise CompareError(f"{path}: has no value of {', '.join(first.keys)} in common")
    waves = [{case["case"]: case["waves"] for case in each.cases} for each in (first, second)]
    found = []
    for group in shared:
        other = groups[_key(group)]
        for run in same_runs(group.runs, other.runs, str(path)):
            one, two = _of_run(group, run, waves[0]), _of_run(other, run, waves[1])
            figures = {
                metric: difference
                for metric in METRICS
                if (difference := _of_metric(one, two, metric)) is not None
            }
            found.append(Comparison(str(path), run, group.parameters, figures, remarks))
    return found


def _key(group: Group) -> tuple[tuple[str, Any], ...]:
    return tuple(sorted(group.parameters.items()))


def _of_run(group: Group, run: str, waves: dict[str, str]) -> _Figures:
    return {waves[row["case"]]: row for row in group.of_run(run) if not row["mark"]}


def _of_metric(one: _Figures, two: _Figures, metric: str) -> Difference | None:
    """Difference of a metric; None where one side lacks it."""
    values = [
        {waves: row[metric] for waves, row in each.items() if not math.isnan(row[metric])}
        for each in (one, two)
    ]
    if not all(values):
        return None
    common = [waves for waves in values[0] if waves in values[1]]
    if common:
        return paired(*(np.array([each[waves] for waves in common]) for each in values))
    return independent(*(np.array(list(each.values())) for each in values))
