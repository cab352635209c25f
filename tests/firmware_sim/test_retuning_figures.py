"""Figures of retuning from runs whose roll is known: what is compared with what, and when."""

import json
import math
from pathlib import Path

import numpy as np
import pytest
from rich.console import Console

from firmware_sim.bench import BenchResult
from firmware_sim.figures import figures as bench_figures
from firmware_sim.report_tables import retuning_table
from firmware_sim.retuning_figures import RetuningFigures, events_on_ships_time, retuning_figures
from firmware_sim.run import COLUMNS, RECORD_S, Run
from firmware_sim.scenario import Scenario
from firmware_sim.voyage import Waypoint
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


def figures(run: Run, scenario: Scenario = ADAPTIVE, settle_s: float = 60.0) -> RetuningFigures:
    told = retuning_figures(run, scenario, settle_s)
    assert told is not None
    return told


def test_run_without_retuning_has_no_figures_of_it() -> None:
    assert retuning_figures(voyage(), ADAPTIVE, 60.0) is None


def test_roll_before_the_pulses_is_compared_with_roll_under_the_new_law() -> None:
    told = figures(voyage(*GOOD))
    assert (told.roll_before_rad, told.roll_after_rad) == pytest.approx((0.02, 0.01), rel=1e-12)
    assert told.roll_after_below_before == pytest.approx(0.5, rel=1e-12)
    assert told.retuned_at_s == pytest.approx(210.0)
    assert (told.attempts, told.state, told.found) == (1, "RETUNED", FOUND)
    assert told.reasons == ("ordered",)
    true = told.truth
    assert true.roll_period_s == pytest.approx(7.5, rel=1e-4)
    assert true.damping_nms_rad == ADAPTIVE.vessel.ship.damping_nms_rad
    assert true.tank_damping_ratio == ADAPTIVE.vessel.tank.damping_ratio


def test_law_that_was_taken_back_is_judged_while_it_was_in_charge() -> None:
    back = (280.0, UNDONE, 0.05, ("undone by the operator",), None)
    told = figures(voyage(*GOOD[:3], back))
    assert told.roll_after_rad == pytest.approx(0.01, rel=1e-12)
    assert (told.state, told.reasons) == ("UNDONE", ("ordered", "undone by the operator"))
    # taken back before the ship settled, there is nothing to judge it by
    told = figures(voyage(*GOOD[:3], (260.0, *back[1:])))
    assert (told.roll_after_rad, told.roll_after_below_before) == (None, None)


def test_pulses_of_a_later_attempt_do_not_count_and_its_reasons_do() -> None:
    again = (350.0, IDENTIFY, 0.09, ("on schedule",), None)
    refused = (370.0, REFUSED, 0.09, ("too short", "too long"), None)
    told = figures(voyage(*GOOD, again, refused))
    assert told.roll_after_rad == pytest.approx(0.01, rel=1e-12)
    assert (told.attempts, told.found) == (2, FOUND)
    assert told.reasons == ("on schedule", "too short", "too long")
    # the truth is that of when the law was made, not of the attempt that found nothing
    late = ADAPTIVE.model_copy(update={"actual_from_s": 340.0})
    configured_s = 2 * math.pi / ADAPTIVE.vessel.ship.natural_frequency_rad_s
    told = figures(voyage(*GOOD, again, refused), late)
    assert told.truth.roll_period_s == pytest.approx(configured_s)
    # and where a second law comes of it, that one counts
    trial = (370.0, TRIAL, 0.005, (), LATER)
    told = figures(voyage(*GOOD, again, trial, end_s=500.0))
    assert told.roll_after_rad == pytest.approx(0.005, rel=1e-12)
    assert told.retuned_at_s == pytest.approx(370.0)
    assert told.found == LATER


def test_renewal_without_pulses_is_an_attempt_of_its_own() -> None:
    renewal = (
        (100.0, DESIGN, 0.02, ("the waves are known now",), None),
        (110.0, TRIAL, 0.01, ("renewed for 3 m",), None),
        (200.0, RETUNED, 0.01, ("renewed for 3 m",), None),
        (300.0, DESIGN, 0.01, ("the waves differ",), None),
        (310.0, REFUSED, 0.01, ("no law has the margins",), None),
    )
    told = figures(voyage(*renewal))
    assert (told.attempts, told.retuned_at_s, told.found) == (2, pytest.approx(110.0), None)
    assert (told.roll_before_rad, told.roll_after_rad) == pytest.approx((0.02, 0.01), rel=1e-12)
    assert told.reasons == ("the waves differ", "no law has the margins")


def test_order_that_waits_is_told_and_is_no_attempt() -> None:
    told = figures(voyage((50.0, IDLE, 0.02, ("ordered: begins later",), None)))
    assert (told.attempts, told.state, told.roll_before_rad) == (0, "IDLE", None)
    assert told.reasons == ("ordered: begins later",)


def test_ship_that_changes_later_is_judged_after_that_and_is_the_truth_then() -> None:
    late = ADAPTIVE.model_copy(update={"actual_from_s": 90.0})
    run = voyage((85.0, IDLE, 0.04, (), None), *GOOD)
    assert figures(run, late).roll_before_rad == pytest.approx(0.04, rel=1e-12)
    later = ADAPTIVE.model_copy(update={"actual_from_s": 150.0})
    told = figures(voyage(*GOOD), later)
    assert told.roll_before_rad == pytest.approx(0.02, rel=1e-12)
    assert told.truth.roll_period_s == pytest.approx(
        2 * math.pi / ADAPTIVE.vessel.ship.natural_frequency_rad_s
    )


def test_ship_that_changes_under_way_is_judged_after_that_and_is_the_truth_then() -> None:
    """Half of the way to twice the stiffness by 90 s, and all of it at 180 s."""
    stiff = 2 * ADAPTIVE.vessel.ship.stiffness_nm_rad
    points = [
        Waypoint(time_s=90.0, ship={"stiffness_nm_rad": 0.75 * stiff}),
        Waypoint(time_s=180.0, ship={"stiffness_nm_rad": stiff}),
    ]
    changes = {"actual_ship": {}, "voyage": tuple(points)}
    run = voyage((80.0, IDLE, 0.04, (), None), *GOOD)
    told = figures(run, ADAPTIVE.model_copy(update=changes))
    assert told.roll_before_rad == pytest.approx(0.04, rel=1e-12)
    configured_s = 2 * math.pi / ADAPTIVE.vessel.ship.natural_frequency_rad_s
    share = 0.75 + 0.25 * (100.0 - 90.0) / 90.0
    assert told.truth.roll_period_s == pytest.approx(configured_s / math.sqrt(2 * share))


def test_events_are_on_the_ships_time() -> None:
    waiting = (50.0, IDLE, 0.02, ("ordered: begins later",), None)
    for steps in (GOOD, (waiting, *GOOD)):
        told = events_on_ships_time(voyage(*steps))
        times_s = [event.time_ns * 1e-9 for event in told]
        assert times_s == pytest.approx([step[0] for step in steps], abs=RECORD_S)
        assert [event.reasons for event in told] == [step[3] for step in steps]
    # an event that no row shows was one of the last
    (told_last,) = events_on_ships_time(voyage((399.99, IDENTIFY, 0.02, (), None)))
    assert told_last.time_ns * 1e-9 == pytest.approx(400.0)


def result_of(*runs: Run) -> BenchResult:
    return BenchResult(
        ADAPTIVE, "lockstep", 1, 400.0, 60.0, 400.0, np.full(8000, 0.03), runs, (), False, 1.0
    )


def test_table_says_what_was_found_beside_the_truth_and_the_json_the_same() -> None:
    refused = (
        GOOD[0],
        (200.0, DESIGN, 0.02, (), None),
        (205.0, REFUSED, 0.02, ("peak sensitivity [3] is too high",), None),
    )
    result = result_of(voyage(name="passive"), voyage(*GOOD), voyage(*refused, name="gpc"))
    table = retuning_table(bench_figures(result))
    dpc, gpc = zip(*(column.cells for column in table.columns), strict=True)
    assert dpc == (
        "dpc", "210", "1.15", "0.57", "50%", "7.600 ± 0.076 / 7.500", "49.00 / 48.19",
        "0.1100 / 0.1000", "RETUNED", "ordered",
    )  # fmt: skip
    assert gpc[:-1] == ("gpc", "", "1.15", "", "", "", "", "", "REFUSED")
    assert " ".join(gpc[-1].split()) == "ordered; peak sensitivity [3] is too high"
    console = Console(width=250)
    with console.capture() as capture:
        console.print(table)
    assert "sensitivity [3]" in capture.get()
    told = json.loads(json.dumps(bench_figures(result).as_json({}, {}), allow_nan=False))["runs"]
    assert told[0]["retuning"] is None
    retuning = told[1]["retuning"]
    assert retuning["found"]["roll_period_s"] == 7.6
    assert retuning["found"]["period_deviation"] == 0.01
    assert retuning["truth"]["damping_nms_rad"] == ADAPTIVE.vessel.ship.damping_nms_rad
    assert [event["state"] for event in retuning["events"]] == [s[1].name for s in GOOD]
    assert retuning["events"][2]["time_s"] == pytest.approx(210.0, abs=RECORD_S)
    assert told[2]["retuning"]["reasons"] == ["ordered", "peak sensitivity [3] is too high"]


def test_bench_without_retuning_has_no_table_of_it() -> None:
    assert not retuning_table(bench_figures(result_of(voyage(name="passive"), voyage()))).rows
