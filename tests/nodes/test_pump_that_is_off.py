"""A pump that presses while nothing commands it, in every mode in which its drive is off."""

import pytest
from controller_bench import ControllerBench, new_monitors

from utank_hil.canbus import (
    ControlWord,
    DriveFault,
    DriveState,
    Fault,
    Mode,
    Quality,
    SensorMotion,
    SensorPump,
)

PRESSING = SensorPump(9e3, 0.0, Quality.GOOD)
CODE = Fault.DRIVE_NOT_FOLLOWING
START_MS = 12_000  # what is awaited at the start is no alarm before


def bench():
    table = ControllerBench(monitors=new_monitors())
    table.run(400)
    return table


def test_in_standby_it_raises_an_alarm_and_refuses_to_arm_while_it_lasts():
    table = bench()
    assert table.node.mode is Mode.STANDBY
    table.pump = PRESSING
    table.run(700)
    assert CODE in table.node.safety.alarms.codes
    assert table.word is ControlWord.DISABLE_VOLTAGE
    table.order_is(mode_request=Mode.ACTIVE, arm=True)
    table.run(400)
    assert (table.node.mode, table.node.fault) == (Mode.STANDBY, CODE)
    table.order_is(arm=False)
    table.pump = SensorPump(0.0, 0.0, Quality.GOOD)
    table.run(200)
    table.order_is(arm=True)
    table.run(400)
    assert table.node.mode is Mode.ACTIVE


def test_it_raises_an_alarm_while_the_controller_still_waits_for_something_else():
    table = bench()
    table.silent = {SensorMotion}
    table.run(START_MS)
    assert table.node.mode is Mode.INIT
    assert CODE not in table.node.safety.alarms.codes
    table.pump = PRESSING
    table.run(700)
    assert CODE in table.node.safety.alarms.codes


def test_after_a_fault_it_is_a_second_one_and_keeps_the_first_from_being_reset():
    table = bench()
    table.order_is(mode_request=Mode.ACTIVE, arm=True)
    table.run(400)
    assert table.node.mode is Mode.ACTIVE
    table.drive_fault = DriveFault.OVERCURRENT
    table.pump = PRESSING
    table.run(2000)
    assert (table.node.mode, table.node.fault) == (Mode.FAULT, Fault.DRIVE_FAULT)
    assert CODE in table.node.safety.alarms.codes
    table.drive_fault = DriveFault.NONE
    table.order_is(reset=True, arm=False)
    table.run(1000)
    assert table.node.mode is Mode.FAULT
    assert table.node.safety.supervisor.reset_refused_by is CODE


def test_a_ship_without_a_pump_has_no_drive_that_stays_on():
    table = ControllerBench(pump=False)
    table.run(1500)
    assert Fault.DRIVE_FAULT not in table.node.safety.alarms.codes


@pytest.mark.parametrize("state", [DriveState.OPERATION_ENABLED, DriveState.QUICK_STOP_ACTIVE])
def test_a_drive_that_no_quick_stop_takes_out_of_operation_is_told_to_be_off(state):
    table = bench()
    table.drive_follows, table.drive_state = False, state
    table.run(100)
    assert table.word is ControlWord.QUICK_STOP
    assert Fault.DRIVE_FAULT not in table.node.safety.alarms.codes
    table.run(900)
    assert table.word is ControlWord.DISABLE_VOLTAGE
    # it does not hear that either: nobody can take its pressure away
    assert Fault.DRIVE_FAULT in table.node.safety.alarms.codes
    table.order_is(mode_request=Mode.ACTIVE, arm=True)
    table.run(400)
    assert (table.node.mode, table.node.fault) == (Mode.STANDBY, Fault.DRIVE_FAULT)
    table.order_is(arm=False)
    table.drive_follows, table.drive_state = True, DriveState.SWITCH_ON_DISABLED
    table.run(400)
    table.order_is(arm=True)
    table.run(400)
    assert table.node.mode is Mode.ACTIVE
