"""A law that plans: what of the pressure it may use, from the start and after a gap."""

import math
from itertools import pairwise

import pytest
from controller_bench import ControllerBench, PlanningLaw, new_monitors

from utank_hil.canbus import Mode, SensorMotion, SensorPump, SensorTank

START_NS = 7_000_000_123
FIRST = 0.25
"""Share of the pressure that may be used before the water is seen to respond."""


def watching():
    monitors = new_monitors()
    assert monitors.thresholds.unconfirmed_share == FIRST
    return monitors


def test_a_law_that_plans_is_told_what_it_may_use():
    law = PlanningLaw()
    bench = ControllerBench(START_NS, law=law)
    bench.silent = {SensorMotion}
    bench.run(600)
    assert set(law.allowed) == {0.0}
    bench.silent.clear()
    law.allowed.clear()
    bench.arm()
    bench.run(600)
    assert set(law.allowed) == {1.0}
    bench.silent.add(SensorPump)
    bench.run(600)
    assert law.allowed[-1] == 0.5
    bench.silent.clear()
    bench.run(600)
    assert law.allowed[-1] == 1.0


def test_a_law_that_plans_may_use_as_much_as_it_has_watched_of_four_roll_periods():
    monitors = watching()
    law = PlanningLaw()
    bench = ControllerBench(START_NS, law=law, monitors=monitors)
    samples = round(4 * monitors.thresholds.tank_period_s / law.sample_time_s)
    sample_ms = round(1e3 * law.sample_time_s)
    bench.silent.update((SensorMotion, SensorTank))
    bench.run(20 * sample_ms)
    assert set(law.allowed) == {FIRST}  # what it was given is no measurement
    bench.silent.clear()
    bench.run(samples // 2 * sample_ms)
    assert law.allowed[-1] == pytest.approx(0.5, abs=2 / samples)
    half = law.allowed[-1]
    law.calls.clear()
    bench.silent.add(SensorTank)
    bench.run(900)  # a gap in which the law would stay in charge
    bench.silent.clear()
    bench.run(sample_ms)
    assert law.allowed[-1] > half
    assert "reset" not in law.calls
    bench.run((samples + 8) // 2 * sample_ms)
    assert law.allowed[-1] == 1.0
    assert all(after >= before for before, after in pairwise(law.allowed))


@pytest.mark.parametrize(
    ("silent", "longest_ms"), [(SensorMotion, 40), (SensorTank, 1000)], ids=["motion", "levels"]
)
def test_after_a_gap_a_law_that_plans_begins_anew(silent, longest_ms):
    monitors = watching()
    law = PlanningLaw()
    bench = ControllerBench(START_NS, law=law, monitors=monitors)
    bench.run(50_000)
    assert law.allowed[-1] == 1.0
    law.calls.clear()
    bench.silent.add(silent)
    bench.run(longest_ms - 20)
    assert "reset" not in law.calls
    bench.run(20 + 2e3 * law.sample_time_s)
    assert law.calls[-3:] == ["reset", "applied", "step"]
    assert law.allowed[-1] == FIRST
    bench.silent.clear()
    law.calls.clear()
    bench.run(10 * 1e3 * law.sample_time_s)
    assert law.calls.count("reset") <= 1  # at the sample before the measurement is back
    assert law.allowed[-1] == FIRST
    bench.run(15_000)
    assert FIRST < law.allowed[-1] < 0.45


def test_a_law_that_plans_begins_anew_after_an_answer_that_is_none():
    monitors = watching()
    law = PlanningLaw()
    bench = ControllerBench(START_NS, law=law, monitors=monitors)
    bench.run(50_000)
    law.answer_pa = math.nan
    bench.run(2e3 * law.sample_time_s)
    law.answer_pa = 0.0
    bench.run(1e3 * law.sample_time_s)
    assert law.allowed[-1] == FIRST


def test_the_panel_sees_that_a_plan_has_less_pressure_yet(monkeypatch):
    monitors = watching()
    monkeypatch.setattr(monitors, "confirmed", True)
    bench = ControllerBench(START_NS, law=PlanningLaw(), monitors=monitors)
    bench.arm()
    bench.run(300)
    assert bench.status.degraded
    bench.run(50_000)
    assert bench.node.mode is Mode.ACTIVE
    assert not bench.status.degraded
