"""Voyage of a scenario: course, speed, loading and sea that change under way.

And what ship, sea and times imply together, to find wrong units.
"""

import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from functools import partial
from itertools import pairwise
from typing import Any, Final

import numpy as np
from pydantic import Field

from firmware_sim.scenario_sea import LEAST_SPEED_M_S, Bearing, Speed
from utank_hil.base.parameters import Finite, Positive, Problem
from utank_hil.configuration import Section, Vessel
from utank_hil.configuration.plausibility import vessel_problems, vessel_warnings
from utank_hil.configuration.spectra import AnySpectrum
from utank_hil.dynamics.ship import RollShip
from utank_hil.dynamics.tank import GRAVITY_M_S2
from utank_hil.sea.moment_table import MomentTable
from utank_hil.sea.sea import EffectiveSlope


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


TURN_S: Final = 10.0  #: Time in which a ship comes into a turn, and out of it. Chosen; no study.


def turning(
    turn_rad: Callable[[float], float],
    speed_m_s: Callable[[float], float],
    mass_kg: float,
    lever_m: float,
) -> Callable[[float], tuple[float, float]]:
    """Roll moment in N m, and lateral acceleration over g, of turns as a function of time in s.

    At speed V and rate of turn r the centre of gravity is accelerated by V r to the inside. The
    force on the hull acts `lever_m` below it, so its moment m V r lever heels the ship outward.
    `turn_rad` is the turn to starboard since the start.
    """

    def at(time_s: float) -> tuple[float, float]:
        rate_rad_s = (turn_rad(time_s) - turn_rad(time_s - TURN_S)) / TURN_S
        inward_m_s2 = speed_m_s(time_s) * rate_rad_s
        return -mass_kg * inward_m_s2 * lever_m, inward_m_s2 / GRAVITY_M_S2

    return at


_ROLL_DEG: Final = (0.05, 20.0)
"""Static roll RMS of a sea that neither leaves the ship at rest nor is beyond the model."""
_SLOPES_REFUSED: Final = (0.01, 30.0)
_SLOPES: Final = (0.1, 4.0)
"""Greatest moment of a table per that of the full wave slope: hulls have 0.3 to 2."""
_PERIODS: Final = (0.5, 2.0)
"""Roll period of a loading per that of the ship's file: from ballast to a deep draught."""


def moment_problems(sea: Any, ship: RollShip) -> list[Problem]:
    """Return why the roll moments of a table can't be those of the ship; `sea` is the section."""
    slope = _slope_of_table(sea, ship)
    if slope is None or _SLOPES_REFUSED[0] <= slope <= _SLOPES_REFUSED[1]:
        return []
    return [("sea.roll_moment_table", _of_table(slope))]


def unusual_sea(sea: Any, ship: RollShip, hs_m: float, static_roll_rad: float) -> list[Problem]:
    """Return what is unusual in the effect of a sea without problems on the ship."""
    found = []
    slope, roll_deg = _slope_of_table(sea, ship), math.degrees(static_roll_rad)
    if slope is not None and not _SLOPES[0] <= slope <= _SLOPES[1]:
        found.append(("sea.roll_moment_table", _of_table(slope)))
    if hs_m > 0 and not _ROLL_DEG[0] <= roll_deg <= _ROLL_DEG[1]:
        keys = sorted(sea.model_fields_set & {"hs_m", "amplitude_m", "tp_s", "period_s"})
        reason = (
            f"would heel the ship {roll_deg:.2g} degrees RMS, standing still: check "
            f"{', '.join([*keys, 'effective_slope'])} and the ship's stiffness; heights are in "
            "metres, periods in seconds"
        )
        found.append(("sea", reason))
    return found


def unusual_waypoints(voyage: Sequence[Waypoint], hs_m: float) -> list[Problem]:
    """Return what is unusual in seas and speeds under way, from a sea of `hs_m` on."""
    found = []
    for index, point in enumerate(voyage):
        if point.sea is not None and not 0.05 <= point.sea.spectrum().hs_m / hs_m <= 20:
            reason = f"passes from {hs_m:.2g} m to {point.sea.spectrum().hs_m:.2g} m"
            found.append((f"voyage.{index}.sea", f"{reason}: hs_m is in metres"))
        if point.speed_m_s is not None and 0 < point.speed_m_s < LEAST_SPEED_M_S:
            found.append((f"voyage.{index}.speed_m_s", f"is {point.speed_m_s:g}: it is in m/s"))
    return found


def unusual_loadings(vessel: Vessel, given: Mapping[str, dict[str, float]]) -> Iterator[Problem]:
    """Yield what is unusual in ships that differ from the vessel's, by the keys that say so."""
    own, tank = vessel.ship, vessel.tank
    usual = {key for key, _ in vessel_warnings(own, tank, None)}
    for place, changed in given.items():
        if not changed:
            continue
        ship: RollShip = replace(own, **changed)  # type: ignore[arg-type]  # floats only
        judged = vessel_problems(ship, tank, None) or vessel_warnings(ship, tank, None)
        yield from (
            (f"{place}.{key.removeprefix('ship.')}", why)
            for key, why in judged
            if key not in usual and key.startswith("ship.")
        )
        ratio = own.natural_frequency_rad_s / ship.natural_frequency_rad_s
        if not _PERIODS[0] <= ratio <= _PERIODS[1]:
            reason = (
                f"rolls in {ratio:.3g} times the period of the ship's file: check "
                f"{' and '.join(changed)}, in kg m2, N m/rad and N"
            )
            yield place, reason


def _slope_of_table(sea: Any, ship: RollShip) -> float | None:
    """Return the greatest moment of a table per that of the full slope of the wave."""
    if sea.roll_moment_table is None:
        return None
    table = MomentTable.read(sea.roll_moment_table)
    omega = table.omega_rad_s
    beam = np.full(omega.shape, math.pi / 2)
    full = EffectiveSlope(1.0).moment(omega, beam, stiffness_nm_rad=ship.stiffness_nm_rad)
    return float(np.abs(table.moment(omega, beam)).max() / np.abs(full).max())


def _of_table(slope: float) -> str:
    return (
        f"has {slope:.2g} times the moment that the full slope of the waves has on this ship; "
        "hulls have 0.3 to 2: moment_nm_per_m is in N m per m of amplitude, not kN m"
    )
