"""Devices of other makers in the inbox, and what an unprotected one costs."""

import struct
import time
from types import SimpleNamespace

import pytest
from others import others_file

from utank_hil.canbus import Address, Frame, Heartbeat, NodeState, load_catalogue
from utank_hil.canbus.frame import BUS_SHIFT, STANDARD
from utank_hil.canbus.measurements import MotionSample
from utank_hil.canbus.profiles.device import SILENT_NS
from utank_hil.configuration.devices import DevicesSection
from utank_hil.nodes.inbox import Inbox
from utank_hil.nodes.redundancy import Redundancy
from utank_hil.safety.judge import Safety
from utank_hil.safety.monitors.finding import Finding
from utank_hil.safety.monitors.noise import Noise, SecondDifference
from utank_hil.safety.safety_limits import SafetyLimits

MS = 1_000_000
CATALOGUE = load_catalogue()
SSI2 = {"profile": "j1939_ssi2", "source": 0x20, "accept_unprotected": True}


def slope(counts):
    return bytes(3) + (250 * 32768 + counts).to_bytes(3, "little") + bytes(2)


RATES = bytes(2) + (250 * 128).to_bytes(2, "little") + bytes(4)


def inbox(devices, **options):
    foreign = DevicesSection(**devices).foreign()
    return Inbox(CATALOGUE, 7, foreign=foreign, **options)


def beat(address, now_ns, found):
    sender = CATALOGUE.transmitter(Heartbeat, address)
    version = CATALOGUE.version
    found.receive(sender.frame(Heartbeat(NodeState.READY, None, 1.0, version, 7, 0.0, 0.0)), now_ns)


def test_a_roll_of_another_makers_sensor_is_measured():
    found = inbox({"motion": SSI2})
    found.receive(Frame(0x18F02920, slope(32768)), 10 * MS)
    found.receive(Frame(0x0CF02A20, RATES), 11 * MS)
    sample = found.snapshot(20 * MS).motions[0]
    assert sample.roll_rad == pytest.approx(0.0174533, rel=1e-5)
    assert sample.age_ms == 9
    assert sample.valid
    assert found.foreign == 0


def test_what_is_declared_is_no_stranger_and_all_else_is():
    found = inbox({"motion": SSI2, "others": {"pgns": [0x1F113], "ids_11bit": [0x321]}})
    for can_id in (0x09F11307, STANDARD | 0x321):
        found.receive(Frame(can_id, bytes(8)), 0)
    assert (found.frames, found.foreign) == (2, 0)
    for can_id in (0x09F11407, STANDARD | 0x322, 0x321):
        found.receive(Frame(can_id, bytes(8)), 0)
    assert (found.frames, found.foreign) == (5, 3)


def test_an_identifier_of_11_bits_is_nobodys_address():
    found = inbox({"motion": SSI2})
    found.receive(Frame(STANDARD | 0x180, bytes(8)), 0)
    assert not found.snapshot(1).address_conflict
    found.receive(Frame(0x18FF0080, bytes(8)), 0)
    assert found.snapshot(1).address_conflict


def test_another_interface_loads_no_bus_of_ours():
    found = inbox({"motion": SSI2 | {"bus": "can1"}})
    tag = 1 << BUS_SHIFT
    for can_id, data in ((0x18F02920, slope(0)), (0x0CF02A20, RATES), (0x18FF0080, bytes(8))):
        found.receive(Frame(tag | can_id, data), 0)
    seen = found.snapshot(1)
    assert seen.motions[0].age_ms < 1
    assert (seen.frames, seen.foreign, seen.address_conflict) == (0, 0, False)
    found.receive(Frame(0x18F02920, slope(0)), 0)  # not from there
    assert found.snapshot(1).foreign == 1


def test_a_node_that_is_not_on_board_is_not_waited_for():
    levels = {
        "profile": "cia404_levels", "node": 7, "high_level_m": 1.5, "accept_unprotected": True,
        "signals": {each: {"scale": 1.0} for each in ("port_level_m", "starboard_level_m")},
    }  # fmt: skip
    found = inbox({"motion": SSI2, "levels": levels}, pump=False)
    assert Address.SENSORS not in [each & 0xFF for each in found.expected]
    found = inbox({"motion": SSI2}, pump=False)
    assert not found.snapshot(0).versions_match
    beat(Address.SENSORS, 0, found)
    assert found.snapshot(0).versions_match


def test_levels_without_switches_say_by_themselves_that_they_are_high():
    levels = {
        "profile": "cia404_levels", "node": 7, "high_level_m": 1.5, "accept_unprotected": True,
        "signals": {each: {"scale": 0.25, "offset": -3} for each in
                    ("port_level_m", "starboard_level_m")},
    }  # fmt: skip
    found = inbox({"levels": levels})
    for port, starboard, high in ((12000, 12000, False), (4500, 19500, True)):
        data = port.to_bytes(2, "little") + b"\0" + starboard.to_bytes(2, "little") + b"\0"
        found.receive(Frame(STANDARD | 0x187, data), 0)
        seen = found.snapshot(1)
        assert seen.high_level is high
        assert seen.level_m == pytest.approx((starboard - port) / 2 * 0.25e-3)


@pytest.mark.parametrize(
    ("motions", "spare_age_ms", "finding", "alone"),
    [
        (1, 0.0, 0, True),
        (2, 10.0, 0, False),
        (2, 10.0, int(Finding.SENSORS_DISAGREE), True),
        (2, 500.0, 0, True),
    ],
)
def test_an_unprotected_sensor_alone_costs_half_the_pressure(motions, spare_age_ms, finding, alone):
    for unprotected in (False, True):
        safety = Safety(SafetyLimits(), 250_000, unprotected=unprotected)
        measured = SimpleNamespace(motions=(MotionSample(),) * motions)
        safety.situation = SimpleNamespace(measured=measured, motion_spare_age_ms=spare_age_ms)
        assert safety._alone(finding) is (alone and unprotected)


def test_noise_of_a_sensor_of_20_hz_is_that_of_its_samples():
    import numpy as np

    draw = np.random.default_rng(1)
    bends, step = SecondDifference(), SecondDifference()
    left = [bends.update_after(v, 0.05) for v in draw.standard_normal(4000)]
    assert np.std(left[2:]) == pytest.approx(6**0.5, rel=0.05)
    uneven = [step.update_after(v, draw.choice([0.05, 0.1])) for v in draw.standard_normal(8000)]
    assert np.std(uneven[2:]) == pytest.approx(6**0.5, rel=0.05)
    smooth = SecondDifference()
    noise = Noise(6**0.5 * 2.5e-3)
    for k in range(200):  # 0.35 rad at 6 s
        rate = 0.36 * np.cos(1.05 * 0.05 * k)
        assert not noise.update(smooth.update_after(rate, 0.05), 0.05)


def test_redundancy_has_its_second_device():
    found = inbox(
        {"motion": SSI2, "motion_2": SSI2 | {"source": 0x21}},
        redundancy=Redundancy(second_motion_sensor=True),
    )
    for source in (0x20, 0x21):
        found.receive(Frame(0x18F02900 | source, slope(0)), 0)
        found.receive(Frame(0x0CF02A00 | source, RATES), 0)
    assert [each.age_ms for each in found.snapshot(0).motions] == [0, 0]


def test_a_silent_canopen_node_is_started_and_its_pdo_is_a_level():
    """The node is canopen's, with the description of its maker."""
    import can
    import canopen

    levels = {
        "profile": "cia404_levels", "node": 7, "high_level_m": 1.5, "accept_unprotected": True,
        "signals": {each: {"scale": 0.25, "offset": -3.0} for each in
                    ("port_level_m", "starboard_level_m")},
    }  # fmt: skip
    found = inbox({"levels": levels})
    (start,) = found.wakes(0)
    network = canopen.Network(can.Bus("levels", interface="virtual"))
    with can.Bus("levels", interface="virtual") as ours:
        network.connect()
        node = network.create_node(7, str(others_file("devices/eds/systec-IoX4_8AI.eds")))
        node.nmt.state = "PRE-OPERATIONAL"
        ours.send(
            can.Message(
                arbitration_id=start.can_id & ~STANDARD, is_extended_id=False, data=start.data
            )
        )
        end_s = time.monotonic() + 5
        while node.nmt.state != "OPERATIONAL" and time.monotonic() < end_s:
            time.sleep(0.01)
        assert node.nmt.state == "OPERATIONAL"
        node.tpdo.read()
        pdo = node.tpdo[1]
        for variable in pdo:
            variable.raw = {0x7130: 12_000 if variable.subindex == 1 else 16_000}.get(
                variable.index, 0
            )
        while ours.recv(0.01) is not None:
            pass
        pdo.transmit()
        heard = ours.recv(5)
        network.disconnect()
    found.receive(Frame(STANDARD | heard.arbitration_id, bytes(heard.data)), 2 * SILENT_NS)
    seen = found.snapshot(2 * SILENT_NS)
    assert (seen.port_level_m, seen.starboard_level_m) == pytest.approx((0.0, 1.0))
    assert found.wakes(2 * SILENT_NS) == []
    assert len(found.wakes(4 * SILENT_NS)) == 1


def test_a_name_is_asked_for_until_it_is_told():
    name = 0xC0FFEE0102030405
    found = inbox({"motion": SSI2 | {"protection": {"n2k_name": name}}})
    (request,) = found.wakes(0)
    assert request == Frame(0x18EA20FE, bytes([0x00, 0xEE, 0x00]))
    found.receive(Frame(0x18F02920, slope(0)), 5 * SILENT_NS)
    found.receive(Frame(0x0CF02A20, RATES), 5 * SILENT_NS)
    assert found.wakes(5 * SILENT_NS) == [request]
    found.receive(Frame(0x18EEFF20, name.to_bytes(8, "little")), 5 * SILENT_NS)
    assert found.wakes(5 * SILENT_NS) == []


def test_nothing_is_sent_where_the_interface_is_receive_only():
    levels = {"profile": "cia410", "node": 5, "accept_unprotected": True, "bus": "can1"}
    redundancy = {"redundancy": Redundancy(second_motion_sensor=True)}
    assert len(inbox({"motion": levels}, **redundancy).wakes(0)) == 1
    assert inbox({"motion": levels, "receive_only": ["can1"]}, **redundancy).wakes(0) == []


def test_two_roles_hear_one_frame():
    """Levels and pressure are inputs of one device, in one PDO."""
    signals = {
        name: {"start": 16 * k, "bits": 16, "signed": True, "scale": 1e-3, "unit": "m"}
        for k, name in enumerate(("PORT", "STARBOARD", "PRESSURE"))
    }
    inputs = {
        "profile": "", "node": 7, "cycle_ms": 20, "age_ms": 100, "accept_unprotected": True,
        "messages": {"in": {"cob": 0x180, "bytes": 6, "signals": signals}},
        "protection": {"unchanged_ms": 2000},
    }  # fmt: skip
    levels = inputs | {
        "high_level_m": 4.0,
        "signals": {
            "port_level_m": {"from": "in.PORT"},
            "starboard_level_m": {"from": "in.STARBOARD"},
        },
    }
    pressure = inputs | {"signals": {"pressure_pa": {"from": "in.PRESSURE", "scale": 1000}}}
    found = inbox({"levels": levels, "pump_sensor": pressure})
    frame = Frame(STANDARD | 0x187, struct.pack("<hhh", -1000, 1500, 250))
    found.receive(frame, 0)
    seen = found.snapshot(0)
    assert (seen.port_level_m, seen.starboard_level_m) == pytest.approx((-1.0, 1.5))
    assert seen.pressure_pa == pytest.approx(250.0)


def test_what_a_declared_device_says_besides_is_no_stranger():
    levels = {"profile": "cia410", "node": 5, "accept_unprotected": True}
    redundancy = {"redundancy": Redundancy(second_motion_sensor=True)}
    found = inbox({"motion": SSI2, "motion_2": levels}, **redundancy)
    for can_id in (0x705, 0x085, 0x285, 0x585):
        found.receive(Frame(STANDARD | can_id, bytes(8)), 0)
    found.receive(Frame(0x18FECA20, bytes(8)), 0)
    assert found.foreign == 0
    for can_id in (STANDARD | 0x706, STANDARD | 0x605, 0x18FECA21):
        found.receive(Frame(can_id, bytes(8)), 0)
    assert found.foreign == 3
