"""Events of retuning on the ship's time, in words and as JSON."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from firmware_sim.bench import BenchResult
from firmware_sim.figures import figures as bench_figures
from firmware_sim.run import COLUMNS, RECORD_S, Run
from firmware_sim.scenario import Scenario
from utank_hil.canbus import RetuningState
from utank_hil.canbus.events import ModelSummary, RetuningEvent
from utank_hil.configuration import load_config

ADAPTIVE = load_config(Path("configs/scenarios/adaptive.yaml"), Scenario)
IDLE, IDENTIFY, DESIGN, TRIAL, RETUNED, REFUSED, UNDONE = list(RetuningState)
FOUND = ModelSummary(7.6, 0.01, 1.9e9, 1.3e9, 4.9e7, 0.11, 0.99, 1.2, 0.2)
LATER = ModelSummary(7.4, 0.02, 1.8e9, 1.3e9, 4.7e7, 0.09, 0.99, 1.2, 0.2)
CLOCK_S = 123_456.0  #: Of the controller, when the ship's is at 0.

Step = tuple[float, RetuningState, float, tuple[str, ...], ModelSummary | None]
GOOD: tuple[Step, ...] = (
    (100.0, IDENTIFY, 0.03, ("ordered",), None),
    (200.0, DESIGN, 0.03, (), None),
    (210.0, TRIAL, 0.01, ("roll period 7.60 s",), FOUND),
    (300.0, RETUNED, 0.01, (), FOUND),
)


def voyage(*steps: Step, end_s: float = 400.0, name: str = "dpc") -> Run:
    """Roll of 0.02 rad, either sign in turn, and from each step on of the amplitude it gives."""
    time_s = np.arange(0.0, end_s, RECORD_S)
    rows = np.zeros((len(time_s), len(COLUMNS)))
    rows[:, 0] = time_s
    amplitude, state = np.full(len(time_s), 0.02), np.zeros(len(time_s))
    for begun_s, entered, roll_rad, _, _ in steps:
        amplitude[time_s >= begun_s], state[time_s >= begun_s] = roll_rad, entered
    rows[:, COLUMNS.index("true_roll_rad")] = amplitude * (-1.0) ** np.arange(len(time_s))
    rows[:, COLUMNS.index("retuning")] = state
    events = tuple(
        RetuningEvent(round((CLOCK_S + begun_s) * 1e9), entered, reasons, found)
        for begun_s, entered, _, reasons, found in steps
    )
    return Run(name, rows, 0.2, 0, 0.0, retuning=events)


def test_events_are_on_the_ships_time() -> None:
    waiting = (50.0, IDLE, 0.02, ("ordered: begins later",), None)
    for steps in (GOOD, (waiting, *GOOD)):
        told = voyage(*steps).events
        times_s = [event.time_ns * 1e-9 for event in told]
        assert times_s == pytest.approx([step[0] for step in steps], abs=RECORD_S)
        assert [event.reasons for event in told] == [step[3] for step in steps]
        # in simulated time both clocks are one
        one = replace(run := voyage(*steps), retuning=tuple(
            replace(event, time_ns=event.time_ns - round(CLOCK_S * 1e9)) for event in run.retuning
        ))  # fmt: skip
        assert one.events == one.retuning
    # an event that no row shows was one of the last
    (told_last,) = voyage((399.99, IDENTIFY, 0.02, (), None)).events
    assert told_last.time_ns * 1e-9 == pytest.approx(400.0)


def result_of(*runs: Run) -> BenchResult:
    return BenchResult(
        ADAPTIVE, "lockstep", 1, 400.0, 60.0, 400.0, np.full(8000, 0.03), runs, (), False, 1.0
    )


def test_events_are_said_and_in_the_json() -> None:
    refused = (
        GOOD[0],
        (205.0, REFUSED, 0.02, ("peak sensitivity [3] is too high",), None),
    )
    runs = voyage(name="passive"), voyage(*GOOD), voyage(*refused, name="gpc")
    found = bench_figures(result_of(*runs))
    assert found.retuned == (
        "dpc, 100 s: retuning IDENTIFY: ordered", "dpc, 200 s: retuning DESIGN",
        "dpc, 210 s: retuning TRIAL: roll period 7.60 s", "dpc, 300 s: retuning RETUNED",
        "gpc, 100 s: retuning IDENTIFY: ordered",
        "gpc, 205 s: retuning REFUSED: peak sensitivity [3] is too high",
    )  # fmt: skip
    told = json.loads(json.dumps(found.as_json({}, {}), allow_nan=False))["runs"]
    assert told[0]["retuning"] == []
    assert [event["state"] for event in told[1]["retuning"]] == [s[1].name for s in GOOD]
    assert told[1]["retuning"][2]["time_s"] == pytest.approx(210.0, abs=RECORD_S)
    assert told[1]["retuning"][3]["found"]["roll_period_s"] == 7.6
