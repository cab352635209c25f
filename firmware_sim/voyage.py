"""Voyage of a scenario: course, speed, loading and sea that change under way."""

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
    """State of the voyage at a time.

    All values pass linearly from one waypoint to the next. A value that a waypoint does not name is
    that of the previous one.
    """

    time_s: Positive
    heading_deg: Bearing | None = None  #: Direction in which the waves go relative to the ship.
    course_deg: Bearing | None = None
    """Ship's course where the sea has directions, instead of the heading: degrees clockwise from
    true north."""
    speed_m_s: Speed | None = None
    sea: AnySpectrum | None = None  #: Spectrum of the sea; its other keys are the scenario's.
    ship: dict[str, Finite] = Field(default_factory=dict)
    """Parameters of the ship, with the keys of ``actual_ship``."""


def waypoint_problems(voyage: Sequence[Waypoint], duration_s: float) -> list[Problem]:
    """Problems of times that do not increase, or are beyond the end."""
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
    """Return a quantity of the voyage as a function of time in s.

    `start` is the value at time 0; `value` gives a waypoint's, None where it has none. An `angle`
    in degrees turns the shorter way.
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
    """Ship at a time in s, with the parameters of the waypoints."""
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
    """Times and spectra of the sea: the scenario's own, then those of the waypoints."""
    known = list(first)
    if any(point.sea is not None for point in voyage):
        for point in voyage:
            known.append((point.time_s, point.sea or known[-1][1]))
    return known
