"""A sample that nothing on board can have moved to is discarded."""

import math
import struct
from dataclasses import replace
from itertools import pairwise

import pytest
from controller_bench import CATALOGUE, VESSEL
from hypothesis import given
from hypothesis import strategies as st

from utank_hil.canbus import Frame, Quality, SensorMotion, SensorTank, Switch
from utank_hil.canbus.frame import STANDARD
from utank_hil.canbus.profiles.device import ProfiledDevice
from utank_hil.configuration.devices import DevicesSection
from utank_hil.control import DesignPlant
from utank_hil.nodes.levels_heard import LevelsHeard
from utank_hil.nodes.plausibility import LevelGates, MotionSensor, SampleClock, SpikeGate
from utank_hil.safety.monitors.thresholds import SensorFigures, thresholds_of

MS, S = 1_000_000, 1_000_000_000
APART = replace(
    thresholds_of(DesignPlant(VESSEL.ship, VESSEL.tank), 0.35, SensorFigures()),
    roll_spike_rad=1.0, roll_most_rad_s=2.0,
    rate_spike_rad_s=4.0, rate_most_rad_s2=8.0,
    level_spike_m=16.0, level_most_m_s=32.0,
)  # fmt: skip


def sensor(thresholds=APART):
    receiver = CATALOGUE.receiver(SensorMotion)
    receiver.cycle_ns = 0  # time of receipt alone
    return MotionSensor(receiver, thresholds)


def taken(motion, roll_rad, rate_rad_s, now_ns):
    """Whether a sample is taken."""
    before = motion.discarded
    motion.take(SensorMotion(roll_rad, rate_rad_s, Quality.GOOD), now_ns)
    return motion.discarded == before


@pytest.mark.parametrize("way", [-1, 1])
def test_what_is_near_enough_grows_with_the_time_since_the_last_that_passed(way):
    for moved, after_s, passes in (
        (0.25, 0.0, True), (0.26, 0.0, False),
        (0.74, 1.0, True), (0.76, 1.0, False),
        (1.24, 2.0, True), (1.26, 2.0, False),
    ):  # fmt: skip
        gate = SpikeGate(0.25, 0.5)
        assert gate.passes(3.0 * way, 5 * S)
        assert not gate.passes(100.0, 5 * S)
        assert gate.passes((3.0 + moved) * way, 5 * S + round(after_s * S)) is passes
        # from what passed last, and its time
        last = 3.0 + moved if passes else 3.0
        since_s = 1.0 if passes else 1.0 + after_s
        at_ns = 5 * S + round((after_s + 1.0) * S)
        assert not gate.passes((last - 0.26 - 0.5 * since_s) * way, at_ns)
        assert gate.passes((last - 0.24 - 0.5 * since_s) * way, at_ns)


def test_each_step_has_to_come_five_times_in_a_row_to_be_taken():
    gate = SpikeGate(0.25, 0.0)
    assert gate.passes(0.0, 0)
    for _ in range(2):
        assert [gate.passes(9.0, 0) for _ in range(4)] == [False] * 4
        assert gate.passes(0.0, 0)
    assert [gate.passes(9.0, 0) for _ in range(5)] == [False] * 4 + [True]
    assert [gate.passes(0.0, 0) for _ in range(5)] == [False] * 4 + [True]


def test_roll_and_rate_each_have_their_own_bounds_and_both_see_every_sample():
    for roll_rad, rate_rad_s, after_ns, discarded in (
        (1.0, 4.0, 0, 0), (1.01, 4.0, 0, 1), (1.0, 4.01, 0, 1), (-1.01, -4.01, 0, 1),
        (2.9, 11.9, S, 0), (3.1, 11.9, S, 1), (2.9, 12.1, S, 1), (3.1, 12.1, S, 1),
    ):  # fmt: skip
        motion = sensor()
        assert taken(motion, 0.0, 0.0, 0)
        assert taken(motion, roll_rad, rate_rad_s, after_ns) is (discarded == 0)
        assert motion.discarded == motion.sample(0).discarded == discarded


def test_levels_each_have_a_gate_and_what_they_discard_is_counted():
    for port_m, starboard_m, after_ns, discarded in (
        (16.0, -16.0, 0, 0), (16.5, 0.0, 0, 1), (0.0, 16.5, 0, 1), (17.0, 17.0, 0, 1),
        (47.0, -47.0, S, 0), (49.0, 0.0, S, 1), (0.0, -49.0, S, 1), (49.0, 49.0, S, 1),
    ):  # fmt: skip
        gates = LevelGates(APART)
        assert gates.passes(0.0, 0.0, 0) is True
        assert gates.passes(port_m, starboard_m, after_ns) is (discarded == 0)
        assert gates.discarded == discarded


def test_one_spike_is_discarded_and_the_next_sample_is_taken():
    gate = SpikeGate(0.01, 0.5)
    assert gate.passes(0.1, 0)
    assert not gate.passes(0.6, 10 * MS)
    assert gate.passes(0.1, 20 * MS)


@given(st.floats(-1, 1), st.integers(1, 1000), st.floats(0, 1))
def test_what_moves_no_faster_than_it_can_always_passes(start, elapsed_ms, share):
    gate = SpikeGate(0.01, 0.5)
    gate.passes(start, 0)
    move = share * (0.01 + 0.5 * elapsed_ms * 1e-3) * 0.999
    assert gate.passes(start + move, elapsed_ms * MS)


class Slow:
    """A sensor of 20 Hz on a ship that rolls by 0.3 rad at 10 s; samples come in bursts."""

    def __init__(self, protection):
        layout = {"start": 0, "bits": 32, "real": True, "unit": "rad"}
        rate = {"start": 32, "bits": 32, "real": True, "unit": "rad/s"}
        signals = {"R": layout, "W": rate}
        more = {"n": {"id": 6, "bytes": 1, "signals": {"N": {"start": 0, "bits": 8}}}}
        section = {
            "profile": "", "messages": {"m": {"id": 5, "signals": signals}, **more},
            "signals": {"roll_rad": {"from": "m.R"}, "roll_rate_rad_s": {"from": "m.W"}},
            "cycle_ms": 50, "age_ms": 200, "accept_unprotected": True, "protection": protection,
        }  # fmt: skip
        plan = DevicesSection(motion=section).foreign().motions[0]
        assert plan is not None
        self.device = ProfiledDevice(plan)
        self.sensor = MotionSensor(
            self.device, thresholds_of(DesignPlant(VESSEL.ship, VESSEL.tank), 0.35, SensorFigures())
        )
        self.device.deliver = self.sensor.take

    def run(self, burst, spike=-1):
        for k in range(400):
            now_ns = -(-k // burst) * burst * 50 * MS
            turn = 2 * math.pi / 10 * 0.05 * k
            roll_rad = 0.3 * math.sin(turn) + 0.1 * (k == spike)
            words = struct.pack("<ff", roll_rad, 0.3 * 2 * math.pi / 10 * math.cos(turn))
            for can_id, data in ((6, bytes([k % 256])), (5, words)):
                frame = Frame(can_id | STANDARD, data)
                self.device.takers[frame.can_id].take(frame, now_ns)
        return self.sensor.discarded


@pytest.mark.parametrize("burst", [1, 2, 3])
def test_a_burst_of_a_slow_sensor_is_no_spike_where_its_stamp_moves_on(burst):
    stamped = {"stamps": [{"from": "n.N", "us": 50_000}]}
    assert Slow(stamped).run(burst) == 0
    assert Slow(stamped).run(burst, spike=200) == 1
    assert (Slow({"unchanged_ms": 500}).run(burst) > 0) is (burst > 1)  # nothing says it is new


def test_the_time_of_a_sample_is_its_receipt_or_what_its_counter_says():
    source = CATALOGUE.receiver(SensorTank)  # 20 ms
    clock = SampleClock(source)
    times = [clock.time_ns(now_ms * MS) // MS for now_ms in (1000, 1060, 1060, 1060, 1120)]
    assert [after - before for before, after in pairwise(times)] == [60, 20, 20, 60]
    source.lost += 2
    assert clock.time_ns(1120 * MS) // MS - times[-1] == 60


@pytest.mark.parametrize(("counts", "apart_ns"), [("values.N", 10 * MS), ("state.N", 0)])
def test_a_counter_dates_the_samples_of_its_own_message_alone(counts, apart_ns):
    number = {"start": 0, "bits": 4}
    signals = {"N": number, "A": {"start": 8, "bits": 16, "signed": True, "unit": "mrad"},
               "B": {"start": 8, "bits": 16, "signed": True, "unit": "mrad/s"}}  # fmt: skip
    messages = {"values": {"id": 1, "bytes": 3, "signals": signals},
                "state": {"id": 2, "bytes": 1, "signals": {"N": number}}}  # fmt: skip
    theirs = {
        "profile": "", "messages": messages, "cycle_ms": 10, "age_ms": 40,
        "signals": {"roll_rad": {"from": "values.A"}, "roll_rate_rad_s": {"from": "values.B"}},
        "protection": {"counters": [counts]}, "accept_unprotected": True,
    }  # fmt: skip
    plan = DevicesSection(motion=theirs).foreign().motions[0]
    clock = SampleClock(ProfiledDevice(plan))
    first_ns = clock.time_ns(5 * S)
    assert clock.time_ns(5 * S) - first_ns == apart_ns


@pytest.mark.parametrize(("thresholds", "kept_m", "discarded"), [(APART, 1.0, 1), (None, 32.0, 0)])
def test_levels_that_jump_are_discarded_where_there_are_thresholds(thresholds, kept_m, discarded):
    heard = LevelsHeard(CATALOGUE.receiver(SensorTank), 100.0, thresholds)
    for level_m in (1.0, 32.0):
        heard.take(SensorTank(level_m, -level_m, Switch.OFF, Switch.OFF, Quality.GOOD), S)
    assert (heard.port_m, heard.starboard_m, heard.discarded) == (kept_m, -kept_m, discarded)
