"""Figures of a run's retuning."""

import math
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from firmware_sim.run import RECORD_S, Run
from firmware_sim.scenario import Scenario
from utank_hil.base.arrays import FloatArray
from utank_hil.canbus import RetuningState
from utank_hil.retuning import ModelSummary, RetuningEvent

SETTLING_S: Final = 60.0
"""Time left out after a new law came into service: five roll periods of a slow ship, 12 s."""
_NEW_LAW: Final = (RetuningState.TRIAL, RetuningState.RETUNED)


@dataclass(frozen=True, slots=True)
class ShipInFigures:
    """True ship and tank, for comparison with the identified ones."""

    #: roll_period_s, damping_nms_rad: values of the ship without tank water.
    roll_period_s: float
    damping_nms_rad: float
    tank_damping_ratio: float


@dataclass(frozen=True, slots=True)
class RetuningFigures:
    """Figures of a run's retuning; all times are ship's time."""

    attempts: int
    #: Time at which the last new law took charge, on trial at first; None if none did.
    retuned_at_s: float | None
    #: Roll RMS about the heel before the first retuning; None if there is no such time.
    roll_before_rad: float | None
    #: Roll RMS from `SETTLING_S` after the last new law took charge, while it stayed in charge and
    #: no identification ran; None if there is no such time.
    roll_after_rad: float | None
    roll_after_below_before: float | None  #: Relative reduction of the roll.
    found: ModelSummary | None  #: Model for which the last new law was designed.
    #: True values at the start of the retuning that found `found`, or of the last one.
    truth: ShipInFigures
    state: str
    reasons: tuple[str, ...]  #: Reasons of the last retuning's begin and end, without its result.
    events: tuple[dict[str, Any], ...]  #: Events as by `RetuningEvent.as_json`, on ship's time.


def retuning_figures(run: Run, scenario: Scenario, settle_s: float) -> RetuningFigures | None:
    """Figures of a run's retuning; None if nothing happened.

    The scenario's ship is the truth. `settle_s` is left out at the start; where the ship changes
    later or under way, the time before that, too.
    """
    if not run.retuning:
        return None
    events = events_on_ships_time(run)
    time_s, state = run.column("time_s"), run.column("retuning")
    begun = [
        event
        for before, event in pairwise((None, *events))
        if event is not None and _begins(event, before)
    ]
    begun_s = begun[0].time_ns * 1e-9 if begun else math.inf
    changed_s = [point.time_s for point in scenario.voyage if point.ship]
    if scenario.actual_ship:
        changed_s.append(scenario.actual_from_s)
    settle_s = max(settle_s, *(each for each in changed_s if each < begun_s), 0.0)
    before = _rms(run, settle_s, begun_s) if begun else None
    after = retuned_at_s = None
    spans = _spans(time_s, np.isin(state, _NEW_LAW))
    if spans:
        retuned_at_s, end_s = spans[-1]
        after = _rms(run, retuned_at_s + SETTLING_S, end_s)
    found_by = next((event for event in reversed(events) if event.found), events[-1])
    looked_ns = max((e.time_ns for e in begun if e.time_ns <= found_by.time_ns), default=0)
    last = events[events.index(begun[-1]) :] if begun else events
    ship = scenario.ship_at(looked_ns * 1e-9)
    return RetuningFigures(
        attempts=len(begun),
        retuned_at_s=retuned_at_s,
        roll_before_rad=before,
        roll_after_rad=after,
        roll_after_below_before=None if not before or after is None else 1 - after / before,
        found=found_by.found,
        truth=ShipInFigures(
            2 * math.pi / ship.natural_frequency_rad_s,
            ship.damping_nms_rad,
            scenario.vessel.tank.damping_ratio,
        ),
        state=RetuningState(int(state[-1])).name,
        reasons=tuple(
            reason
            for event in last
            if event.state is not RetuningState.TRIAL  # its text repeats `found`
            for reason in event.reasons
        ),
        events=tuple(event.as_json() for event in events),
    )


def _begins(event: RetuningEvent, before: RetuningEvent | None) -> bool:
    """Whether an event begins a retuning: a design that follows no identification."""
    if event.state is RetuningState.DESIGN:
        return before is None or before.state is not RetuningState.IDENTIFY
    return event.state is RetuningState.IDENTIFY


def events_on_ships_time(run: Run) -> tuple[RetuningEvent, ...]:
    """Events of a run on the time of its rows, to within one row.

    The controller has its own clock; the changes of state are known on both.
    """
    time_s, state = run.column("time_s"), run.column("retuning")
    shift_ns = round(run.end_s * 1e9) - run.retuning[-1].time_ns  # for events that no row shows
    for event in run.retuning:
        seen = time_s[state == event.state]
        if event.state is not RetuningState.IDLE and len(seen):
            shift_ns = round(float(seen[0]) * 1e9) - event.time_ns
            break
    return tuple(replace(event, time_ns=event.time_ns + shift_ns) for event in run.retuning)


def _spans(time_s: FloatArray, here: npt.NDArray[np.bool_]) -> list[tuple[float, float]]:
    """Begin and end of each unbroken stretch of rows for which `here` is true."""
    edges = np.flatnonzero(np.diff(np.concatenate(([0], here.astype(np.int8), [0]))))
    return [
        (float(time_s[start]), float(time_s[stop - 1]) + RECORD_S)
        for start, stop in edges.reshape(-1, 2)
    ]


def _rms(run: Run, start_s: float, end_s: float) -> float | None:
    roll_rad = run.column("true_roll_rad")[run.between(start_s, end_s)]
    return float(roll_rad.std()) if len(roll_rad) else None
