"""The fault table, the enumeration and the DBC have the same codes."""

import itertools
import math
from dataclasses import replace
from pathlib import Path

import pytest
from cantools.database.can import Database
from hypothesis import given
from hypothesis import strategies as st
from situations import situation

from utank_hil.canbus import Fault
from utank_hil.canbus.catalogue import DBC_PATH
from utank_hil.safety import judging
from utank_hil.safety.faults import FAULTS, ROLL_CALM_S, Reaction, fault_text
from utank_hil.safety.safety_limits import SafetyLimits

NOT_AVAILABLE = 255

#: Declared, so that finding them needs no other catalogue. A row for one takes it from here.
RESERVED = {
    Fault.COUNTER_FROZEN,
}  # fmt: skip


def test_each_code_of_the_dbc_has_one_row_or_is_reserved_and_each_row_has_a_code():
    database = Database()
    database.add_dbc_file(DBC_PATH)
    signal = database.get_message_by_name("CTRL_STATUS").get_signal_by_name("fault")
    codes = {int(value): str(name) for value, name in signal.choices.items()}
    assert codes.pop(Fault.NONE) == "NONE"
    assert codes.pop(NOT_AVAILABLE) == "NOT_AVAILABLE"
    rows = [row.code for row in FAULTS]
    assert codes == {code.value: code.name for code in (*rows, *RESERVED)}
    assert len(rows) + len(RESERVED) == len(codes)


def test_people_read_what_happened_and_what_to_do():
    for row in FAULTS:
        assert fault_text(row.code) == f"{row.code.name}: {row.happened} {row.remedy}"
        assert row.happened.endswith(".")
        assert row.remedy.endswith(".")
    assert fault_text(Fault.NONE) == "NONE"


def documented():
    """Fault, reaction, and whether it keeps the controller in INIT, by docs/safety.md."""
    lines = Path("docs/safety.md").read_text(encoding="utf-8").splitlines()
    begin = lines.index("| fault | found by | reaction | keeps the controller in INIT |") + 2
    name = ""
    for line in itertools.takewhile(str, lines[begin:]):
        fault, _, reaction, waits = (cell.strip() for cell in line.split("|")[1:-1])
        name = fault.split(" ")[0] or name
        yield name, reaction, waits == "yes"


def test_what_each_condition_does_is_what_the_documentation_says():
    found = [
        (
            fault.name,
            each.reaction.value.format(zero_within_ms=each.zero_within_ms),
            each.awaited is not None,
        )
        for fault, each in judging.CONDITIONS
    ]
    assert found == list(documented())


def test_in_init_it_waits_for_the_bus_then_sensors_drive_valve_versions_and_wires():
    waits, left = [], judging.AWAITED
    while (first := judging.first_awaited(left)) is not None:
        waits.append(first[0].name)
        left &= ~(1 << judging.CONDITIONS.index(first))
    assert waits == [
        "BUS_LOST", "ADDRESS_CONFLICT", "MOTION_SILENT", "TANK_SILENT", "PUMP_SENSOR_SILENT",
        "DRIVE_SILENT", "VALVE_SILENT", "VERSION_MISMATCH", "HARDWIRED_SILENT",
    ]  # fmt: skip


def test_passive_is_ended_by_a_pump_that_presses_against_zero_and_by_the_hard_wired_stop():
    ending = judging.faults(judging.ENDING_PASSIVE)
    assert ending == {Fault.HARDWIRED_STOP, Fault.SIGN_FLIP, Fault.DRIVE_NOT_FOLLOWING}
    assert judging.ENDING_PASSIVE.bit_count() == 3
    assert judging.faults(judging.DRIVE_OUT) == {Fault.DRIVE_FAULT}
    assert count(drive_out_ms=41.0) == judging.DRIVE_OUT.bit_count() == 1
    assert judging.standing(situation(drive_out_ms=41.0), LIMITS) == judging.DRIVE_OUT


@given(st.integers(0, (1 << len(judging.CONDITIONS)) - 1))
def test_of_several_conditions_the_first_of_the_table_is_named_and_all_their_faults(bits):
    hold = [each for place, each in enumerate(judging.CONDITIONS) if bits >> place & 1]
    assert judging.first(bits) == (hold[0] if hold else None)
    assert judging.faults(bits) == {fault for fault, _ in hold}


def test_each_condition_has_its_own_bit():
    for place, (fault, _) in enumerate(judging.CONDITIONS):
        assert judging.first(1 << place) is judging.CONDITIONS[place]
        assert judging.faults(1 << place) == {fault}


def test_a_code_without_a_row_has_its_name_alone():
    assert fault_text(Fault.COUNTER_FROZEN) == "COUNTER_FROZEN"


LIMITS = SafetyLimits()
LIMITED = {
    "motion_age_ms": [LIMITS.motion_age_ms],
    "spare_age_ms": [LIMITS.motion_spare_age_ms],
    "hardwired_age_ms": [LIMITS.hardwired_age_ms],
    "tank_age_ms": [LIMITS.tank_degraded_age_ms, LIMITS.tank_age_ms],
    "pump_age_ms": [LIMITS.pump_degraded_age_ms, LIMITS.pump_age_ms],
    "forecast_age_ms": [LIMITS.forecast_age_ms],
    "drive_age_ms": [LIMITS.drive_age_ms],
    "echo_age_ms": [LIMITS.echo_age_ms],
    "drive_out_ms": [LIMITS.drive_enabled_within_ms],
    "arming_ms": [LIMITS.arming_timeout_ms],
    "valve_age_ms": [LIMITS.valve_age_ms],
    "valve_echo_age_ms": [LIMITS.valve_echo_age_ms],
    "valve_out_ms": [LIMITS.valve_follows_within_ms],
    "valve_off_ms": [LIMITS.valve_off_within_ms],
    "panel_age_ms": [LIMITS.panel_age_to_arm_ms, LIMITS.panel_age_armed_ms],
    "roll_rad": [LIMITS.roll_limit_rad],
    "heel_rad": [LIMITS.heel_limit_rad],
    "bus_load": [LIMITS.bus_load_limit],
}
"""What is judged, and its limits: beyond each one condition more holds."""


def count(limits=LIMITS, **changes):
    return judging.standing(situation(**changes), limits).bit_count()


@pytest.mark.parametrize("name", LIMITED)
def test_a_condition_holds_beyond_its_limit_and_not_at_it(name):
    signs = (1, -1) if name in ("roll_rad", "heel_rad") else (1,)
    for sign, limit in itertools.product(signs, LIMITED[name]):
        beyond = math.nextafter(limit, math.inf)
        assert count(**{name: sign * beyond}) == count(**{name: sign * limit}) + 1


def test_a_roll_or_heel_that_is_no_number_is_beyond_every_limit():
    assert count() == 0
    assert min(count(roll_rad=math.nan), count(heel_rad=math.nan)) > 0


def test_late_ticks_and_a_roll_that_was_beyond_its_limit_hold_at_theirs():
    assert count(tick_late_ms=math.nextafter(LIMITS.long_overrun_ms, 0.0)) == 0
    assert count(tick_late_ms=LIMITS.long_overrun_ms) == 1
    assert [count(overruns_in_ten=late) for late in range(5)] == [0, 1, 1, 2, 2]
    unjudged = replace(LIMITS, overruns_in_ten=None)
    assert [count(unjudged, overruns_in_ten=late) for late in (0, 1, 10)] == [0, 1, 1]
    assert count(rolled_over_ms=1e3 * ROLL_CALM_S) == 0
    assert count(rolled_over_ms=math.nextafter(1e3 * ROLL_CALM_S, 0.0)) == 1


@pytest.mark.parametrize(
    ("name", "fault", "reaction"),
    [
        ("law_passed_limit", Fault.HEEL_LIMIT, Reaction.WARN),
        ("gm_low", Fault.STABILITY_LOW, Reaction.WARN),
        ("drive_warns", Fault.DRIVE_WARNING, Reaction.WARN),
        ("device_error", Fault.DEVICE_ERROR, Reaction.WARN),
        ("doubts_forecast", Fault.FORECAST_IGNORED, Reaction.WARN),
        ("commissioned", Fault.NOT_COMMISSIONED, Reaction.REFUSE),
    ],
)
def test_what_is_said_but_ends_nothing(name, fault, reaction):
    bits = judging.standing(situation(**{name: name != "commissioned"}), LIMITS)
    assert bits.bit_count() == 1
    first = judging.first(bits)
    assert first is not None
    assert (first[0], first[1].reaction) == (fault, reaction)
