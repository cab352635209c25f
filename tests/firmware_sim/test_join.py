"""Halves of a run on a bus, each written by a process of its own, side by side again."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from firmware_sim.run import COLUMNS, RECORD_S, ControllerRun, Run, ShipRun, join
from firmware_sim.truth import TRUTH
from utank_hil.nodes.signals import SIGNALS

START_NS = 5_000_000_000


def joined(ship_s: np.ndarray, told_s: np.ndarray, shift_s: float) -> Run:
    """Rows at the times of each side's own clock; each shows the ship's time in one column."""
    truth, told = np.zeros((len(ship_s), len(TRUTH))), np.zeros((len(told_s), len(SIGNALS)))
    truth[:, 0] = truth[:, TRUTH.index("true_roll_rad")] = ship_s
    told[:, 0] = told_s
    told[:, SIGNALS.index("roll_rad")] = told_s + shift_s
    ship = ShipRun(truth, START_NS, (3, 7.0, 0, np.inf, 0.0, 0.0))
    controller = ControllerRun(told, START_NS + round(shift_s * 1e9), None)
    return join("test", ship, controller)


def without(times_s: np.ndarray, gaps: list[tuple[int, int]]) -> np.ndarray:
    kept = np.ones(len(times_s), dtype=bool)
    for first, length in gaps:
        kept[first : first + length] = False
    return times_s[kept]


GAPS = st.lists(st.tuples(st.integers(0, 1199), st.integers(1, 60)), max_size=6)


@given(shift_s=st.floats(-20.0, 20.0), ship_gaps=GAPS, told_gaps=GAPS)
def test_rows_are_on_the_ships_time_whatever_either_side_leaves_out(
    shift_s: float, ship_gaps: list[tuple[int, int]], told_gaps: list[tuple[int, int]]
) -> None:
    grid_s = RECORD_S * np.arange(1200)
    ship_s, told_s = without(grid_s, ship_gaps), without(grid_s + 0.01, told_gaps)
    run = joined(ship_s, told_s, shift_s)
    assert run.rows.shape == (len(run.rows), len(COLUMNS))
    # the truth is the ship's, unmoved
    assert set(run.column("time_s")) <= set(ship_s)
    assert np.array_equal(run.column("true_roll_rad"), run.column("time_s"))
    # what the controller said stands beside it, and nothing that it said long before or after
    distance_s = np.abs(run.column("roll_rad") - run.column("time_s"))
    assert (distance_s <= RECORD_S + 1e-9).all()
    heard_s = told_s + round(shift_s * 1e9) / 1e9
    for when_s, apart_s in zip(run.column("time_s"), distance_s, strict=True):
        assert apart_s == pytest.approx(np.abs(heard_s - when_s).min(), abs=1e-6)
    # and only those rows are missing that have no word of the controller near
    missing = np.setdiff1d(ship_s, run.column("time_s"))
    if len(heard_s):
        nearest_s = np.abs(heard_s[:, None] - missing).min(axis=0)
        assert (nearest_s > RECORD_S - 1e-9).all()


def test_a_complete_run_loses_no_row_but_those_before_the_controller_came() -> None:
    grid_s = RECORD_S * np.arange(400)
    run = joined(grid_s, grid_s[:-40], 2.0)
    assert np.array_equal(run.column("time_s"), grid_s[39:])
    assert run.end_s == pytest.approx(20.0)
    assert (run.refused_commands, run.energy_j) == (3, 7.0)
    assert run.between(5.0, 15.0).sum() == 200


@pytest.mark.parametrize("shift_s", [-80.0, 80.0])
def test_halves_that_never_met_have_no_rows(shift_s: float) -> None:
    grid_s = RECORD_S * np.arange(1000)
    assert len(joined(grid_s, grid_s, shift_s).rows) == 0


def test_a_side_without_rows_leaves_none() -> None:
    grid_s, none = RECORD_S * np.arange(100), np.empty(0)
    for run in (joined(none, grid_s, 0.0), joined(grid_s, none, 0.0)):
        assert len(run.rows) == 0
        assert run.end_s == 0.0
