"""What is judged beside measurements: load, heel, lateness; and which motion sensor is used."""

import math
from dataclasses import replace

import pytest
from controller_bench import VESSEL, new_monitors
from hypothesis import given
from hypothesis import strategies as st
from situations import MEASURED, OWN
from values import changed

from utank_hil.base.tick import TICK_NS, TICK_S
from utank_hil.canbus.enumerations import AlarmState, Fault
from utank_hil.canbus.measurements import MotionSample
from utank_hil.control.interface import DesignPlant
from utank_hil.safety import judging
from utank_hil.safety.judge import HEEL_TIME_CONSTANT_S, QUIET_START_NS, Lateness, Safety
from utank_hil.safety.monitoring import Monitors
from utank_hil.safety.monitors.senders import BusLoad
from utank_hil.safety.monitors.thresholds import SensorFigures
from utank_hil.safety.safety_limits import SafetyLimits

MS = 1_000_000


@pytest.mark.parametrize("begins", range(0, 100, 7))
def test_load_of_the_bus_is_that_of_the_last_second_whenever_a_flood_begins(begins):
    load, frames, now_ns = BusLoad(250_000), 0, 0
    for _ in range(300 + begins):
        now_ns += TICK_NS
        assert load.update(now_ns, frames) == 0.0
    for tick in range(1, 201):
        now_ns += TICK_NS
        frames += 15  # 15 x 143 bits in 10 ms at 250 kbit/s: 0.858
        share = load.update(now_ns, frames)
        assert share <= 0.858 * min(tick + 1, 100) / 100 + 1e-9
        assert share >= 0.858 * min(tick - 9, 100) / 100 - 1e-9


def test_a_late_tick_counts_for_ten_ticks():
    lateness, now_ns = Lateness(), TICK_NS
    lateness.update(now_ns)
    now_ns += 2 * TICK_NS
    for _ in range(10):
        lateness.update(now_ns)
        assert lateness.in_ten == 1
        now_ns += TICK_NS
    lateness.update(now_ns)
    assert lateness.in_ten == 0


LATER_NS = [-MS, 0, 1, TICK_NS, TICK_NS + 1, 3 * TICK_NS, 9 * TICK_NS, 9 * TICK_NS + 1, 10**9]


@given(st.lists(st.sampled_from(LATER_NS), min_size=1, max_size=40))
def test_late_ticks_in_ten_are_the_grid_points_that_were_missed(later_ns):
    lateness, now_ns, missed = Lateness(), 7 * TICK_NS, [0] * 10
    lateness.update(now_ns)
    assert (lateness.late_ms, lateness.in_ten) == (0.0, 0)
    for late_ns in later_ns:
        now_ns += TICK_NS + late_ns
        lateness.update(now_ns)
        missed += [1] * math.ceil(late_ns / TICK_NS) or [0]
        assert lateness.in_ten == sum(missed[-10:])
        assert lateness.late_ms == max(late_ns, 0) / MS


class Table:
    """A safety without monitors, and one motion sensor."""

    def __init__(self):
        self.safety = Safety(SafetyLimits(), 250_000)
        self.now_ns = 0
        self.sample = MotionSample(heard_ns=-(1 << 62))

    @property
    def heel_rad(self):
        return self.safety.situation.heel_rad

    def tick(self):
        self.now_ns += TICK_NS
        age_ms = (self.now_ns - self.sample.heard_ns) / MS
        motions = (changed(self.sample, age_ms=age_ms),)
        self.safety.judge(changed(MEASURED, now_ns=self.now_ns, motions=motions), OWN)

    def measure(self, roll_rad, seconds=TICK_S):
        for _ in range(round(seconds / TICK_S)):
            self.sample = MotionSample(roll_rad, heard_ns=self.now_ns)
            self.tick()


@pytest.mark.parametrize("sign", [-1.0, 1.0])
def test_heel_is_the_low_pass_of_the_roll_over_a_minute_with_its_sign(sign):
    table = Table()
    table.measure(0.0, 60.0)
    table.measure(sign * 0.1, 60.0)
    assert HEEL_TIME_CONSTANT_S == 60.0
    assert table.heel_rad == pytest.approx(sign * 0.1 * (1 - math.exp(-1)), rel=1e-3)


def test_in_the_first_minute_heel_is_the_mean_of_what_was_measured_and_of_ten_seconds_of_zeros():
    table = Table()
    table.sample = MotionSample(0.3, heard_ns=-(1 << 62))  # nobody measured it
    table.tick()
    assert table.heel_rad == 0.0
    rolls = [0.3 + 0.2 * math.sin(0.005 * k) for k in range(round(50.0 / TICK_S) + 1)]
    for count, roll_rad in enumerate(rolls, 1):
        table.measure(roll_rad)
        mean_rad = sum(rolls[:count]) / (count + 10.0 / TICK_S - 1)
        assert table.heel_rad == pytest.approx(mean_rad, rel=1e-9)
    # and from then on each sample has the same share
    roll_rad = table.heel_rad + 1.0
    table.measure(roll_rad)
    assert roll_rad - table.heel_rad == pytest.approx(1.0 - TICK_S / 60.0)


def test_a_roll_that_is_not_measured_any_more_is_no_heel():
    table = Table()
    table.measure(0.0, 60.0)
    table.measure(0.2)
    for _ in range(8):
        table.tick()
    younger_rad = table.heel_rad
    table.tick()
    counted_rad = table.heel_rad
    assert counted_rad > younger_rad
    assert table.safety.situation.motion.age_ms == 100.0
    for _ in range(12_000):
        table.tick()
    assert table.heel_rad == counted_rad
    table.measure(0.0)
    assert table.heel_rad < counted_rad


@pytest.mark.parametrize(
    ("first_ms", "second_ms", "used"),
    [(25.0, 0.0, 0), (25.01, 0.0, 1), (26.0, 25.0, 1), (26.0, 26.0, 0), (1e9, 1e9, 0)],
)
def test_a_motion_sensor_that_is_silent_is_left_for_one_that_is_not(first_ms, second_ms, used):
    safety = Safety(SafetyLimits(), 250_000)
    motions = MotionSample(0.1, age_ms=first_ms), MotionSample(0.2, age_ms=second_ms)
    judgement = safety.judge(changed(MEASURED, motions=motions), OWN)
    assert judgement.motion == used
    assert safety.situation.motion.roll_rad == motions[used].roll_rad
    assert safety.situation.spare_age_ms == motions[1 - used].age_ms


def test_the_second_motion_sensor_is_left_for_the_first_one_that_is_back():
    safety, used = Safety(SafetyLimits(), 250_000), []
    for first_ms, second_ms in ((1e9, 0.0), (0.0, 0.0), (0.0, 1e9), (0.0, 0.0)):
        motions = MotionSample(0.1, age_ms=first_ms), MotionSample(0.2, age_ms=second_ms)
        used.append(safety.judge(changed(MEASURED, motions=motions), OWN).motion)
    assert used == [1, 1, 0, 0]


@pytest.mark.parametrize("used", [0, 1])
def test_each_of_two_motion_sensors_is_judged_by_its_own_age(used):
    """What was a fast one's silence is found as soon as without the slow one."""
    limits = SafetyLimits(motion_age_ms=40.0, motion_2_age_ms=150.0)
    allowed_ms = limits.motion_ages_ms
    for place, limit_ms in ((used, allowed_ms[used]), (1 - used, max(100, allowed_ms[1 - used]))):
        for age_ms, found in ((limit_ms, False), (math.nextafter(limit_ms, math.inf), True)):
            safety = Safety(limits, 250_000, unprotected=True)
            for ages_ms in ([1e9, 0.0] if used else [0.0, 1e9], [0.0, 0.0]):
                motions = tuple(MotionSample(age_ms=each) for each in ages_ms)
                safety.judge(changed(MEASURED, motions=motions), OWN)
            ages_ms = [1e9, 1e9] if place == used else [0.0, 0.0]
            ages_ms[place] = age_ms
            motions = tuple(MotionSample(age_ms=each) for each in ages_ms)
            judgement = safety.judge(changed(MEASURED, motions=motions), OWN)
            assert judgement.motion == used
            standing = judging.standing(safety.situation, limits)
            reacts = judging.RAMPING if place == used else judging.WARNING
            assert (Fault.MOTION_SILENT in judging.faults(standing & reacts)) is found
            if place != used:
                assert judgement.share == (0.5 if found else 1.0)


def test_the_judgement_bounds_the_pressure_by_what_is_in_doubt():
    """All of it; half, alone without protection; what she stands, by her monitors' thresholds."""
    motions = MotionSample(), MotionSample()
    of_one, of_two = changed(MEASURED, motions=motions[:1]), changed(MEASURED, motions=motions)
    bare, bought = (
        Safety(SafetyLimits(), 250_000),
        Safety(SafetyLimits(), 250_000, unprotected=True),
    )
    assert (bare.judge(of_one, OWN).share, bare.judge(of_two, OWN).share) == (1.0, 1.0)
    assert (bought.judge(of_one, OWN).share, bought.judge(of_two, OWN).share) == (0.5, 1.0)
    judgement = bought.judge(of_one, OWN)
    assert judgement.unconfirmed_share is None
    assert (judgement.mode, judgement.fault) == (bought.supervisor.mode, bought.supervisor.fault)
    assert bought.situation.spare_age_ms == 0.0
    for pump in (True, False):
        monitors = new_monitors()
        monitors.thresholds = replace(
            monitors.thresholds, degraded_share=0.125, unconfirmed_share=0.25
        )
        of = {} if pump else {"pump": False}
        safety = Safety(SafetyLimits(), 250_000, monitors, unprotected=True, **of)
        judgement = safety.judge(of_one, OWN)
        assert judgement.share == 0.125
        assert judgement.unconfirmed_share == (0.25 if pump else None)
        assert judgement.passive_roll_rad == monitors.twin.roll_rad


def test_unprotected_motion_is_trusted_beside_a_second_sensor_that_agrees_and_is_heard():
    limit_ms = SafetyLimits().motion_spare_age_ms
    for age_ms, share in ((limit_ms, 1.0), (math.nextafter(limit_ms, math.inf), 0.5)):
        safety = Safety(SafetyLimits(), 250_000, unprotected=True)
        motions = MotionSample(), MotionSample(age_ms=age_ms)
        assert safety.judge(changed(MEASURED, motions=motions), OWN).share == share
    for unprotected, share in ((False, 1.0), (True, 0.5)):
        monitors = Monitors(
            DesignPlant(VESSEL.ship, VESSEL.tank), 0.35, SensorFigures(), 250_000,
            second_motion=True,
        )  # fmt: skip
        safety = Safety(SafetyLimits(), 250_000, monitors, unprotected=unprotected)
        shares = []
        for tick in range(100):
            now_ns = tick * TICK_NS
            motions = MotionSample(heard_ns=now_ns), MotionSample(0.05, heard_ns=now_ns)
            seen = changed(MEASURED, now_ns=now_ns, motions=motions)
            shares.append(safety.judge(seen, OWN).share)
        assert (shares[0], shares[-1]) == (1.0, share)


def test_the_bus_carries_what_was_heard_and_what_was_sent():
    safety = Safety(SafetyLimits(), 250_000)
    for tick in range(1, 203):
        seen = changed(MEASURED, now_ns=tick * TICK_NS, frames=5 * tick)
        safety.judge(seen, changed(OWN, frames_sent=2 * tick))
    assert safety.situation.bus_load == pytest.approx(700 * 143 / 250_000)


def test_without_monitors_nothing_is_found_and_the_timers_run_all_the_same():
    safety, since_ms = Safety(SafetyLimits(), 250_000), []
    for tick, roll_rad in enumerate((0.0, 0.4, -0.4, 0.3, 0.3)):
        motions = (MotionSample(roll_rad),)
        safety.judge(changed(MEASURED, now_ns=tick * TICK_NS, motions=motions), OWN)
        since_ms.append(safety.situation.rolled_over_ms)
    assert since_ms[1:] == [0.0, 0.0, 10.0, 20.0]
    assert since_ms[0] > 1e9
    assert safety.situation.found == 0


def test_what_the_twin_says_is_unknown_without_monitors():
    bare = Safety(SafetyLimits(), 250_000)
    rolls = bare.passive_roll_rad, bare.passive_roll_rms_rad, bare.roll_rms_rad
    assert all(map(math.isnan, rolls))
    monitors = new_monitors()
    safety = Safety(SafetyLimits(), 250_000, monitors)
    monitors.twin.update(0.1, 0.0, 0.0, 5e4)
    monitors.twin.update(0.1, 0.0, 0.0, 5e4)
    twin = monitors.twin
    assert safety.passive_roll_rad == twin.roll_rad != 0.0
    assert safety.passive_roll_rms_rad == twin.rms_rad > 0.0
    assert safety.roll_rms_rad == twin.ship_rms_rad != twin.rms_rad


def test_each_error_of_a_device_is_told_once_while_the_alarm_lasts():
    safety, now_ns, told = Safety(SafetyLimits(), 250_000), QUIET_START_NS, []
    safety.update_alarms([], 0)
    for seconds, errors in (
        (0, ["a"]), (1, ["a", "b"]), (2, ["b"]), (3, []), (4, ["a"]), (5, ["c"]),
        *((6 + n, [f"{n}"]) for n in range(7)), (15, []), (26, []), (27, ["a"]),
    ):  # fmt: skip
        now_ns = QUIET_START_NS + seconds * 10**9
        seen = changed(MEASURED, now_ns=now_ns, device_error=bool(errors))
        safety.judge(seen, OWN)
        events = safety.update_alarms([], now_ns, errors)
        raised = Fault.DEVICE_ERROR, AlarmState.ACTIVE_UNACKNOWLEDGED
        told += [seconds for each in events if (each.code, each.state) == raised]
    # eight, a flood of them is not; and once more after the alarm's cause had gone
    assert told == [0, 1, 5, 6, 7, 8, 9, 10, 27]


def test_what_is_awaited_at_the_start_is_told_after_ten_seconds():
    safety, started_ns = Safety(SafetyLimits(), 250_000), 3 * 10**9
    safety.judge(changed(MEASURED, now_ns=started_ns, tank_age_ms=1e6), OWN)
    for since_ns in (0, QUIET_START_NS - 1):
        assert safety.update_alarms([], started_ns + since_ns) == []
    told = safety.update_alarms([], started_ns + QUIET_START_NS)
    assert [event.code for event in told] == [Fault.TANK_SILENT]
    assert Safety(SafetyLimits(), 250_000).update_alarms([], 10**12) == []
