from itertools import product

import pytest
from situations import look, situation

from utank_hil.base.tick import TICK_NS
from utank_hil.canbus.enumerations import Fault, Mode
from utank_hil.safety import judging
from utank_hil.safety.faults import FAULTS, Reaction
from utank_hil.safety.monitors.finding import Finding
from utank_hil.safety.safety_limits import SafetyLimits
from utank_hil.safety.situation import MILLISECOND_NS, Demand, OwnState
from utank_hil.safety.supervisor import Supervisor


class Bench:
    """A supervisor with its own clock."""

    def __init__(self):
        self.supervisor = Supervisor(SafetyLimits())
        self.now_ns = 0

    def tick(self, **changes):
        look(self.supervisor, self.now_ns, **changes)
        self.now_ns += TICK_NS
        return self.supervisor


def armed_bench():
    bench = Bench()
    bench.tick()
    bench.tick(requested_mode=Mode.ACTIVE, armed=True, arm_edge=True)
    bench.tick(requested_mode=Mode.ACTIVE, armed=True, drive_enabled=True)
    assert bench.supervisor.mode is Mode.ACTIVE
    return bench


STALE_MS = SafetyLimits().motion_age_ms + 10
ACTIVE = {"requested_mode": Mode.ACTIVE, "armed": True, "drive_enabled": True}
ARMING = {**ACTIVE, "arm_edge": True, "drive_enabled": False}
# what each fault looks like, all else being well
SIGNS: list[tuple[Fault, Reaction, dict[str, object]]] = [
    (Fault.MOTION_SILENT, Reaction.RAMP, {"motion_age_ms": STALE_MS}),
    (Fault.TANK_SILENT, Reaction.RAMP, {"tank_age_ms": 1100}),
    (Fault.PUMP_SENSOR_SILENT, Reaction.RAMP, {"pump_age_ms": 1100}),
    (Fault.PROTECTION, Reaction.RAMP, {"protection_valid": False}),
    (Fault.PROTECTION, Reaction.RAMP, {"found": Finding.DAMAGED}),
    (Fault.FOREIGN_SENDER, Reaction.STOP, {"claimed_twice": True}),
    (Fault.DRIVE_SILENT, Reaction.STOP, {"drive_age_ms": 70}),
    (Fault.DRIVE_SILENT, Reaction.STOP, {"echo_age_ms": 110}),
    (Fault.DRIVE_FAULT, Reaction.STOP, {"drive_fault": True}),
    (Fault.DRIVE_FAULT, Reaction.STOP, {"drive_stays_on": True}),
    (Fault.VALVE_SILENT, Reaction.STOP, {"valve_age_ms": 70}),
    (Fault.VALVE_SILENT, Reaction.STOP, {"valve_echo_age_ms": 110}),
    (Fault.VALVE_FAULT, Reaction.STOP, {"valve_fault": True}),
    (Fault.VALVE_FAULT, Reaction.STOP, {"valve_out_ms": 110}),
    (Fault.VALVE_NOT_FOLLOWING, Reaction.STOP, {"valve_off_ms": 310}),
    (Fault.BUS_LOST, Reaction.STOP, {"link_lost": True}),
    (Fault.ADDRESS_CONFLICT, Reaction.STOP, {"address_conflict": True}),
    (Fault.BUS_OVERLOAD, Reaction.STOP, {"bus_load": 0.9}),
    (Fault.LEVEL_LIMIT, Reaction.STOP, {"high_level": True}),
    (Fault.INTERNAL, Reaction.STOP, {"law_failed": True}),
    (Fault.HEEL_LIMIT, Reaction.RAMP, {"roll_rad": -0.4}),
    (Fault.HEEL_LIMIT, Reaction.RAMP, {"roll_rad": 0.4}),
    (Fault.HEEL_LIMIT, Reaction.RAMP, {"heel_rad": 0.2}),
    (Fault.HEEL_LIMIT, Reaction.RAMP, {"heel_rad": -0.2}),
    (Fault.OPERATOR_SILENT, Reaction.RAMP, {"panel_age_ms": 6000}),
    (Fault.OVERRUN, Reaction.STOP, {"tick_late_ms": 50}),  # in whole ticks: up to 60
    (Fault.OVERRUN, Reaction.RAMP, {"overruns_in_ten": 3}),
    (Fault.VERSION_MISMATCH, Reaction.STOP, {"versions_match": False}),
    (Fault.VERSION_MISMATCH, Reaction.RAMP, {"panel_matches": False}),
    (Fault.SIGN_FLIP, Reaction.STOP, {"found": Finding.PUMP_SIGN}),
    (Fault.MOTION_SIGN_FLIP, Reaction.STOP, {"found": Finding.WATER_SIGN}),
    (Fault.FOREIGN_SENDER, Reaction.STOP, {"found": Finding.SECOND_SENDER}),
    (Fault.UNKNOWN_IDENTIFIERS, Reaction.STOP, {"found": Finding.FLOOD}),
    (Fault.DRIVE_NOT_FOLLOWING, Reaction.STOP, {"found": Finding.DRIVE_LOST}),
    (Fault.DRIVE_NOT_FOLLOWING, Reaction.RAMP, {"found": Finding.DRIVE_LAGS}),
    (Fault.STUCK_SIGNAL, Reaction.RAMP, {"found": Finding.ROLL_STUCK}),
    (Fault.STUCK_SIGNAL, Reaction.RAMP, {"found": Finding.LEVEL_STUCK}),
    (Fault.DRIFT, Reaction.RAMP, {"found": Finding.DRIFT_LASTS}),
    (Fault.VOLUME, Reaction.RAMP, {"found": Finding.VOLUME_LASTS}),
    (Fault.SPIKES, Reaction.RAMP, {"found": Finding.SPIKES}),
    (Fault.SIGNAL_DELAYED, Reaction.RAMP, {"found": Finding.MOTION_LATE}),
    (Fault.ROLL_AMPLIFIED, Reaction.RAMP, {"found": Finding.ROLL_AMPLIFIED}),
    (Fault.SENSORS_DISAGREE, Reaction.RAMP, {"found": Finding.SENSORS_DISAGREE}),
    (Fault.BUS_DEGRADED, Reaction.RAMP, {"found": Finding.UNWATCHED_LONG}),
    (Fault.VALVE_NOT_FOLLOWING, Reaction.STOP, {"found": Finding.VALVE_PASSES}),
    (Fault.STUCK_SIGNAL, Reaction.RAMP, {"found": Finding.HEEL_UNANSWERED}),
    (Fault.HEEL_LIMIT, Reaction.RAMP, {"found": Finding.NOT_IN_HARBOUR}),
    (Fault.STABILITY_LOW, Reaction.RAMP, {"found": Finding.HEEL_OVERDONE}),
    (Fault.HARDWIRED_STOP, Reaction.STOP, {"hardwired_stop": True}),
    (Fault.HARDWIRED_SILENT, Reaction.STOP, {"hardwired_age_ms": 160}),
]

# where it is enabled: a pump that presses against zero, and a stop that is no message
DRIVE_OFF = (Fault.SIGN_FLIP, Fault.DRIVE_NOT_FOLLOWING, Fault.HARDWIRED_STOP)


def conditions_in(seen, *reactions):
    """Conditions of these reactions that hold."""
    return [
        (row.code, condition)
        for row in FAULTS
        for condition in row.conditions
        if condition.reaction in reactions and condition.holds(seen, SafetyLimits())
    ]


def test_signs_are_those_of_the_table():
    ending = (Reaction.STOP, Reaction.RAMP)
    assert not conditions_in(situation(), *Reaction)
    found = []
    for fault, reaction, sign in SIGNS:
        ((code, condition),) = conditions_in(situation(**sign), *ending)
        assert (code, condition.reaction) == (fault, reaction)
        found.append(condition)
    # the supervisor's own timer is tested by itself
    found += [c for row in FAULTS for c in row.conditions if c.of_drive_that_should_be_on]
    assert all(c in found for row in FAULTS for c in row.conditions if c.reaction in ending)


@pytest.mark.parametrize(("fault", "reaction", "sign"), SIGNS)
def test_fault_while_armed_ends_at_zero_and_stays_there(fault, reaction, sign):
    bench = armed_bench()
    supervisor = bench.tick(**{**ACTIVE, **sign})
    assert (supervisor.mode, supervisor.fault) == (Mode.FAULT, fault)
    assert supervisor.demand is (Demand.RAMP if reaction is Reaction.RAMP else Demand.ZERO)
    for _ in range(101):  # a second on, the sign gone
        bench.tick(**ACTIVE)
    assert supervisor.demand is Demand.ZERO
    assert supervisor.mode is Mode.FAULT
    assert not supervisor.drive_wanted


def test_faults_that_cut_the_pressure_are_named_before_those_that_ramp():
    for ramp in (sign for _, reaction, sign in SIGNS if reaction is Reaction.RAMP):
        for fault, reaction, sign in SIGNS:
            if reaction is Reaction.STOP and not ramp.keys() & sign.keys():
                assert armed_bench().tick(**{**ACTIVE, **ramp, **sign}).fault is fault


INIT_SIGNS = [
    (Fault.BUS_LOST, {"link_lost": True}),
    (Fault.ADDRESS_CONFLICT, {"address_conflict": True}),
    (Fault.MOTION_SILENT, {"motion_age_ms": STALE_MS}),
    (Fault.TANK_SILENT, {"tank_age_ms": 110}),
    (Fault.PUMP_SENSOR_SILENT, {"pump_age_ms": 1100}),
    (Fault.DRIVE_SILENT, {"drive_age_ms": 70}),
    (Fault.VERSION_MISMATCH, {"versions_match": False}),
    (Fault.HARDWIRED_SILENT, {"hardwired_age_ms": 160}),
]


def test_start_waits_for_bus_sensors_drive_and_versions_and_names_them_in_this_order():
    bench = Bench()
    missing = {key: value for _, sign in INIT_SIGNS for key, value in sign.items()}
    for fault, sign in INIT_SIGNS:
        supervisor = bench.tick(**missing)
        assert (supervisor.mode, supervisor.fault) == (Mode.INIT, fault)
        missing = {key: value for key, value in missing.items() if key not in sign}
    assert bench.tick(**missing).mode is Mode.STANDBY


def test_motion_sensor_loss_is_at_zero_within_250_ms_of_the_first_sample_that_is_missing():
    bench = armed_bench()
    last_sample_ns = bench.now_ns
    while bench.supervisor.demand is not Demand.ZERO:
        bench.tick(**ACTIVE, motion_age_ms=(bench.now_ns - last_sample_ns) / MILLISECOND_NS)
    assert bench.now_ns - last_sample_ns <= 260 * MILLISECOND_NS


def test_stop_fault_during_a_ramp_cuts_it_short():
    bench = armed_bench()
    bench.tick(**{**ACTIVE, "roll_rad": 1.0})
    assert bench.supervisor.demand is Demand.RAMP
    bench.tick(**{**ACTIVE, "link_lost": True})
    assert bench.supervisor.demand is Demand.ZERO


def test_drive_out_of_operation_enabled_stops_after_40_ms():
    bench = armed_bench()
    out = {**ACTIVE, "drive_enabled": False}
    for _ in range(4):
        assert bench.tick(**out).mode is Mode.ACTIVE
    assert bench.tick(**out).fault is Fault.DRIVE_FAULT


@pytest.mark.parametrize(
    ("begins_ms", "in_ms", "out_ms", "found_ms"),
    [
        (0, 10, 10, 90),  # out of it for the third time after 50 ms, and 40 ms are allowed
        (10, 10, 10, 80),  # and before that, in the first tick
        (0, 10, 30, 130),
        (0, 200, 10, 660),
        (0, 440, 10, 1380),  # 2.1 departures are not forgotten
        (0, 980, 30, None),  # one a second is
        (0, 1000, 10, None),
    ],
)
def test_drive_that_keeps_leaving_operation_enabled_counts_as_out(
    begins_ms, in_ms, out_ms, found_ms
):
    bench = armed_bench()
    begin_ns = bench.now_ns
    while bench.supervisor.mode is Mode.ACTIVE and bench.now_ns < begin_ns + 20 * 10**9:
        time_ms = (bench.now_ns - begin_ns) // MILLISECOND_NS
        phase_ms = (begins_ms + time_ms) % (in_ms + out_ms)
        bench.tick(**{**ACTIVE, "drive_enabled": phase_ms < in_ms})
    if found_ms is None:
        assert bench.supervisor.mode is Mode.ACTIVE
    else:
        assert bench.supervisor.fault is Fault.DRIVE_FAULT
        assert time_ms == found_ms


def test_reset_needs_the_cause_gone_and_does_not_arm():
    bench = armed_bench()
    bench.tick(**{**ACTIVE, "link_lost": True})
    assert bench.tick(**ACTIVE, reset_edge=True, link_lost=True).mode is Mode.FAULT
    assert bench.tick(**ACTIVE, reset_edge=True).mode is Mode.STANDBY
    for _ in range(50):  # the panel still holds the arm bit
        assert bench.tick(**ACTIVE).demand is not Demand.CONTROL


@pytest.mark.parametrize(("fault", "reaction", "sign"), SIGNS)
def test_reset_is_refused_with_its_reason_while_any_cause_lasts(fault, reaction, sign):
    for first in ({"link_lost": True}, sign):
        bench = armed_bench()
        bench.tick(**{**ACTIVE, **first})
        latched = bench.supervisor.fault
        for _ in range(101):
            bench.tick(**sign)
        assert bench.supervisor.reset_refused_by is Fault.NONE
        bench.tick(**sign, reset_edge=True)
        for _ in range(60):
            bench.tick(**sign)
        supervisor = bench.supervisor
        assert (supervisor.mode, supervisor.fault) == (Mode.FAULT, latched)
        assert supervisor.reset_refused_by is fault
        bench.tick(**sign, reset_edge=True)
        assert supervisor.reset_refused_by is Fault.NONE  # until this one is refused, too
        for _ in range(60):
            bench.tick(**sign)
        assert supervisor.reset_refused_by is fault
        for _ in range(60):  # the refusal is not taken back when the cause goes
            assert bench.tick().mode is Mode.FAULT
        assert bench.tick(reset_edge=True).mode is Mode.STANDBY
        assert supervisor.reset_refused_by is Fault.NONE


def test_old_levels_that_only_halve_the_pressure_refuse_a_reset_too():
    bench = armed_bench()
    bench.tick(**{**ACTIVE, "link_lost": True})
    for _ in range(60):
        bench.tick(tank_age_ms=200, reset_edge=True)
    assert bench.supervisor.mode is Mode.FAULT
    assert bench.supervisor.fault is Fault.BUS_LOST


def test_new_it_waits_with_the_pump_at_zero_and_the_drive_off():
    supervisor = Supervisor(SafetyLimits())
    assert (supervisor.mode, supervisor.fault) == (Mode.INIT, Fault.NONE)
    assert supervisor.demand is Demand.ZERO
    assert not supervisor.drive_wanted
    assert not supervisor.degraded
    assert not supervisor.arming
    assert supervisor.reset_refused_by is Fault.NONE


def test_reset_waits_half_a_second_for_the_drive_to_leave_its_fault():
    for ticks, mode in ((49, Mode.STANDBY), (50, Mode.FAULT)):
        bench = armed_bench()
        bench.tick(**{**ACTIVE, "drive_fault": True})
        bench.tick(drive_fault=True, reset_edge=True)
        for _ in range(ticks):
            bench.tick(drive_fault=True)
        assert bench.tick().mode is mode


def test_a_drive_that_was_out_is_no_reason_to_refuse_the_reset():
    bench = armed_bench()
    bench.tick(**{**ACTIVE, "link_lost": True})
    assert bench.tick(drive_out_ms=50.0, reset_edge=True).mode is Mode.STANDBY


@pytest.mark.parametrize(("age_ms", "mode"), [(600, Mode.PASSIVE), (601, Mode.STANDBY)])
def test_passive_is_not_entered_on_an_old_order(age_ms, mode):
    bench = Bench()
    bench.tick(motion_age_ms=STALE_MS)  # INIT
    bench.tick(requested_mode=Mode.PASSIVE, passive_edge=True, panel_age_ms=age_ms)
    bench.tick(requested_mode=Mode.PASSIVE, panel_age_ms=age_ms)
    assert bench.supervisor.mode is mode


def passive_bench():
    bench = Bench()
    bench.tick()
    assert bench.tick(requested_mode=Mode.PASSIVE, passive_edge=True).mode is Mode.PASSIVE
    return bench


def test_passive_is_entered_once_for_each_time_that_it_was_asked_for():
    bench = Bench()
    for _ in range(5):
        bench.tick(requested_mode=Mode.PASSIVE)
    assert bench.supervisor.mode is Mode.STANDBY  # the lever was there before anybody looked
    for edge, end in product((True, False), ({"stop": True}, {"link_lost": True})):
        bench.tick(requested_mode=Mode.PASSIVE, passive_edge=True)
        assert bench.supervisor.mode is Mode.PASSIVE
        bench.tick(requested_mode=Mode.PASSIVE, **end)
        assert not bench.supervisor.drive_wanted
        for _ in range(5):
            bench.tick(requested_mode=Mode.PASSIVE)
        assert bench.supervisor.mode is Mode.STANDBY
        bench.tick(requested_mode=Mode.STANDBY, passive_edge=edge)
        bench.tick(requested_mode=Mode.STANDBY)
        assert bench.supervisor.mode is Mode.STANDBY


@pytest.mark.parametrize(("later_s", "mode"), [(1.99, Mode.PASSIVE), (2.0, Mode.STANDBY)])
def test_passive_that_could_not_be_entered_for_long_is_to_be_asked_for_anew(later_s, mode):
    """A drive that is powered up an hour later is not to be enabled by that."""
    bench = Bench()
    bench.tick(drive_age_ms=1e6, requested_mode=Mode.PASSIVE, passive_edge=True)
    bench.now_ns = round(later_s * 1e9)
    for _ in range(3):
        bench.tick(requested_mode=Mode.PASSIVE)
    assert bench.supervisor.mode is mode


def test_passive_that_was_asked_for_meanwhile_is_entered_when_it_can_be():
    bench = Bench()
    bench.tick(motion_age_ms=STALE_MS, requested_mode=Mode.PASSIVE, passive_edge=True)
    assert bench.supervisor.mode is Mode.INIT
    for _ in range(2):
        bench.tick(requested_mode=Mode.PASSIVE)
    assert bench.supervisor.mode is Mode.PASSIVE
    # one that was taken back is not, nor one that a stop came after
    for last in ({"requested_mode": Mode.STANDBY}, {"requested_mode": Mode.PASSIVE, "stop": True}):
        bench.tick(motion_age_ms=STALE_MS)
        bench.tick(motion_age_ms=STALE_MS, requested_mode=Mode.PASSIVE, passive_edge=True)
        bench.tick(motion_age_ms=STALE_MS, **last)
        for _ in range(3):
            bench.tick(requested_mode=Mode.PASSIVE)
        assert bench.supervisor.mode is Mode.STANDBY


@pytest.mark.parametrize(("fault", "reaction", "sign"), SIGNS)
def test_without_pressure_no_fault_is_latched_but_what_must_switch_the_drive_off(
    fault, reaction, sign
):
    supervisor = passive_bench().tick(requested_mode=Mode.PASSIVE, **sign)
    latched = fault in DRIVE_OFF and reaction is Reaction.STOP
    assert (supervisor.mode is Mode.FAULT) is latched
    assert not (latched and supervisor.drive_wanted)
    bench = Bench()
    bench.tick()
    # in STANDBY the command is zero whatever the last one was
    assert bench.tick(command_pa=1e4, **sign).mode is not Mode.FAULT


def test_a_pump_that_presses_in_passive_before_anything_was_armed_is_switched_off():
    found = Finding.DRIVE_LOST | Finding.DRIVE_LAGS
    supervisor = passive_bench().tick(requested_mode=Mode.PASSIVE, found=found)
    assert (supervisor.mode, supervisor.demand) == (Mode.FAULT, Demand.ZERO)
    assert supervisor.fault is Fault.DRIVE_NOT_FOLLOWING
    assert not supervisor.drive_wanted


def test_a_drive_that_was_out_is_excused_by_a_reset_that_is_refused_too():
    bench = armed_bench()
    for _ in range(6):
        bench.tick(**{**ACTIVE, "drive_enabled": False})
    assert bench.supervisor.fault is Fault.DRIVE_FAULT
    assert bench.supervisor.standing & judging.DRIVE_OUT
    bench.tick(link_lost=True, reset_edge=True)
    for _ in range(60):
        bench.tick(link_lost=True)
    assert bench.supervisor.reset_refused_by is Fault.BUS_LOST
    assert bench.tick(link_lost=True).drive_out_ms == 0.0
    assert not bench.supervisor.standing & judging.DRIVE_OUT


def test_a_drive_that_was_out_before_arming_is_no_reason_to_refuse_it():
    bench = Bench()
    bench.tick()
    assert bench.tick(**ARMING, drive_out_ms=50.0).arming


def test_a_disarming_in_the_tick_of_the_arm_edge_is_not_lost():
    bench = Bench()
    bench.tick()
    assert not bench.tick(**{**ARMING, "armed": False}).arming


@pytest.mark.parametrize("mode", [Mode.STANDBY, Mode.PASSIVE])
def test_an_arm_edge_without_the_wish_to_be_active_does_not_arm(mode):
    for bench in (Bench(), passive_bench()):
        bench.tick()
        assert not bench.tick(requested_mode=mode, armed=True, arm_edge=True).arming


def test_why_arming_was_refused_stays_to_be_read():
    bench = Bench()
    bench.tick()
    bench.tick(**ARMING, high_level=True)
    for _ in range(10):
        assert bench.tick().fault is Fault.LEVEL_LIMIT
    bench.tick(**ARMING)
    assert bench.tick(**ACTIVE).fault is Fault.NONE


def test_arm_bit_held_since_before_the_start_never_arms():
    bench = Bench()
    for _ in range(50):
        assert bench.tick(**ACTIVE).mode is not Mode.ACTIVE


def test_arming_is_given_up_when_the_drive_does_not_enable():
    bench = Bench()
    bench.tick()
    bench.tick(requested_mode=Mode.ACTIVE, armed=True, arm_edge=True)
    assert bench.supervisor.arming_ms == 0.0
    for ticks in range(1, 201):
        bench.tick(requested_mode=Mode.ACTIVE, armed=True)
        assert bench.supervisor.arming_ms == 10.0 * ticks
        assert bench.supervisor.drive_wanted
        assert bench.supervisor.arming
        assert bench.supervisor.mode is Mode.STANDBY
    bench.tick(requested_mode=Mode.ACTIVE, armed=True)
    assert not bench.supervisor.arming
    assert (bench.supervisor.mode, bench.supervisor.fault) == (Mode.STANDBY, Fault.DRIVE_FAULT)
    assert not bench.supervisor.drive_wanted


def test_active_is_not_arming_any_more_and_forgets_why_it_was_refused_before():
    bench = Bench()
    bench.tick()
    assert bench.tick(**ARMING, high_level=True).fault is Fault.LEVEL_LIMIT
    bench.tick(**ARMING)
    supervisor = bench.tick(**ACTIVE)
    assert supervisor.mode is Mode.ACTIVE
    assert not supervisor.arming
    assert supervisor.fault is Fault.NONE


@pytest.mark.parametrize("wish", [{"stop": True}, {"armed": False}])
def test_what_ends_active_without_a_fault_leaves_neither_fault_nor_half_pressure(wish):
    bench = armed_bench()
    assert bench.tick(**ACTIVE, tank_age_ms=90).mode is Mode.ACTIVE
    assert bench.tick(**ACTIVE, tank_age_ms=150).degraded
    supervisor = bench.tick(**{**ACTIVE, **wish}, tank_age_ms=150)
    assert supervisor.fault is Fault.NONE
    assert not supervisor.degraded


def test_a_fault_after_a_reset_is_latched_like_the_first():
    bench = armed_bench()
    bench.tick(**{**ACTIVE, "link_lost": True})
    assert bench.tick(reset_edge=True).mode is Mode.STANDBY
    bench.tick(**ARMING)
    assert bench.tick(**ACTIVE).mode is Mode.ACTIVE
    bench.tick(**{**ACTIVE, "link_lost": True})
    for _ in range(100):
        assert bench.tick(**ACTIVE).mode is Mode.FAULT


def test_a_fault_while_arming_during_the_ramp_ends_the_arming():
    bench = disarmed_bench()
    assert bench.tick(**RAMPING, requested_mode=Mode.ACTIVE, armed=True, arm_edge=True).arming
    supervisor = bench.tick(**{**ACTIVE, **RAMPING, "drive_enabled": False, "link_lost": True})
    assert supervisor.mode is Mode.FAULT
    assert not supervisor.arming


def test_a_drive_that_is_off_after_a_fault_counts_as_no_second_one():
    bench = armed_bench()
    bench.tick(**{**ACTIVE, "link_lost": True})
    for _ in range(10):
        assert bench.tick().drive_out_ms == 0.0


@pytest.mark.parametrize(("fault", "reaction", "sign"), SIGNS)
@pytest.mark.parametrize("with_the_drive", [False, True])
def test_whatever_ends_active_ends_arming(fault, reaction, sign, with_the_drive):
    bench = Bench()
    bench.tick()
    bench.tick(requested_mode=Mode.ACTIVE, armed=True, arm_edge=True)
    assert bench.supervisor.arming
    supervisor = bench.tick(**{**ACTIVE, **sign, "drive_enabled": with_the_drive})
    assert not supervisor.arming
    assert (supervisor.mode, supervisor.fault) in ((Mode.STANDBY, fault), (Mode.INIT, fault))
    assert supervisor.demand is Demand.ZERO
    for _ in range(50):  # the sign gone, the arm bit held
        assert bench.tick(**ACTIVE).mode is not Mode.ACTIVE


def test_arming_is_refused_without_a_commissioning_and_ends_when_it_is_missing():
    bench = Bench()
    bench.tick()
    supervisor = bench.tick(**ARMING, commissioned=OwnState().commissioned)
    assert (supervisor.mode, supervisor.fault) == (Mode.STANDBY, Fault.NOT_COMMISSIONED)
    assert not supervisor.arming
    assert not supervisor.drive_wanted


def test_a_panel_that_goes_silent_ends_arming_as_it_refuses_it():
    bench = Bench()
    bench.tick()
    bench.tick(requested_mode=Mode.ACTIVE, armed=True, arm_edge=True)
    supervisor = bench.tick(**ACTIVE, panel_age_ms=700)
    assert (supervisor.mode, supervisor.fault) == (Mode.STANDBY, Fault.OPERATOR_SILENT)


def test_disarming_ramps_down_with_the_drive_enabled():
    bench = armed_bench()
    supervisor = bench.tick(requested_mode=Mode.ACTIVE, armed=False, drive_enabled=True)
    assert (supervisor.mode, supervisor.demand) == (Mode.PASSIVE, Demand.RAMP)
    assert supervisor.drive_wanted


RAMPING = {"drive_enabled": True, "command_pa": 20e3}


def disarmed_bench():
    bench = armed_bench()
    supervisor = bench.tick(**{**ACTIVE, "command_pa": 20e3, "armed": False})
    assert (supervisor.mode, supervisor.demand) == (Mode.PASSIVE, Demand.RAMP)
    return bench


@pytest.mark.parametrize(("fault", "reaction", "sign"), SIGNS)
def test_whatever_ends_active_is_latched_during_the_ramp_after_disarming(fault, reaction, sign):
    bench = disarmed_bench()
    bench.tick(**RAMPING)
    supervisor = bench.tick(**{**RAMPING, **sign})
    assert (supervisor.mode, supervisor.fault) == (Mode.FAULT, fault)
    assert supervisor.demand is (Demand.RAMP if reaction is Reaction.RAMP else Demand.ZERO)


@pytest.mark.parametrize("disarmed", [False, True])
def test_a_stop_in_the_tick_of_a_fault_that_ramps_is_not_lost(disarmed):
    bench = disarmed_bench() if disarmed else armed_bench()
    before = RAMPING if disarmed else ACTIVE
    bench.tick(**before)
    supervisor = bench.tick(**{**before, "motion_age_ms": STALE_MS, "stop": True})
    assert (supervisor.mode, supervisor.fault) == (Mode.FAULT, Fault.MOTION_SILENT)
    assert supervisor.demand is Demand.ZERO
    assert not supervisor.drive_wanted


def test_drive_that_drops_out_during_the_ramp_after_disarming_is_found():
    bench = disarmed_bench()
    for _ in range(5):
        assert bench.supervisor.mode is Mode.PASSIVE
        bench.tick(**{**RAMPING, "drive_enabled": False})
    assert bench.supervisor.fault is Fault.DRIVE_FAULT


@pytest.mark.parametrize("mode", [Mode.STANDBY, Mode.PASSIVE])
@pytest.mark.parametrize("command_pa", [20e3, 1.0])
def test_ramp_after_disarming_is_cut_after_a_second_and_leaves_the_drive_enabled(mode, command_pa):
    bench = disarmed_bench()
    began_ns = bench.now_ns - TICK_NS
    while bench.supervisor.demand is Demand.RAMP:
        assert bench.now_ns - began_ns <= 1000 * MILLISECOND_NS
        bench.tick(requested_mode=mode, drive_enabled=True, command_pa=command_pa)
    assert bench.now_ns - TICK_NS - began_ns == 1000 * MILLISECOND_NS
    assert bench.supervisor.demand is Demand.ZERO
    assert bench.supervisor.mode is Mode.PASSIVE
    assert bench.supervisor.drive_wanted


def test_drive_that_drops_out_during_the_ramp_of_a_fault_ends_it():
    bench = armed_bench()
    bench.tick(**{**ACTIVE, "roll_rad": 1.0})
    for _ in range(4):
        bench.tick(command_pa=20e3)
        assert bench.supervisor.demand is Demand.RAMP
    assert bench.tick(command_pa=20e3).demand is Demand.ZERO


def test_arming_during_the_ramp_takes_over_and_the_ramps_end_is_forgotten():
    bench = disarmed_bench()
    bench.tick(**{**ACTIVE, **RAMPING, "arm_edge": True})
    for _ in range(200):
        bench.tick(**{**ACTIVE, **RAMPING})
    assert bench.supervisor.demand is Demand.CONTROL
    assert bench.tick(**{**ACTIVE, **RAMPING, "roll_rad": 1.0}).demand is Demand.RAMP
    assert bench.tick(**{**ACTIVE, **RAMPING}).demand is Demand.RAMP


def ends_within_ms(sign):
    """The shortest time to zero that the table asks for."""
    found = conditions_in(situation(**sign), Reaction.RAMP)
    return min(condition.zero_within_ms for _, condition in found)


RAMP_SIGNS = [sign for _, reaction, sign in SIGNS if reaction is Reaction.RAMP]
ENDS = list({ends_within_ms(sign): sign for sign in RAMP_SIGNS}.values())
"""A sign for each time to zero that there is."""


@pytest.mark.parametrize("first", [*RAMP_SIGNS, "disarmed"])
@pytest.mark.parametrize("first_lasts", [False, True])
def test_a_ramp_ends_at_the_earliest_of_the_ends_that_run(first, first_lasts):
    for second in ENDS:
        for later_ms in (10, 300, 900):
            check_two_ramps(first, second, later_ms, first_lasts)


def check_two_ramps(first, second, later_ms, first_lasts):
    if isinstance(first, str):
        bench, sign, first_within_ms = disarmed_bench(), {}, 1000
        began_ns = bench.now_ns - TICK_NS
    else:
        bench, sign, first_within_ms = armed_bench(), first, ends_within_ms(first)
        began_ns = bench.now_ns
        bench.tick(**{**ACTIVE, **RAMPING, **sign})
    later_ns = began_ns + later_ms * MILLISECOND_NS
    second_within_ms = ends_within_ms(second)
    zero_ns = began_ns + first_within_ms * MILLISECOND_NS
    while bench.supervisor.demand is Demand.RAMP:
        both = sign if first_lasts else {}
        if bench.now_ns >= later_ns:
            zero_ns = min(zero_ns, later_ns + second_within_ms * MILLISECOND_NS)
            both = {**both, **second}
        assert bench.now_ns <= zero_ns
        bench.tick(**{**RAMPING, **both})
    assert abs(bench.now_ns - zero_ns) <= 2 * TICK_NS


@pytest.mark.parametrize("bench", [armed_bench, disarmed_bench])
def test_operators_stop_is_immediate(bench):
    for wishes in (ACTIVE, RAMPING):
        supervisor = bench().tick(**wishes, stop=True)
        assert (supervisor.mode, supervisor.demand) == (Mode.STANDBY, Demand.ZERO)
        assert not supervisor.drive_wanted


def test_operators_stop_ends_the_ramp_of_a_fault_at_once_and_leaves_the_fault():
    bench = armed_bench()
    bench.tick(**{**ACTIVE, "roll_rad": 1.0})
    assert bench.supervisor.demand is Demand.RAMP
    supervisor = bench.tick(**{**RAMPING, "stop": True})
    assert (supervisor.mode, supervisor.demand) == (Mode.FAULT, Demand.ZERO)
    assert not supervisor.drive_wanted


def test_stop_keeps_from_arming_and_ends_it():
    bench = Bench()
    bench.tick()
    assert not bench.tick(**ARMING, stop=True).arming
    assert bench.tick(**ARMING).arming
    assert not bench.tick(**ACTIVE, stop=True).arming
    for _ in range(10):
        assert bench.tick(**ACTIVE).mode is Mode.STANDBY


@pytest.mark.parametrize(
    "withdrawn", [{"armed": False}, {"requested_mode": Mode.PASSIVE},
                  {"requested_mode": Mode.STANDBY}]
)  # fmt: skip
def test_arming_that_is_withdrawn_is_over(withdrawn):
    bench = Bench()
    bench.tick()
    bench.tick(**ARMING)
    assert not bench.tick(**{**ACTIVE, **withdrawn}).arming
    for _ in range(10):
        assert bench.tick(**ACTIVE).mode is Mode.STANDBY


@pytest.mark.parametrize("mode", [Mode.PASSIVE, Mode.STANDBY])
def test_another_mode_ends_active_though_the_arm_bit_is_set(mode):
    supervisor = armed_bench().tick(**{**ACTIVE, "requested_mode": mode})
    assert (supervisor.mode, supervisor.demand) == (Mode.PASSIVE, Demand.RAMP)


def test_reset_during_a_ramp_is_refused_and_the_refusal_is_told():
    bench = armed_bench()
    bench.tick(**{**ACTIVE, "roll_rad": 1.0})
    assert bench.tick(**RAMPING).reset_refused_by is Fault.NONE
    for _ in range(90):
        assert bench.tick(**RAMPING, reset_edge=True).mode is Mode.FAULT
        assert bench.supervisor.reset_refused_by is Fault.HEEL_LIMIT
    assert bench.supervisor.demand is Demand.RAMP
    for _ in range(100):  # nor is it done later
        assert bench.tick().mode is Mode.FAULT
    assert bench.supervisor.reset_refused_by is Fault.HEEL_LIMIT
    assert bench.tick(reset_edge=True).mode is Mode.STANDBY


@pytest.mark.parametrize("sign", [{"tank_age_ms": 150}, {"pump_age_ms": 1001}])
def test_what_is_awaited_and_does_not_end_active_does_not_cut_the_ramp_after_disarming(sign):
    bench = disarmed_bench()
    ends = bool(conditions_in(situation(**sign), Reaction.RAMP))
    for _ in range(20):
        supervisor = bench.tick(**{**RAMPING, **sign})
        assert supervisor.mode is (Mode.FAULT if ends else Mode.PASSIVE)
        assert supervisor.demand is Demand.RAMP
        assert supervisor.drive_wanted
    if not ends:
        assert bench.tick(**{**RAMPING, **sign, "command_pa": 0.0}).mode is Mode.INIT


@pytest.mark.parametrize(
    "end", [{"armed": False}, {"requested_mode": Mode.STANDBY}, {"commissioned": False}]
)
def test_arming_that_ends_during_the_ramp_leaves_the_ramp(end):
    bench = disarmed_bench()
    arming = {**RAMPING, "requested_mode": Mode.ACTIVE, "armed": True, "drive_enabled": False}
    assert bench.tick(**{**arming, "arm_edge": True}).arming
    supervisor = bench.tick(**{**arming, **end})
    assert not supervisor.arming
    assert (supervisor.mode, supervisor.demand) == (Mode.PASSIVE, Demand.RAMP)
    assert supervisor.drive_wanted


def test_what_is_latched_or_refuses_is_raised_in_that_tick_alone():
    bench = Bench()
    assert bench.tick().raised is Fault.NONE
    assert bench.tick(**ARMING, high_level=True).raised is Fault.LEVEL_LIMIT
    assert bench.tick(**ACTIVE, high_level=True).raised is Fault.NONE
    assert bench.supervisor.fault is Fault.LEVEL_LIMIT
    bench.tick()
    assert bench.tick(**ARMING).raised is Fault.NONE
    assert bench.tick(**ACTIVE, high_level=True).raised is Fault.LEVEL_LIMIT
    assert bench.tick(**ARMING).raised is Fault.NONE
    late = [bench.tick(**{**ACTIVE, "drive_enabled": False}).raised for _ in range(400)]
    assert [raised for raised in late if raised] == [Fault.DRIVE_FAULT]
    bench = armed_bench()
    assert bench.supervisor.raised is Fault.NONE
    assert bench.tick(**{**ACTIVE, "roll_rad": 1.0}).raised is Fault.HEEL_LIMIT
    assert bench.tick(**{**ACTIVE, "roll_rad": 1.0}).raised is Fault.NONE
    bench = disarmed_bench()
    assert bench.tick(**RAMPING, link_lost=True).raised is Fault.BUS_LOST


@pytest.mark.parametrize("roll_rad", [0.36, -0.36])
def test_a_ship_that_rolls_beyond_its_limit_is_not_armed_as_it_passes_upright(roll_rad):
    """Twenty seconds are half a roll of the slowest ships."""
    bench = Bench()
    bench.tick(roll_rad=roll_rad)
    for _ in range(1998):
        bench.tick()
    assert not bench.tick(**ARMING).arming
    assert (bench.supervisor.fault, bench.supervisor.raised) == (Fault.HEEL_LIMIT,) * 2
    assert bench.tick(**ARMING).arming
    bench = Bench()
    bench.tick(roll_rad=0.35)
    assert bench.tick(**ARMING).arming


def test_a_roll_beyond_the_limit_while_arming_ends_it():
    bench = Bench()
    bench.tick()
    assert bench.tick(**ARMING).arming
    bench.tick(**{**ACTIVE, "drive_enabled": False, "roll_rad": 0.4})
    assert bench.supervisor.raised is Fault.HEEL_LIMIT


PASSIVE = {"requested_mode": Mode.PASSIVE}


def out_ms(bench, **changes):
    """What a tick in PASSIVE counts; the tick stays there."""
    supervisor = bench.tick(**PASSIVE, **changes)
    assert supervisor.mode is Mode.PASSIVE
    return supervisor.drive_out_ms


def test_a_drive_in_passive_has_its_time_to_get_enabled_and_then_counts_as_out():
    bench = passive_bench()
    assert {out_ms(bench) for _ in range(199)} == {0.0}
    assert [out_ms(bench) for _ in range(5)] == [10.0, 20.0, 30.0, 40.0, 50.0]
    assert bench.supervisor.drive_wanted
    assert out_ms(bench, drive_enabled=True) == 0.0


def test_a_drive_that_leaves_in_passive_counts_as_out_from_then_on():
    bench = passive_bench()
    assert out_ms(bench, drive_enabled=True) == 0.0
    assert [out_ms(bench) for _ in range(3)] == [10.0, 20.0, 30.0]
    assert out_ms(bench, drive_enabled=True) == 0.0


def test_a_drive_that_comes_and_goes_in_passive_counts_as_out():
    bench = passive_bench()
    out_ms(bench, drive_enabled=True)
    counted = [out_ms(bench, drive_enabled=tick % 2 == 1) for tick in range(12)]
    assert counted[:4] == [10.0, 0.0, 10.0, 0.0]
    assert min(counted[4:]) > 0.0
    assert counted[-1] > 40.0


def test_a_drive_counts_as_out_in_passive_after_active_at_once():
    bench = armed_bench()
    bench.tick(**{**ACTIVE, **PASSIVE})
    assert [out_ms(bench) for _ in range(2)] == [10.0, 20.0]


def test_a_drive_that_is_out_in_passive_may_be_armed():
    bench = passive_bench()
    out_ms(bench, drive_enabled=True)
    assert [out_ms(bench) for _ in range(5)][-1] == 50.0
    assert bench.tick(**ARMING).arming
    assert bench.tick(**ACTIVE).mode is Mode.ACTIVE


def test_elsewhere_it_is_off_as_it_should_be():
    bench = passive_bench()
    out_ms(bench, drive_enabled=True)
    assert out_ms(bench) == 10.0
    assert bench.tick(drive_out_ms=50.0).mode is Mode.STANDBY
    assert bench.tick(drive_out_ms=50.0).drive_out_ms == 0.0


READY = {
    "motion_age_ms": STALE_MS - 10, "tank_age_ms": 100, "pump_age_ms": 1000, "drive_age_ms": 60,
    "echo_age_ms": 100,
}  # fmt: skip


def test_ready_up_to_every_threshold_and_not_beyond():
    assert Bench().tick(**READY).mode is Mode.STANDBY
    for name, age_ms in READY.items():
        assert Bench().tick(**{**READY, name: age_ms + 1}).mode is Mode.INIT, name


@pytest.mark.parametrize("age", [{"tank_age_ms": 150}, {"pump_age_ms": 250}])
def test_old_levels_and_pressures_first_halve_the_pressure(age):
    bench = armed_bench()
    bench.tick(**ACTIVE, **age)
    assert bench.supervisor.degraded
    assert bench.supervisor.mode is Mode.ACTIVE


def test_a_lost_panel_forbids_arming_at_once():
    bench = Bench()
    bench.tick()
    late = {**ACTIVE, "panel_age_ms": 700, "arm_edge": True}
    assert not bench.tick(**late).arming
    assert bench.supervisor.fault is Fault.OPERATOR_SILENT


DEGRADING = ("DRIFT", "VOLUME", "UNWATCHED")
WARNING = (
    "FRAMES_LOST", "NOISE", "SATURATED", "NODE_SILENT", "WRONG_PROOF", "TANK_USED_UP",
)  # fmt: skip


@pytest.mark.parametrize("name", [name for name in vars(Finding) if name.isupper()])
def test_each_finding_of_the_monitors_does_something(name):
    finding = getattr(Finding, name)
    bench = armed_bench()
    supervisor = bench.tick(**ACTIVE, found=finding)
    assert supervisor.degraded is (name in DEGRADING)
    assert (supervisor.mode is Mode.FAULT) is (name not in (*DEGRADING, *WARNING))
    warned = judging.standing(situation(found=finding), SafetyLimits()) & judging.WARNING
    assert bool(warned) is (name in WARNING)


def test_everything_that_halves_is_named_and_nothing_else():
    seen = situation(tank_age_ms=150.0, pump_age_ms=250.0, found=Finding.DRIFT)
    halving = judging.standing(seen, SafetyLimits()) & judging.HALVING
    assert judging.faults(halving) == {
        Fault.TANK_SILENT, Fault.PUMP_SENSOR_SILENT, Fault.DRIFT,
    }  # fmt: skip
    seen = situation(commissioned=False, found=Finding.SATURATED | Finding.NOISE)
    assert not judging.standing(seen, SafetyLimits()) & judging.HALVING
