from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from utank_hil.canbus.enumerations import Fault, Mode
from utank_hil.runtime import faults
from utank_hil.runtime.faults import MILLISECOND_NS, Reaction, Response
from utank_hil.runtime.supervisor import NEVER_NS, Demand, Observations, SafetyLimits, Supervisor
from utank_hil.tick import TICK_NS

HEALTHY = Observations(
    motion_age_ns=0,
    tank_age_ns=0,
    pump_age_ns=0,
    drive_age_ns=0,
    echo_age_ns=0,
    panel_age_ns=0,
)


class Bench:
    """A supervisor with its own clock."""

    def __init__(self) -> None:
        self.supervisor = Supervisor(SafetyLimits())
        self.now_ns = 0

    def tick(self, **changes: object) -> Supervisor:
        self.supervisor.update(replace(HEALTHY, **changes), self.now_ns)  # type: ignore[arg-type]
        self.now_ns += TICK_NS
        return self.supervisor


def armed_bench() -> Bench:
    bench = Bench()
    bench.tick()
    bench.tick(requested_mode=Mode.ACTIVE, armed=True, arm_edge=True)
    bench.tick(requested_mode=Mode.ACTIVE, armed=True, drive_enabled=True)
    assert bench.supervisor.mode is Mode.ACTIVE
    return bench


ACTIVE = {"requested_mode": Mode.ACTIVE, "armed": True, "drive_enabled": True}
# what each fault looks like, all else being well
SIGNS: list[tuple[Response, dict[str, object]]] = [
    (faults.MOTION_SILENT, {"motion_age_ns": 40 * MILLISECOND_NS}),
    (faults.TANK_SILENT, {"tank_age_ns": 1100 * MILLISECOND_NS}),
    (faults.PUMP_SENSOR_SILENT, {"pump_age_ns": 1100 * MILLISECOND_NS}),
    (faults.PROTECTION, {"protection_valid": False}),
    (faults.DRIVE_SILENT, {"drive_age_ns": 70 * MILLISECOND_NS}),
    (faults.DRIVE_SILENT, {"echo_age_ns": 110 * MILLISECOND_NS}),
    (faults.DRIVE_FAULT, {"drive_fault": True}),
    (faults.BUS_LOST, {"link_lost": True}),
    (faults.ADDRESS_CONFLICT, {"address_conflict": True}),
    (faults.BUS_OVERLOAD, {"bus_load": 0.9}),
    (faults.LEVEL_LIMIT, {"high_level": True}),
    (faults.HEEL_LIMIT, {"roll_rad": -0.4}),
    (faults.HEEL_LIMIT, {"heel_rad": 0.2}),
    (faults.OPERATOR_SILENT, {"panel_age_ns": 6000 * MILLISECOND_NS}),
    (faults.LONG_OVERRUN, {"tick_late_ns": 60 * MILLISECOND_NS}),
    (faults.REPEATED_OVERRUNS, {"overruns_in_ten": 3}),
    (faults.VERSION_MISMATCH, {"versions_match": False}),
]


@pytest.mark.parametrize(("response", "sign"), SIGNS)
def test_fault_while_armed_ends_at_zero_and_stays_there(
    response: Response, sign: dict[str, object]
) -> None:
    bench = armed_bench()
    supervisor = bench.tick(**{**ACTIVE, **sign})
    assert (supervisor.mode, supervisor.fault) == (Mode.FAULT, response.fault)
    ramps = response.reaction is Reaction.RAMP
    assert supervisor.demand is (Demand.RAMP if ramps else Demand.ZERO)
    for _ in range(101):  # a second on, the sign gone
        bench.tick(**ACTIVE)
    assert supervisor.demand is Demand.ZERO
    assert supervisor.mode is Mode.FAULT
    assert not supervisor.drive_wanted


def test_motion_sensor_loss_is_at_zero_within_250_ms_of_the_last_sample() -> None:
    bench = armed_bench()
    last_sample_ns = bench.now_ns
    while bench.supervisor.demand is not Demand.ZERO:
        bench.tick(**ACTIVE, motion_age_ns=bench.now_ns - last_sample_ns)
    assert bench.now_ns - last_sample_ns <= 250 * MILLISECOND_NS


def test_stop_fault_during_a_ramp_cuts_it_short() -> None:
    bench = armed_bench()
    bench.tick(**{**ACTIVE, "roll_rad": 1.0})
    assert bench.supervisor.demand is Demand.RAMP
    bench.tick(**{**ACTIVE, "link_lost": True})
    assert bench.supervisor.demand is Demand.ZERO


def test_drive_out_of_operation_enabled_stops_after_40_ms() -> None:
    bench = armed_bench()
    out = {**ACTIVE, "drive_enabled": False}
    for _ in range(4):
        assert bench.tick(**out).mode is Mode.ACTIVE
    assert bench.tick(**out).fault is Fault.DRIVE_FAULT


def test_reset_needs_the_cause_gone_and_does_not_arm() -> None:
    bench = armed_bench()
    bench.tick(**{**ACTIVE, "link_lost": True})
    assert bench.tick(**ACTIVE, reset_edge=True, link_lost=True).mode is Mode.FAULT
    assert bench.tick(**ACTIVE, reset_edge=True).mode is Mode.STANDBY
    for _ in range(50):  # the panel still holds the arm bit
        assert bench.tick(**ACTIVE).demand is not Demand.CONTROL


def test_arm_bit_held_since_before_the_start_never_arms() -> None:
    bench = Bench()
    for _ in range(50):
        assert bench.tick(**ACTIVE).mode is not Mode.ACTIVE


def test_arming_is_given_up_when_the_drive_does_not_enable() -> None:
    bench = Bench()
    bench.tick()
    bench.tick(requested_mode=Mode.ACTIVE, armed=True, arm_edge=True)
    for _ in range(202):
        bench.tick(requested_mode=Mode.ACTIVE, armed=True)
    assert bench.supervisor.fault is Fault.DRIVE_FAULT
    assert not bench.supervisor.drive_wanted


def test_disarming_ramps_down_with_the_drive_enabled() -> None:
    bench = armed_bench()
    supervisor = bench.tick(requested_mode=Mode.ACTIVE, armed=False, drive_enabled=True)
    assert (supervisor.mode, supervisor.demand) == (Mode.PASSIVE, Demand.RAMP)
    assert supervisor.drive_wanted


def test_operators_stop_is_immediate() -> None:
    bench = armed_bench()
    assert bench.tick(**ACTIVE, stop=True).demand is Demand.ZERO


def test_old_tank_levels_first_halve_the_pressure() -> None:
    bench = armed_bench()
    bench.tick(**ACTIVE, tank_age_ns=150 * MILLISECOND_NS)
    assert bench.supervisor.degraded
    assert bench.supervisor.mode is Mode.ACTIVE


def test_a_lost_panel_forbids_arming_at_once() -> None:
    bench = Bench()
    bench.tick()
    late = {**ACTIVE, "panel_age_ns": 700 * MILLISECOND_NS, "arm_edge": True}
    assert not bench.tick(**late).arming
    assert bench.supervisor.fault is Fault.OPERATOR_SILENT


ages = st.sampled_from([0, 20, 35, 65, 105, 1005, 5005]).map(lambda ms: ms * MILLISECOND_NS)
observations = st.builds(
    Observations,
    motion_age_ns=ages,
    tank_age_ns=ages,
    pump_age_ns=ages,
    drive_age_ns=ages,
    echo_age_ns=ages,
    panel_age_ns=ages | st.just(NEVER_NS),
    drive_enabled=st.booleans(),
    drive_fault=st.booleans(),
    link_lost=st.booleans(),
    high_level=st.booleans(),
    roll_rad=st.floats(-1, 1),
    requested_mode=st.sampled_from([Mode.STANDBY, Mode.PASSIVE, Mode.ACTIVE]),
    arm_edge=st.booleans(),
    armed=st.booleans(),
    stop=st.booleans(),
    reset_edge=st.booleans(),
)
mostly_healthy = st.one_of(
    observations,
    *[
        st.just(replace(HEALTHY, **changes))  # type: ignore[arg-type]
        for changes in (ACTIVE, {**ACTIVE, "arm_edge": True}, {}, {"reset_edge": True})
        for _ in range(2)
    ],
)


@given(st.lists(mostly_healthy, max_size=60))
def test_control_only_while_armed_fresh_and_after_an_edge(history: list[Observations]) -> None:
    supervisor = Supervisor(SafetyLimits())
    edge_since_disarmed = False
    for index, seen in enumerate(history):
        supervisor.update(seen, index * TICK_NS)
        edge_since_disarmed |= seen.arm_edge
        if supervisor.demand is Demand.CONTROL:
            assert supervisor.mode is Mode.ACTIVE
            assert edge_since_disarmed
            assert seen.armed
            assert not seen.stop
            assert seen.motion_age_ns <= 30 * MILLISECOND_NS
            assert not any((seen.link_lost, seen.high_level, seen.drive_fault))
        elif not supervisor.arming:
            edge_since_disarmed = False
