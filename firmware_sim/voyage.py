"""The time line of a scenario: course, speed, loading and sea that change under way."""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace
from functools import partial
from itertools import pairwise
from typing import Any

import numpy as np
from pydantic import Field

from firmware_sim.scenario_sea import Bearing, Speed
from utank_hil.base.parameters import Finite, Positive, Problem
from utank_hil.configuration import Section
from utank_hil.configuration.spectra import AnySpectrum
from utank_hil.dynamics.ship import RollShip


class Waypoint(Section):
    """What the ship shall have reached at a time.

    Between two waypoints everything passes linearly from the one to the other. What a waypoint does
    not name is as at the one before.
    """

    time_s: Positive
    heading_deg: Bearing | None = None
    """Where the waves go relative to the ship."""
    course_deg: Bearing | None = None
    """Instead of the heading, where the sea has directions: clockwise from true north."""
    speed_m_s: Speed | None = None
    sea: AnySpectrum | None = None
    """Spectrum of the sea, met as the scenario's is."""
    ship: dict[str, Finite] = Field(default_factory=dict)
    """Keys of the ship, as in ``actual_ship``."""


def waypoint_problems(voyage: Sequence[Waypoint], duration_s: float) -> list[Problem]:
    """Times that do not increase, or lie beyond the end."""
    times = [0.0, *(point.time_s for point in voyage)]
    return [
        (
            f"voyage.{index}.time_s",
            f"is {after:g}, not after {before:g}: give the waypoints in the order of time",
        )
        for index, (before, after) in enumerate(pairwise(times))
        if after <= before
    ] + [
        (f"voyage.{index}.time_s", f"is {point.time_s:g}, after duration_s, {duration_s:g}")
        for index, point in enumerate(voyage)
        if point.time_s > duration_s
    ]


def track(
    voyage: Iterable[Waypoint],
    start: float,
    value: Callable[[Waypoint], float | None],
    *,
    angle: bool = False,
) -> Callable[[float], float]:
    """A quantity of the voyage as a function of time in s.

    Parameters
    ----------
    start : float
        Its value at time 0.
    value : callable
        What a waypoint says of it; None for nothing.
    angle : bool
        Whether it is an angle in degrees, which turns the shorter way.
    """
    times, values = [0.0], [start]
    for point in voyage:
        said = value(point)
        times.append(point.time_s)
        values.append(values[-1] if said is None else said)
    if angle:
        values = np.unwrap(values, period=360.0).tolist()
    return lambda time_s: float(np.interp(time_s, times, values))


def ship_on_the_way(voyage: Sequence[Waypoint], ship: RollShip, time_s: float) -> RollShip:
    """The ship with what the waypoints say of it, at a time in s."""
    changed = {}
    for key in {key for point in voyage for key in point.ship}:
        values = track(voyage, getattr(ship, key), partial(_ship_value, key))
        changed[key] = values(time_s)
    return replace(ship, **changed) if changed else ship  # type: ignore[arg-type]  # floats only


def _ship_value(key: str, point: Waypoint) -> float | None:
    return point.ship.get(key)


def spectra_on_the_way(
    voyage: Sequence[Waypoint], first: Sequence[tuple[float, Any]]
) -> list[tuple[float, Any]]:
    """When the sea has which spectrum: the scenario's own, then those of the waypoints."""
    known = list(first)
    if any(point.sea is not None for point in voyage):
        for point in voyage:
            known.append((point.time_s, point.sea or known[-1][1]))
    return known
