"""Stopping rule for a group of cases, independent of the order in which they return."""

import math
from collections.abc import Iterable, Mapping, Sequence
from typing import Any, Final

from firmware_sim.campaign.study import Scalar, Stop
from firmware_sim.figures import NO_TANK
from utank_hil.analysis.motion.statistics import mean_interval

_NOTHING: Final[Mapping[str, float]] = {}

Figures = Mapping[str, float]  #: Metric by run; empty for a failed case.


def figures_of(rows: Iterable[Mapping[str, Any]], metric: str) -> dict[str, float]:
    """Return a metric by run, for the runs that count and have it."""
    return {
        str(row["run"]): float(row[metric])
        for row in rows
        if row["run"] not in ("", NO_TANK) and not row["mark"] and not math.isnan(row[metric])
    }


def enough(stop: Stop, figures: Sequence[Figures]) -> bool:
    """Whether the confidence intervals of all runs are as narrow as requested."""
    if len(figures) < stop.least:
        return False
    runs = {run for each in figures for run in each}
    for run in runs:
        values = [each[run] for each in figures if run in each]
        if len(values) < stop.least:
            return False
        found = mean_interval(values)
        allowed = stop.half_width
        if allowed is None:
            assert stop.relative is not None
            allowed = stop.relative * abs(found.mean)
        if found.half_width > allowed:
            return False
    return bool(runs)


class Stopping:
    """Selection of the cases that a campaign still needs; without a rule it needs all."""

    def __init__(
        self, stop: Stop | None, groups: Mapping[tuple[Scalar, ...], Sequence[str]]
    ) -> None:
        self._stop = stop
        self._groups = {group: tuple(dict.fromkeys(names)) for group, names in groups.items()}
        self._group_of = {name: group for group, names in groups.items() for name in names}
        self._figures: dict[str, Figures] = {}
        self._judged = dict.fromkeys(self._groups, 0)
        self._closed: dict[tuple[Scalar, ...], int] = {}

    def add(self, rows: Iterable[Mapping[str, Any]]) -> None:
        """Record the rows of completed cases."""
        if self._stop is None:
            return
        by_case: dict[str, list[Mapping[str, Any]]] = {}
        for row in rows:
            by_case.setdefault(row["case"], []).append(row)
        for name, of_case in by_case.items():
            if name in self._group_of:
                self._figures[name] = figures_of(of_case, self._stop.metric)
        for group in {self._group_of[name] for name in by_case if name in self._group_of}:
            self._judge(group)

    def needs(self, name: str) -> bool:
        """Whether the case of this name must still be computed."""
        return self._group_of[name] not in self._closed

    def used(self, group: tuple[Scalar, ...]) -> Sequence[str]:
        """Names of the cases that count in a group: the first ones, up to the stopping point."""
        return self._groups[group][: self._closed.get(group)]

    def _judge(self, group: tuple[Scalar, ...]) -> None:
        """Advance through a group's cases, in order, as far as their rows are known."""
        assert self._stop is not None
        if group in self._closed:
            return
        names = self._groups[group]
        while self._judged[group] < len(names) and names[self._judged[group]] in self._figures:
            self._judged[group] += 1
            count = self._judged[group]
            if enough(self._stop, [self._figures[name] for name in names[:count]]):
                self._closed[group] = count
                return
