"""A campaign stops where its interval is narrow, the same in whatever order cases come back."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from firmware_sim.campaign.stopping import Stopping, enough, figures_of
from firmware_sim.campaign.study import Stop

STOP = Stop(metric="roll_rms_rad", half_width=0.2, least=4)
VALUES = np.random.default_rng(4).normal(2.0, 0.5, 80)


def cases(count):
    return {("a",): [f"c{k}" for k in range(count)]}


def row(k, value):
    return {"case": f"c{k}", "run": "gpc", "mark": "", "roll_rms_rad": value}


@settings(max_examples=20)
@given(st.permutations(range(80)))
def test_order_in_which_cases_come_back_changes_nothing(order):
    stopping = Stopping(STOP, cases(80))
    for k in order:
        stopping.add([row(k, VALUES[k])])
    first = next(n for n in range(4, 81) if enough(STOP, [{"gpc": v} for v in VALUES[:n]]))
    assert list(stopping.used(("a",))) == [f"c{k}" for k in range(first)]
    assert not stopping.needs("c79")


def test_interval_is_student_s():
    # ten values of standard deviation one: half width t(9) / sqrt(10) = 2.2622 / 3.1623
    values = np.sqrt(0.9) * np.array([1.0, -1.0] * 5)
    assert enough(Stop(metric="strikes", half_width=0.716, least=3), [{"x": v} for v in values])
    assert not enough(Stop(metric="strikes", half_width=0.715, least=3), [{"x": v} for v in values])
    relative = Stop(metric="strikes", relative=0.0716, least=3)
    assert enough(relative, [{"x": 10 + v} for v in values])
    assert not enough(relative, [{"x": 9.9 + v} for v in values])


def test_every_run_must_be_known_and_a_failed_case_counts_for_none():
    wide = [{"gpc": 1.0, "dpc": v} for v in VALUES[:12]]
    assert not enough(Stop(metric="roll_rms_rad", half_width=1e-3, least=4), wide)
    assert not enough(STOP, [{}] * 20)
    assert not enough(STOP, [{"gpc": 1.0}] * 3 + [{}] * 9)


def test_marked_runs_the_bare_ship_and_missing_figures_do_not_count():
    rows = [
        {"run": "no tank", "mark": "", "roll_rms_rad": 1.0},
        {"run": "gpc", "mark": "capsized", "roll_rms_rad": 1.0},
        {"run": "dpc", "mark": "", "roll_rms_rad": math.nan},
        {"run": "lqg", "mark": "", "roll_rms_rad": 0.5},
        {"run": "", "mark": "", "roll_rms_rad": None},
    ]
    assert figures_of(rows, "roll_rms_rad") == {"lqg": 0.5}


def test_without_a_stop_all_cases_are_needed():
    stopping = Stopping(None, cases(3))
    stopping.add([row(k, 1.0) for k in range(3)])
    assert list(stopping.used(("a",))) == ["c0", "c1", "c2"]
    assert all(map(stopping.needs, ["c0", "c1", "c2"]))


def test_stop_s_half_width_has_its_unit():
    with pytest.raises(ValueError, match="half_width"):
        Stop(metric="roll_rms_rad", half_width=-1.0)
