"""The emulated CiA 402 drive, by canopen as its master, and on the bench."""

from pathlib import Path

import canopen
import numpy as np
import pytest
import yaml

from firmware_sim.canopen_drive import CanopenPumpDrive, control_word
from firmware_sim.fault_injection.bench_parts import Bench as Bench_
from firmware_sim.fault_injection.bench_parts import FaultyNode
from firmware_sim.fault_injection.nodes import Pump
from firmware_sim.scenario import Scenario
from firmware_sim.ship_side import build_ship_side
from tests.canopen_nodes import dictionary
from tests.firmware_sim.drive_bench import VESSEL, calm_plant
from tests.nodes.canopen_peers import PROFILE
from utank_hil.assembly import build_controller_node
from utank_hil.base.tick import TICK_NS
from utank_hil.canbus import ControlWord, DriveState, Fault, Frame, Mode
from utank_hil.canbus.frame import BUS_SHIFT, STANDARD
from utank_hil.canbus.profiles.drive_plan import Place
from utank_hil.configuration import load_config
from utank_hil.configuration.device_sections import DriveSection
from utank_hil.configuration.devices import DevicesSection
from utank_hil.nodes.canopen_drive import state_of
from utank_hil.runners import Lockstep, SimulatedBus
from utank_hil.runners.lockstep import with_more

SECOND_NS = 1_000_000_000
MS = 1_000_000


class Master(canopen.Network):
    """canopen's master on a wire to the emulated drive."""

    def __init__(self, mode="velocity"):
        super().__init__()
        plan = DriveSection(**(PROFILE | {"mode": mode})).plan(0, VESSEL.pump)
        self.drive = CanopenPumpDrive(calm_plant(), VESSEL.pump, plan)
        self.heard, self.now_ns = [], 0
        self.remote = self.add_node(5, dictionary())
        self.remote.sdo.RESPONSE_TIMEOUT = 0.05

    def send_message(self, can_id, data, remote=False):
        assert not remote
        self.drive.receive(Frame(can_id | STANDARD, bytes(data)), self.now_ns)
        self._hear(self.drive._out)
        self.drive._out = []

    def _hear(self, frames):
        for frame in frames:
            can_id = frame.can_id & 0x7FF
            self.heard.append((self.now_ns, can_id, frame.data))
            self.notify(can_id, bytearray(frame.data), self.now_ns * 1e-9)

    def run(self, ticks, beat=False):
        for k in range(ticks):
            if beat and k % 2 == 0:
                self.send_message(0x77F, [5])
            self._hear(self.drive.tick(self.now_ns))
            self.now_ns += TICK_NS
        return self

    def command(self, word, value=0):
        pdo = self.remote.rpdo[1]
        pdo[0x6040].raw, pdo[1].raw = word, value
        pdo.transmit()
        self.run(2, beat=True)
        return state_of(self.remote.sdo[0x6041].raw)

    def enable(self, **entries):
        """Map by canopen's own PDO configuration, start, and lead to operation."""
        remote = self.remote
        remote.nmt.state = "PRE-OPERATIONAL"
        remote.sdo[0x6060].raw = 3
        for key, value in entries.items():
            remote.sdo[int(key[1:], 16)].raw = value
        remote.sdo[0x1016][1].raw = 127 << 16 | 50
        remote.rpdo.read()
        remote.rpdo[1].clear()
        remote.rpdo[1].add_variable(0x6040)
        remote.rpdo[1].add_variable(0x60FF)
        remote.rpdo[1].trans_type, remote.rpdo[1].enabled = 255, True
        remote.rpdo[1].save()
        remote.nmt.state = "OPERATIONAL"
        return [self.command(word) for word in (0x06, 0x07, 0x0F)]


@pytest.fixture
def master():
    made = Master()
    speed = canopen.objectdictionary.ODVariable("speed", 0x60FF)
    speed.data_type = canopen.objectdictionary.INTEGER32
    made.remote.object_dictionary.add_object(speed)
    return made.run(1)


def test_a_master_maps_starts_and_enables_it(master):
    assert master.enable() == [
        DriveState.READY_TO_SWITCH_ON, DriveState.SWITCHED_ON, DriveState.OPERATION_ENABLED,
    ]  # fmt: skip
    master.command(0x0F, 12_000)
    master.run(100, beat=True)
    assert master.remote.sdo[0x606C].raw == pytest.approx(12_000, rel=0.01)
    assert master.drive._plant.pressure_pa > 1e3
    assert master.command(0x02) is DriveState.QUICK_STOP_ACTIVE
    master.run(60, beat=True)
    assert abs(master.drive._plant.pressure_pa) < 1e3
    assert not master.drive.enabled


def test_it_sends_at_sync_what_a_master_maps(master):
    tpdo = master.remote.tpdo
    master.remote.nmt.state = "PRE-OPERATIONAL"
    tpdo[1].read()
    tpdo[1].clear()
    tpdo[1].add_variable(0x6041)
    tpdo[1].add_variable(0x6061)
    tpdo[1].trans_type, tpdo[1].enabled = 1, True
    tpdo[1].save()
    master.remote.nmt.state = "OPERATIONAL"
    for _ in range(3):
        master.sync.transmit()
    assert len([1 for _, can_id, data in master.heard if (can_id, len(data)) == (0x185, 3)]) == 3
    assert tpdo[1][0x6041].raw == 0x250


@pytest.mark.parametrize(
    ("index", "subindex", "data", "code"),
    [
        (0x1018, 1, b"\0\0\0\0", 0x06010002),
        (0x5000, 0, b"\0", 0x06020000),
        (0x1018, 9, b"\0", 0x06090011),
        (0x6007, 0, b"\0", 0x06070010),
        (0x1A00, 1, b"\x08\x00\x41\x60", 0x06040041),
        (0x1400, 1, b"\x06\x02\0\0", 0x06090030),
    ],
)
def test_it_refuses_by_the_standards_codes(master, index, subindex, data, code):
    with pytest.raises(canopen.SdoAbortedError) as caught:
        master.remote.sdo.download(index, subindex, data)
    assert caught.value.code == code


@pytest.mark.parametrize(("code", "braked"), [(3, True), (2, False), (0, False), (1, True)])
def test_without_the_masters_heartbeat_it_does_what_6007h_says(master, code, braked):
    master.enable(x6007=code)
    master.command(0x0F, 12_000)
    master.run(100, beat=True)
    pressure_pa = master.drive._plant.pressure_pa
    lost_ns = master.now_ns
    while abs(master.drive._plant.pressure_pa) > 0.05 * pressure_pa:
        master.run(1)
        if master.now_ns - lost_ns > 250 * MS:
            break
    assert (master.now_ns - lost_ns <= 130 * MS) is braked
    assert master.drive.enabled is (code == 0)
    lost = [data[:2] for _, can_id, data in master.heard if can_id == 0x85]
    assert lost == ([b"\x30\x81"] if code else [])


def test_without_power_it_has_no_torque_and_no_word_turns_it_on(master):
    master.enable()
    master.command(0x0F, 12_000)
    master.run(100, beat=True)
    plant, before_pa = master.drive._plant, master.drive._plant.pressure_pa
    plant.cut_power("hardwired", cut=True)
    master.run(2, beat=True)
    assert (master.drive.enabled, master.drive._torque_nm) == (False, 0.0)
    assert not master.remote.sdo[0x6041].raw & 1 << 4  # voltage
    states = [master.command(word) for word in (0x06, 0x07, 0x0F)]
    assert DriveState.OPERATION_ENABLED not in states
    master.run(300, beat=True)
    assert abs(plant.pressure_pa) < 0.2 * before_pa  # the water turns the rotor
    plant.cut_power("hardwired", cut=False)
    master.run(2, beat=True)
    assert [master.command(word) for word in (0x06, 0x07, 0x0F)][-1] is DriveState.OPERATION_ENABLED


@pytest.mark.parametrize(("off_too", "enabled"), [(False, True), (False, False), (True, False)])
def test_a_broken_pump_presses_as_the_fault_says(master, off_too, enabled):
    fault = Pump(kind="pump", times=-1, plus_pa=500, off_too=off_too)
    master.enable()
    master.command(0x0F, 12_000)
    master.run(100, beat=True)
    if not enabled:
        master.command(0x06)
    node = FaultyNode(master.drive)
    fault.place(Bench_({"drive": node}, master.drive._plant, master.drive, None, 0), 0, 0)
    for _ in range(5):
        own_pa = master.drive._own_pa  # the plant is a tick behind
        list(node.tick(master.now_ns))
        master.now_ns += TICK_NS
    pressure_pa = master.drive._plant.pressure_pa
    assert own_pa > 1e3
    wrong = enabled or off_too
    assert pressure_pa == pytest.approx(500 - own_pa if wrong else own_pa, rel=0.02)


def test_an_order_of_the_network_that_is_none_changes_nothing(master):
    master.run(3)
    before = master.drive.state
    master.send_message(0, [0x7F, 5])
    assert master.drive.state is before


def test_control_words_are_judged_by_their_bits():
    assert control_word(0x0F) is ControlWord.ENABLE_OPERATION
    assert control_word(0x010F) is ControlWord.ENABLE_OPERATION
    assert control_word(0x0D) is ControlWord.DISABLE_VOLTAGE
    assert control_word(0x0B) is ControlWord.QUICK_STOP
    assert control_word(0x8F) is ControlWord.FAULT_RESET


DRIVE = PROFILE | {"bus": "can1", "identity": [1, 2, 3, 4]}


class Bench:
    """The storm with the law, and the pump by a drive of another maker on its own bus."""

    def __init__(self, pump):
        scenario = load_config(Path("configs/scenarios/storm.yaml"), Scenario)
        devices = None if pump is None else DevicesSection(pump=pump)
        vessel = scenario.vessel.model_copy(update={"devices": devices})
        config = scenario.controllers["gpc"].model_copy(update={"vessel": vessel})
        scenario = scenario.model_copy(update={"vessel": vessel})
        self.ship = build_ship_side(scenario, 1, scenario.operator)
        self.node = build_controller_node(config, commissioned=True)
        more = len(vessel.foreign.buses) - 1
        self.lost = lambda sender, can_id: False
        self._bus = with_more(SimulatedBus(), more, 250_000)
        queue = self._bus.queue

        def send(sender, frame, now_ns):
            if not self.lost(sender, frame.can_id & 0x7FF if frame.can_id & STANDARD else 0):
                queue(sender, frame, now_ns)

        self._bus.queue = send
        self.run = Lockstep([*self.ship.nodes, self.node], self._bus)

    def rolls(self, seconds):
        found = []
        for _ in range(round(50 * seconds)):
            self.run.run_until(self.run.now_ns + SECOND_NS // 50)
            found.append((self.ship.plant.roll_rad, self.node.command_pa,
                          self.ship.plant.pressure_pa))  # fmt: skip
        return np.array(found)

    def until_zero(self, seconds=1.0):
        """Milliseconds until a twentieth of the greatest pressure, or less, is left for good."""
        pressures = np.abs(self.rolls(seconds)[:, 2])
        loud = np.nonzero(pressures > 0.05 * VESSEL.pump.max_pressure_pa)[0]
        return 20 * (loud[-1] + 1) if len(loud) else 0

    def pressing(self):
        """Run until the pump presses hard."""
        self.rolls(9)
        while abs(self.ship.plant.pressure_pa) < 0.5 * VESSEL.pump.max_pressure_pa:
            self.rolls(0.02)
        assert self.node.mode is Mode.ACTIVE
        return self


@pytest.mark.evidence
def test_the_ship_rolls_as_with_the_native_drive():
    seconds = slice(500, None)  # all are in charge by then
    expected = Bench(None).rolls(25)[seconds]
    rms = np.sqrt(np.mean(expected[:, 0] ** 2))
    for changes in (
        {"mode": "velocity"},
        {"mode": "torque", "echo": "demand", "synchronous": False},
    ):
        foreign = Bench(DRIVE | changes)
        found = foreign.rolls(25)[seconds]
        assert (foreign.node.mode, foreign.node.fault) == (Mode.ACTIVE, Fault.NONE)
        assert np.sqrt(np.mean(found[:, 0] ** 2)) == pytest.approx(rms, rel=0.03)
        # the pressure follows the command with the lag that the law was designed for
        behind = found[5:, 2] - found[:-5, 1]
        assert np.sqrt(np.mean(behind**2)) < 0.06 * np.sqrt(np.mean(found[:, 1] ** 2))


@pytest.mark.evidence("<lambda>-19-250_1", "<lambda>-19-250_2")
@pytest.mark.slow
@pytest.mark.parametrize(
    ("lost", "fault", "within_ms"),
    [
        (lambda sender, can_id: can_id == 0x705, Fault.DRIVE_SILENT, 250),
        (lambda sender, can_id: can_id == 0x185, Fault.DRIVE_SILENT, 250),
        (lambda sender, can_id: can_id == 0x205, Fault.DRIVE_SILENT, 250),
        (lambda sender, can_id: can_id == 0x77F, Fault.DRIVE_FAULT, 130),
    ],
)
def test_what_is_lost_ends_at_zero_pressure(lost, fault, within_ms):
    bench = Bench(DRIVE | {"mode": "velocity"}).pressing()
    bench.lost = lost
    assert bench.until_zero() <= within_ms
    assert (bench.node.mode, bench.node.fault) == (Mode.FAULT, fault)


@pytest.mark.slow
def test_a_controller_that_dies_leaves_the_drive_braking():
    bench = Bench(DRIVE | {"mode": "velocity"}).pressing()
    bench.lost = lambda sender, can_id: sender == len(bench.ship.nodes)
    assert bench.until_zero() <= 130


@pytest.mark.slow
def test_four_of_five_lost_commands_end_at_zero():
    bench = Bench(DRIVE | {"mode": "torque"}).pressing()
    numbers = iter(range(10_000))
    bench.lost = lambda sender, can_id: can_id == 0x205 and next(numbers) % 5 != 4
    bench.rolls(0.12)
    assert (bench.node.mode, bench.node.fault) == (Mode.FAULT, Fault.DRIVE_SILENT)
    assert bench.until_zero() <= 250


def test_the_drive_of_the_page_is_configured():
    page = Path("docs/devices.md").read_text(encoding="utf-8")
    (written,) = (each for each in page.split("```yaml\n") if each.startswith("devices:\n  pump"))
    bench = Bench(yaml.safe_load(written.partition("```")[0])["devices"]["pump"])
    bench.rolls(3)
    assert bench.node.actuators.drive.setup.done, bench.node.actuators.drive.words
    assert bench.ship.drive.entries[Place(0x6087)].value == 100_000


@pytest.mark.slow
def test_another_drive_than_commissioned_is_not_armed():
    bench = Bench(DRIVE | {"mode": "velocity"})
    bench.ship.drive.entries[Place(0x1018, 4)].value = 99
    bench.rolls(10)
    assert bench.node.mode is not Mode.ACTIVE
    assert "1018h:4 is 0x63, not 0x4" in bench.node.actuators.drive.words
    assert bench.ship.drive.state.name == "PRE_OPERATIONAL"
    assert 1 << BUS_SHIFT | STANDARD | 0x185 in bench.node.inbox._routing.takers
