"""A pump drive that canopen plays, with a motor of its own, in the place of the emulated one."""

from functools import cache
from pathlib import Path

import numpy as np
import pytest

from firmware_sim.scenario import Scenario
from firmware_sim.ship_side import build_ship_side
from tests.canopen_motor import FAULT, OFF, RUNS, MotorNode
from utank_hil.assembly import build_commissioning_node, build_controller_node
from utank_hil.base.tick import TICK_NS
from utank_hil.canbus import Fault, Frame, Mode
from utank_hil.canbus.frame import BUS_SHIFT, STANDARD
from utank_hil.configuration import ControllerConfig, load_config
from utank_hil.configuration.devices import DevicesSection
from utank_hil.nodes.commissioning.node import REST_S, Stage
from utank_hil.nodes.panel import Action, TimedAction
from utank_hil.runners import Lockstep, SimulatedBus
from utank_hil.runners.lockstep import with_more

SECOND = 1_000_000_000
DRIVE = {
    "profile": "cia402", "bus": "can1", "node": 5, "mode": "torque", "pressure_pa_per_unit": 80,
    "speed_rad_s_per_unit": 0.001, "identity": [0x11, 0x22, None, 0x44],
}  # fmt: skip
STORM = load_config(Path("configs/scenarios/storm.yaml"), Scenario)
PRESSED_PA, STOPPED_PA = 20e3, 2.5e3  # the second is a twentieth of the greatest


@cache
def config(torque):
    loaded = load_config(Path("configs/controllers/gpc.yaml"), ControllerConfig)
    drive = DRIVE if torque else DRIVE | {"mode": "velocity"}
    changes = {"devices": DevicesSection(pump=drive), "emulated": False}
    return loaded.model_copy(update={"vessel": loaded.vessel.model_copy(update=changes)})


class Bench:
    """Ship and controller with a drive of another maker on a bus of its own."""

    def __init__(self, scenario, build, *actions, torque=True):
        controller = config(torque)
        scenario = scenario.model_copy(update={"vessel": controller.vessel})
        self.ship = build_ship_side(scenario, 1, tuple(TimedAction(*each) for each in actions))
        self.node, tag = build(controller), 1 << BUS_SHIFT | STANDARD
        self.drive = MotorNode(
            lambda can_id, data: Frame(tag | can_id, data), TICK_NS,
            lambda: self.ship.plant.flow_m3_s, torque=torque,
        )  # fmt: skip
        self.motor = self.drive.motor
        rest = self.ship.without(["drive"]) if torque else self._pressed()
        self.run = Lockstep(
            [*rest, self.drive, self.node],
            with_more(SimulatedBus(), 1, 250_000),
        )

    def _pressed(self):
        """Nodes without the drive, and the ship with the pressure of the motor's pump."""
        tick = self.ship.sensors.tick

        def ticks(now_ns):
            self.ship.plant.advance(now_ns)
            self.ship.plant.impose_pressure(self.motor.pressure_pa)
            return tick(now_ns)

        self.ship.sensors.tick = ticks
        return [node for node in self.ship.nodes if node.name != "drive"]

    def to(self, seconds):
        rolls = []
        while self.run.now_ns < round(seconds * SECOND):
            self.run.run_until(self.run.now_ns + TICK_NS)
            rolls.append(self.ship.plant.roll_rad)
        return np.array(rolls)

    def until(self, so, within_s=2.0):
        """Time in ms until something is so."""
        begin_ns = self.run.now_ns
        while not so():
            assert self.run.now_ns - begin_ns < within_s * SECOND
            self.run.run_until(self.run.now_ns + TICK_NS)
        return (self.run.now_ns - begin_ns) / 1e6


def at_sea(action=Action.ARM, *, torque=True):
    return Bench(
        STORM, lambda each: build_controller_node(each, commissioned=True), (5.0, action),
        torque=torque,
    )  # fmt: skip


def under_pressure():
    bench = at_sea()
    bench.to(20)
    bench.until(lambda: abs(bench.motor.pressure_pa) > PRESSED_PA, 30)
    assert bench.node.mode is Mode.ACTIVE
    return bench


@pytest.mark.parametrize("torque", [True, False])
def test_it_passes_the_commissioning(torque):
    """A drive for speed has no object of torque at all."""
    quay = Scenario.model_validate(
        {
            "name": "quay", "vessel": STORM.vessel, "controllers": STORM.controllers,
            "sea": {"kind": "regular", "amplitude_m": 0.0, "period_s": 10.0},
            "duration_s": 300.0, "settle_s": 0.0, "operator": (TimedAction(30.0, Action.ARM),),
        }
    )  # fmt: skip
    bench = Bench(quay, build_commissioning_node, (REST_S + 6, Action.ARM), torque=torque)
    while bench.node.stage is not Stage.DONE:
        assert bench.run.now_ns < 200 * SECOND
        bench.run.run_until(bench.run.now_ns + SECOND)
    checks = bench.node.checks()
    assert (bench.node.ended, [each for each in checks if not each.passed]) == ("", [])
    measured = {each.name: each.measured for each in checks}
    assert measured["drive_speed"] == pytest.approx(1.0, abs=0.06)  # its own pump, its own speed
    assert 0 < measured["stop_ms"] < 150


@pytest.mark.slow
@pytest.mark.parametrize("torque", [True, False])
def test_the_ship_rolls_less_for_minutes_and_a_stop_stops_it(torque):
    bench, passive = at_sea(torque=torque), at_sea(Action.PASSIVE, torque=torque)
    roll, without = bench.to(60), passive.to(60)  # both settle
    roll, without = bench.to(240), passive.to(240)
    assert (bench.node.mode, passive.node.mode) == (Mode.ACTIVE, Mode.PASSIVE)
    print(f"roll RMS {np.std(roll):.4f} rad, passive {np.std(without):.4f} rad")
    assert np.std(roll) < 0.8 * np.std(without)
    bench.until(lambda: abs(bench.motor.pressure_pa) > PRESSED_PA, 30)
    bench.ship.panel.press(Action.STOP)
    stopped_ms = bench.until(lambda: abs(bench.motor.pressure_pa) < STOPPED_PA)
    print(f"after a stop {stopped_ms} ms to a twentieth")
    assert stopped_ms <= 250
    bench.to(bench.run.now_ns / SECOND + 1)
    assert (bench.node.mode, bench.motor.state) == (Mode.STANDBY, OFF)


def test_a_drive_is_not_called_silent_by_a_message_it_may_not_send_yet():
    """It has no power for 13 s, and is then configured for two."""
    bench = at_sea()
    bench.drive.killed = True
    bench.to(13)
    heard = bench.node.inbox
    assert bench.node.safety.alarms.codes == {Fault.DRIVE_SILENT}
    assert "node 5: 1000h:0 can't be read" in heard.received(Fault.DRIVE_SILENT)
    bench.drive.killed = False
    bench.until(lambda: bench.node.mode is not Mode.INIT, 6)
    bench.to(bench.run.now_ns / SECOND + 1)
    assert bench.node.safety.alarms.codes == {Fault.DRIVE_SILENT}


def killed(bench):
    bench.drive.killed = True


def unplugged(bench):
    bench.drive.unplugged = True


@pytest.mark.parametrize(
    ("what", "fault", "found_ms", "zero_ms"),
    [
        (killed, Fault.DRIVE_SILENT, 70, None),  # a drive without power presses off
        (unplugged, Fault.DRIVE_SILENT, 70, 150),  # it stops by itself: 50 ms, and braking
        ("drop", Fault.DRIVE_SILENT, 120, 350),
        ("deaf", Fault.DRIVE_SILENT, 120, 350),
        ("mute", Fault.DRIVE_SILENT, 160, 250),
        ("trip 3210", Fault.DRIVE_FAULT, 40, 100),
    ],
)
def test_what_goes_wrong_is_found_and_ends_at_zero(what, fault, found_ms, zero_ms):
    bench = under_pressure()
    if callable(what):
        what(bench)
    else:
        bench.motor.tell(what)
    begin_ns = bench.run.now_ns
    found = bench.until(lambda: bench.node.mode is Mode.FAULT)
    dropped_s = bench.motor.first_dropped_s
    assert bench.node.fault is fault
    assert found <= found_ms
    zero = "-"
    if zero_ms is not None:
        bench.until(lambda: abs(bench.motor.pressure_pa) < STOPPED_PA)
        zero = (bench.run.now_ns - begin_ns) / 1e6
        assert zero <= zero_ms
    print(f"{what}: found after {found} ms, a twentieth of the pressure after {zero} ms")
    if what in ("drop", "deaf"):  # the first PDO that was lost is what counts
        assert begin_ns / 1e9 + found / 1e3 - dropped_s <= 0.1
    if "trip" in str(what):
        said = "emergency 3210h (voltage), register 0x81"
        bench.to(bench.run.now_ns / SECOND + 0.1)
        assert bench.node.inbox.received(fault) == f"node 5: status word 0x0218, {said}"
        assert bench.motor.state == FAULT
        assert bench.node.inbox.received(Fault.DEVICE_ERROR) == f"pump: node 5: {said}"


def test_an_emergency_alarms_and_stops_nothing():
    bench = under_pressure()
    bench.motor.tell("emcy 4210")
    assert bench.until(lambda: Fault.DEVICE_ERROR in bench.node.safety.alarms.codes) <= 120
    bench.to(bench.run.now_ns / SECOND + 5)
    assert (bench.node.mode, bench.motor.state) == (Mode.ACTIVE, RUNS)
    said = bench.node.inbox.received(Fault.DEVICE_ERROR)
    assert said == "pump: node 5: emergency 4210h (temperature), register 0x81"
    bench.motor.tell("well")
    bench.to(bench.run.now_ns / SECOND + 1)
    assert not bench.node.measured.device_error


def test_a_second_drive_with_its_number_ends_it_and_the_alarm_names_the_message():
    bench, told = under_pressure(), {}
    bench.node.telemetry.tell = lambda event, _: told.update({event.code: event.received})
    other = Frame(1 << BUS_SHIFT | STANDARD | 0x185, bytes((0x37, 0x02, 0x0F, 0, 0, 0)))
    for _ in range(50):
        bench.node.receive(other, bench.run.now_ns)
        bench.to(bench.run.now_ns / SECOND + 0.02)
    assert (bench.node.mode, bench.node.fault) == (Mode.FAULT, Fault.FOREIGN_SENDER)
    assert told[Fault.FOREIGN_SENDER] == "pump: TPDO1 0x185 on can1"
    assert abs(bench.motor.pressure_pa) < STOPPED_PA


def test_an_emergency_after_another_is_told_too():
    """Else the alarm of the first would hide it for as long as it lasts, and ten seconds more."""
    bench, told = under_pressure(), []
    bench.node.telemetry.tell = lambda event, _: told.append((event.code, event.received))
    for words in ("emcy 8130", "emcy 4210", "well", "emcy 8130", "emcy 4210"):
        bench.motor.tell(words)
        bench.to(bench.run.now_ns / SECOND + 1)
    kinds = ("8130h (monitoring)", "4210h (temperature)")
    said = [f"pump: node 5: emergency {kind}, register 0x81" for kind in kinds]
    assert told == [(Fault.DEVICE_ERROR, each) for each in said]
