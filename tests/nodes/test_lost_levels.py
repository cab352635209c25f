"""The level's rate is right whatever share of the tank's frames is lost, repeated or bad."""

import math
from itertools import count

import pytest
from controller_bench import CATALOGUE, MS, VESSEL, ControllerBench, ToyLaw
from values import changed

from utank_hil.base.tick import TICK_NS, TICK_S
from utank_hil.canbus import Frame, Quality, SensorPump, SensorTank, Switch

RATE_M_S = 0.5
FREQUENCY_RAD_S = 0.6


def worst_rate_error(change, quality):
    """Largest error of the rate, as a share of its amplitude, over the last half of 40 s."""
    bench = ControllerBench()
    numbers, ticks = count(), count()
    worst = 0.0
    bench.spoil = lambda kind, frame: (
        change(next(numbers), frame) if kind is SensorTank else (frame,)
    )
    for tick in ticks:
        time_s = tick * TICK_NS * 1e-9
        level_m = RATE_M_S / FREQUENCY_RAD_S * math.sin(FREQUENCY_RAD_S * time_s)
        bench.tank = SensorTank(-level_m, level_m, Switch.OFF, Switch.OFF, quality(tick))
        bench.tick()
        if time_s > 20:
            true_m_s = RATE_M_S * math.cos(FREQUENCY_RAD_S * time_s)
            worst = max(worst, abs(bench.level.rate_m_s - true_m_s))
        if time_s > 40:
            return worst / RATE_M_S
    raise AssertionError


def always_good(tick):
    return Quality.GOOD


@pytest.mark.evidence("2", "3", "5")
@pytest.mark.parametrize("one_of", [1, 2, 3, 4, 5, 10])
def test_lost_frames(one_of):
    error = worst_rate_error(lambda k, frame: () if k % one_of else (frame,), always_good)
    assert error < (0.1 if one_of <= 4 else 0.2)


@pytest.mark.parametrize("one_of", [2, 3, 4])
def test_gauges_that_send_more_slowly_than_their_cycle_with_a_counter_that_is_right(one_of):
    codec = CATALOGUE.codec(SensorTank)
    slow = CATALOGUE.transmitter(SensorTank)

    def thinned(k, frame):
        message = codec.decode(frame.data)
        assert message is not None
        return () if k % one_of else (slow.frame(message),)

    assert worst_rate_error(thinned, always_good) < 0.2


@pytest.mark.parametrize("bad_of", [2, 3])
def test_bad_quality(bad_of):
    error = worst_rate_error(
        lambda k, frame: (frame,), lambda tick: Quality.BAD if tick // 2 % bad_of else Quality.GOOD
    )
    assert error < 0.1


@pytest.mark.parametrize("late_of", [2, 3, 7])
def test_frames_that_come_a_tick_late_or_two_at_once(late_of):
    held: list[Frame] = []

    def change(number, frame):
        held.append(frame)
        if number % late_of == 1:
            return ()
        frames = held.copy()
        held.clear()
        return frames

    assert worst_rate_error(change, always_good) < 0.1


@pytest.mark.parametrize("missing", [1, 2, 45])
def test_in_a_gap_a_law_measures_the_level_that_is_predicted(missing):
    """The last one, held, looks like water that stands still: a plan then brakes what moves."""
    bench = ControllerBench(law=ToyLaw(sample_time_s=TICK_S))

    def swing():
        angle = FREQUENCY_RAD_S * bench.now_ns * 1e-9
        level_m = RATE_M_S / FREQUENCY_RAD_S * math.sin(angle)
        bench.tank = SensorTank(-level_m, level_m, Switch.OFF, Switch.OFF, Quality.GOOD)
        bench.tick()
        return level_m

    while bench.now_ns < 40e9:
        held_m = swing()
    bench.silent = {SensorTank}
    for _ in range(2 * missing):
        level_m = swing()
    measured_m = bench.law.seen[-1][1]
    # the first missing one may come a tick late, and is waited for
    expected_m = held_m if missing == 1 else level_m
    assert measured_m == pytest.approx(expected_m, abs=0.01 + 0.1 * abs(level_m - held_m))
    assert abs(level_m - held_m) > (0.2 if missing > 2 else 0.0)
    bench.silent = set()
    for _ in range(4):
        level_m = swing()
    assert bench.law.seen[-1][1] == pytest.approx(level_m, abs=0.02)


def test_no_level_is_predicted_from_a_pressure_that_was_measured_long_ago():
    bench = ControllerBench()
    bench.pump = SensorPump(20e3, 0.0, Quality.GOOD)
    bench.run(200)
    bench.silent = {SensorPump}
    bench.run(500)
    settled_m_s = bench.level.rate_m_s
    bench.silent = {SensorPump, SensorTank}
    bench.run(400)
    pushed_m_s = 20e3 * 0.4 / (VESSEL.tank.density_kg_m3 * VESSEL.tank.effective_length_m)
    assert bench.pressure_pa == 0
    assert abs(bench.level.rate_m_s - settled_m_s) < 0.1 * pushed_m_s


@pytest.mark.parametrize(("age_ns", "pressure_pa"), [(100_000_000, 7e3), (100_000_001, 0.0)])
def test_a_pressure_counts_for_a_tenth_of_a_second(age_ns, pressure_pa, monkeypatch):
    bench = ControllerBench()
    bench.run(200)
    predicted: list[float] = []
    monkeypatch.setattr(type(bench.level), "predict", lambda _, each: predicted.append(each))
    later_ns = bench.now_ns + 10**9
    bench.node._estimate_level(
        changed(bench.node.measured, now_ns=later_ns, pressure_pa=7e3, pump_age_ms=age_ns / MS)
    )
    assert predicted == [pressure_pa]


def test_a_level_that_is_only_just_due_is_not_missing_yet():
    """It comes every 20 ms, before the tick of its time."""
    bench = ControllerBench()
    bench.pump = bench.pump._replace(pressure_pa=20e3)
    bench.run(400)
    bench.silent.add(SensorTank)
    levels_m = [bench.level.level_m]
    for _ in range(2):
        bench.tick()
        levels_m.append(bench.level.level_m)
    assert levels_m[0] == levels_m[1] < levels_m[2]
