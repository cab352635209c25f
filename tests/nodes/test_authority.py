"""Who may arm, take the command and stop: only what is live, and of the right version."""

import pytest
from controller_bench import CATALOGUE, ControllerBench
from test_stations import IDLE, Bench

from utank_hil.canbus import (
    Address,
    DriveStatus2,
    Fault,
    HardwiredInputs,
    Heartbeat,
    Mode,
    OperatorCommand,
    Quality,
    Station,
    Switch,
)
from utank_hil.nodes.redundancy import Redundancy

SECOND = Redundancy(second_station=True)
ORDER = {"arm": True, "mode_request": Mode.ACTIVE, "take_command": True}


def under_pressure(redundancy):
    bench = Bench(redundancy)
    bench.second = IDLE
    bench.drive_at(20e3)
    return bench


def test_a_station_that_no_file_declares_takes_no_command_but_can_stop():
    bench = under_pressure(Redundancy())
    bench.second_is(**ORDER)
    assert bench.station is Station.OPERATOR
    bench.second_is(stop=True)
    bench.run(20)
    assert (bench.node.mode, bench.pressure_pa) == (Mode.STANDBY, 0.0)


@pytest.mark.parametrize("wrong", ["silent", "version"])
def test_a_station_takes_the_command_only_live_and_of_the_right_version(wrong):
    bench = under_pressure(SECOND)
    if wrong == "silent":
        bench.second_beats = False
        bench.run(700)
    else:
        bench.second_versions = (CATALOGUE.version, 1)
        bench.run(300)
    bench.second_is(**ORDER)
    assert bench.station is Station.OPERATOR
    assert bench.node.mode is Mode.ACTIVE
    bench.second_is(take_command=False)
    bench.second_beats, bench.second_versions = True, bench.versions
    bench.run(400)
    bench.second_is(take_command=True)
    assert bench.station is Station.OPERATOR_2
    assert bench.node.mode is Mode.ACTIVE


def test_disarming_at_the_station_that_lost_the_command_still_disarms():
    bench = under_pressure(SECOND)
    bench.second_is(**ORDER)
    assert bench.station is Station.OPERATOR_2
    assert bench.node.mode is Mode.ACTIVE
    bench.order_is(arm=False)
    bench.run(1200)
    assert bench.node.mode is not Mode.ACTIVE
    assert bench.pressure_pa == 0.0


def test_a_panel_that_is_not_alive_does_not_arm():
    """Its heartbeat matters at the edge and until ACTIVE, not that it once was there."""
    bench = ControllerBench()
    bench.run(1000)
    bench.silent.add(Heartbeat)
    bench.run(1000)
    bench.order_is(arm=True, mode_request=Mode.ACTIVE)
    bench.run(1000)
    assert bench.node.mode is Mode.STANDBY
    assert bench.node.fault is Fault.OPERATOR_SILENT


def test_versions_grow_old_under_pressure():
    bench = ControllerBench()
    bench.drive_at(10e3)
    bench.silent.add(Heartbeat)
    bench.run(4900)
    assert bench.node.mode is Mode.ACTIVE
    bench.run(300)
    assert bench.node.mode is Mode.FAULT
    assert bench.node.fault is Fault.VERSION_MISMATCH


@pytest.mark.parametrize("declared", [False, True])
def test_hard_wired_inputs_are_obeyed_whenever_they_are_heard(declared):
    bench = ControllerBench(redundancy=Redundancy(hardwired_inputs=declared))
    sender = CATALOGUE.transmitter(HardwiredInputs)
    for stop, high, fault in (
        (Switch.ON, Switch.OFF, Fault.HARDWIRED_STOP),
        (Switch.OFF, Switch.ON, Fault.LEVEL_LIMIT),
    ):
        bench = ControllerBench()
        bench.drive_at(10e3)
        bench.send(sender.frame(HardwiredInputs(high, Switch.OFF, stop, Quality.GOOD)))
        bench.send(sender.frame(HardwiredInputs(high, Switch.OFF, stop, Quality.GOOD)))
        bench.run(20)
        assert (bench.node.mode, bench.node.fault, bench.pressure_pa) == (Mode.FAULT, fault, 0.0)


def test_the_absence_of_hard_wired_inputs_is_judged_where_they_are_declared():
    bench = ControllerBench(redundancy=Redundancy(hardwired_inputs=True))
    bench.run(1000)
    assert bench.node.fault is not Fault.NONE
    assert bench.node.mode is Mode.INIT


def test_a_drive_whose_faults_were_never_heard_is_not_ready():
    bench = ControllerBench()
    bench.silent.add(DriveStatus2)
    bench.run(1000)
    assert (bench.node.mode, bench.node.fault) == (Mode.INIT, Fault.DRIVE_SILENT)
    bench.silent.clear()
    bench.run(200)
    assert bench.node.mode is Mode.STANDBY


def test_orders_without_a_panel_s_heartbeat_take_nothing():
    """Two bare frames of a second station took the command under pressure."""
    bench = under_pressure(SECOND)
    bench.second_beats = False
    bench.run(1000)
    sender = CATALOGUE.transmitter(OperatorCommand, Address.OPERATOR_2)
    for take in (False, True):
        order = OperatorCommand(Mode.ACTIVE, True, False, False, False)
        bench.send(sender.frame(order._replace(take_command=take)))
        bench.run(20)
    assert bench.station is Station.OPERATOR
