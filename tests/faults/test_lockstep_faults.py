"""The invariants of docs/safety.md, with the whole bench on a simulated bus."""

from functools import cache
from itertools import pairwise

import pytest
from fault_bench import (
    ARMED,
    MS,
    SECOND,
    Babbler,
    FaultBench,
    corrupted,
    doubled,
    dropped,
    frozen,
    storm,
)
from hypothesis import given, settings
from hypothesis import strategies as st

from utank_hil.canbus import (
    DriveState,
    Fault,
    Mode,
    PumpCommand,
    SensorTank,
)
from utank_hil.nodes.panel import Action, TimedAction

T0 = 6 * SECOND
TICK = 10 * MS
TIMEOUT = 50 * MS
WIRE = 2 * MS  # a frame waits for at most a few others
CYCLE = 20 * MS
LIMITS = storm().controllers["gpc"].limits


def armed_bench(**options):
    bench = FaultBench(**options)
    bench.run(T0 / SECOND)
    assert bench.mode is Mode.ACTIVE
    assert max(abs(command.pressure_pa) for _, command in bench.commands(4 * SECOND)) > 3e3
    return bench


def rate_limit_holds(bench):
    """Every step between two commands is a permitted one for its time, or ends at zero."""
    rate_pa_s = bench.config.limits.rate_pa_s
    return all(
        after.pressure_pa == 0.0
        or abs(after.pressure_pa - before.pressure_pa)
        <= rate_pa_s * (later - earlier + WIRE) / SECOND + 8.0
        for (earlier, before), (later, after) in pairwise(bench.heard.commands)
    )


def stays_at_zero_though_the_panel_keeps_its_arm_bit(bench, since_ns):
    assert bench.heard.orders[-1][1].arm
    return all(command.pressure_pa == 0.0 for _, command in bench.commands(since_ns))


@pytest.mark.parametrize("pause_ms", [80, 200, 2000])
def test_controller_that_hangs_and_goes_on_finds_itself_disarmed(pause_ms):
    bench = armed_bench()
    bench.controller.begin_ns = T0
    bench.controller.end_ns = T0 + pause_ms * MS
    bench.controller.hangs = True
    bench.run(12)
    assert bench.mode is Mode.FAULT
    assert stays_at_zero_though_the_panel_keeps_its_arm_bit(bench, bench.controller.end_ns + TICK)


def test_restarted_controller_is_in_standby_and_never_arms_by_itself():
    bench = armed_bench()
    bench.controller.begin_ns, bench.controller.end_ns = T0, T0 + 2 * SECOND
    bench.controller.hangs = True
    bench.controller.restarted = bench.restarted_controller
    bench.run(20)
    assert bench.mode is Mode.STANDBY
    assert stays_at_zero_though_the_panel_keeps_its_arm_bit(bench, T0 + SECOND)
    # nor does the drive
    assert {state for t, state in bench.heard.states if t > T0 + SECOND} == {DriveState.FAULT}


def test_reset_and_a_new_press_of_arm_bring_it_back():
    script = (
        *ARMED,
        TimedAction(8.0, Action.DISARM),
        TimedAction(8.5, Action.RESET),
        TimedAction(10.0, Action.ARM),
    )
    bench = armed_bench(script=script)
    bench.sensors.begin_ns, bench.sensors.end_ns = T0, T0 + SECOND
    bench.sensors.spoil = dropped()
    bench.run(9.9)
    assert bench.mode is not Mode.ACTIVE
    bench.run(20)
    assert bench.mode is Mode.ACTIVE
    assert any(command.pressure_pa != 0.0 for _, command in bench.commands(11 * SECOND))
    assert bench.ship.drive.refused == 0


R_MOTION = 250 * MS  # from the last good sample
P_CLASS = 250 * MS  # from the fault

# the rows of the campaign have each fault that lasts; here it ends, and nothing comes of that
FAULTS = [
    # node, what happens to it, where it ends, by when
    ("sensors", {"spoil": dropped()}, Fault.MOTION_SILENT, R_MOTION),
    ("sensors", {"delay_ticks": 5}, Fault.MOTION_SILENT, R_MOTION),
    ("sensors", {"spoil": corrupted(SensorTank)}, Fault.PROTECTION, 1100 * MS),
    ("drive", {"hangs": True}, Fault.DRIVE_SILENT, P_CLASS),
    ("controller", {"spoil": dropped(PumpCommand)}, Fault.DRIVE_FAULT, P_CLASS),
    ("controller", {"spoil": frozen(PumpCommand)}, Fault.DRIVE_FAULT, P_CLASS),
    ("panel", {"hangs": True}, Fault.OPERATOR_SILENT, 6220 * MS),
]


@pytest.mark.slow
@pytest.mark.parametrize(
    ("victim", "failure", "fault", "within_ns"),
    FAULTS,
    ids=lambda value: value if isinstance(value, str) else getattr(value, "name", None),
)
def test_fault_of_one_node_ends_at_zero_in_time_and_stays_there(victim, failure, fault, within_ns):
    bench = armed_bench()
    node = getattr(bench, victim)
    for name, value in failure.items():
        setattr(node, name, value)
    node.begin_ns = T0
    end_ns = T0 + within_ns + SECOND
    bench.run(end_ns / SECOND)
    assert (bench.mode, bench.node.fault) == (Mode.FAULT, fault)
    # what is on the bus, or if that is what fails, what the drive does
    if failure.get("spoil") is not None and victim == "controller":
        assert bench.left_enabled_ns(T0) - T0 <= TIMEOUT + TICK + CYCLE
    else:
        assert bench.zero_ns(T0) - T0 <= within_ns + CYCLE
    assert rate_limit_holds(bench)
    node.end_ns = end_ns  # all is well again, and nothing comes of it
    bench.run(end_ns / SECOND + 4)
    assert bench.mode is Mode.FAULT
    assert stays_at_zero_though_the_panel_keeps_its_arm_bit(bench, end_ns)
    assert bench.heard.states[-1][1] is not DriveState.OPERATION_ENABLED


@pytest.mark.slow
@pytest.mark.parametrize("victim", ["sensors", "drive", "controller", "panel"])
def test_two_lost_ticks_do_not_disarm(victim):
    bench = armed_bench()
    node = getattr(bench, victim)
    node.spoil = dropped()
    node.begin_ns, node.end_ns = T0, T0 + 2 * node.period_ns
    bench.run(8)
    assert bench.mode is Mode.ACTIVE
    assert bench.ship.drive.refused == 0
    assert rate_limit_holds(bench)


@cache
def roll_without_a_fault_rad():
    bench = armed_bench()
    bench.run(8)
    return bench.ship.plant.roll_rad


@pytest.mark.slow
@pytest.mark.parametrize("victim", ["sensors", "drive", "controller", "panel"])
def test_frames_sent_twice_are_taken_once(victim):
    """The second of each is refused as a repetition; what the first said stands.

    It lasts so short that nobody takes them for a second sender's.
    """
    twice = armed_bench()
    node = getattr(twice, victim)
    node.spoil, node.begin_ns, node.end_ns = doubled, T0, T0 + 80 * MS
    twice.run(8)
    assert twice.mode is Mode.ACTIVE
    assert twice.ship.plant.roll_rad == pytest.approx(roll_without_a_fault_rad(), abs=1e-4)


def test_flood_of_the_bus_ends_at_zero_whoever_notices_first():
    """Frames of the highest priority starve all others: nobody hears anybody."""
    bench = armed_bench(extra=[Babbler(0, 2, T0, T0 + 2 * SECOND)])
    bench.run(7)
    assert bench.mode is Mode.FAULT
    assert not bench.commands(T0 + CYCLE)
    assert abs(bench.ship.plant.pressure_pa) < 5e3  # of the coasting rotor
    bench.run(10)
    assert {state for t, state in bench.heard.states if t > 9 * SECOND} == {DriveState.FAULT}
    # what had waited in the queues came late; it found the drive tripped
    assert stays_at_zero_though_the_panel_keeps_its_arm_bit(bench, 9 * SECOND)


@pytest.mark.evidence
@settings(max_examples=4)
@given(seed=st.integers(0, 2**31), controller=st.sampled_from(sorted(storm().controllers)))
def test_drive_never_refuses_a_frame_of_a_fault_free_run(seed, controller):
    bench = FaultBench(seed=seed, controller=controller)
    bench.run(15)
    assert bench.mode is Mode.ACTIVE
    assert bench.ship.drive.refused == 0
    assert rate_limit_holds(bench)
    assert max(abs(c.pressure_pa) for _, c in bench.heard.commands) <= LIMITS.pressure_pa
