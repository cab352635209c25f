"""Devices of other makers in the inbox, and what an unprotected one costs."""

import re
import struct

import canopen
import pytest
from others import others_file

from tests.canopen_nodes import Wire
from utank_hil.canbus import Address, Fault, Frame, Heartbeat, NodeState, load_catalogue
from utank_hil.canbus.frame import BUS_SHIFT, STANDARD
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
INPUTS = "levels: inputs 0x187"
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
    levels = AS_IT_IS | {
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
    ("second", "finding", "alone"),
    [(False, 0, True), (True, 0, False), (True, Finding.SENSORS_DISAGREE, True)],
)
def test_an_unprotected_sensor_alone_costs_half_the_pressure(second, finding, alone):
    for unprotected in (False, True):
        safety = Safety(SafetyLimits(), 250_000, unprotected=unprotected)
        assert safety._alone(finding, second=second) is (alone and unprotected)


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


SYSTEC = {
    "profile": "cia404_levels", "node": 7, "high_level_m": 1.5, "accept_unprotected": True,
    "signals": {each: {"scale": 0.25, "offset": -3.0} for each in
                ("port_level_m", "starboard_level_m")},
    "identity": [0x3F, None, None, 4711],
}  # fmt: skip


AS_IT_IS = {
    "canopen_profile": None, "require": {"0x6132:1": None, "0x6132:2": None}, "identity": [],
}  # fmt: skip


class Gauges:
    """The inbox, and canopen's node by its maker's file, tick by tick."""

    def __init__(self, changes=None, tweak=lambda _: None):
        self.wire = Wire()
        self.node = canopen.LocalNode(7, str(others_file("devices/eds/systec-IoX4_8AI.eds")))
        dictionary = self.node.object_dictionary
        dictionary[0x1018][1].default, dictionary[0x1018][4].default = 0x3F, 4711
        tweak(dictionary)
        self.wire.add_node(self.node)
        self.node.nmt.state = "PRE-OPERATIONAL"
        self.inbox = inbox({"levels": SYSTEC | (changes or {})})
        self.now_ns, self.sent = 0, 0

    def run(self, ticks):
        for _ in range(ticks):
            for frame in self.inbox.setups(self.now_ns):
                self.sent += 1
                self.wire.notify(frame.can_id & 0x7FF, bytearray(frame.data), 0.0)
            if self.node.nmt.state == "OPERATIONAL" and self.now_ns // MS % 20 == 0:
                self.node.tpdo.read()
                for variable in self.node.tpdo[1]:
                    moves = self.now_ns // MS // 20 % 2
                    raw = {0x7130: 12_000 + moves if variable.subindex == 1 else 16_000}
                    variable.raw = raw.get(variable.index, 0)
                self.node.tpdo[1].transmit()
            for can_id, data in self.wire.said:
                self.inbox.receive(Frame(can_id | STANDARD, data), self.now_ns)
            self.wire.said.clear()
            self.now_ns += 10 * MS
        return self.inbox.snapshot(self.now_ns)


def test_a_canopen_sensor_is_configured_and_read_back_before_its_levels_count():
    gauges = Gauges()
    seen = gauges.run(200)
    sdo = gauges.node.sdo
    assert [sdo[0x6132][n].raw for n in (1, 2)] == [3, 3]
    assert [sdo[0x1800][n].raw for n in (2, 3, 5)] == [255, 0, 20]
    assert (seen.port_level_m, seen.starboard_level_m) == pytest.approx((0.0, 1.0), abs=1e-3)
    assert (now_age(seen) < 30, gauges.inbox.received(Fault.TANK_SILENT)) == (True, INPUTS)
    sent = gauges.sent
    gauges.run(300)
    assert gauges.sent == sent  # it is left alone
    gauges.wire.said.append((0x707, b"\0"))  # it starts anew
    gauges.node.nmt.state = "PRE-OPERATIONAL"
    assert now_age(gauges.run(10)) > 30
    assert now_age(gauges.run(300)) < 30
    gauges.node.nmt.state = "PRE-OPERATIONAL"  # and without a word
    assert now_age(gauges.run(50)) > 30
    assert now_age(gauges.run(300)) < 30


def now_age(seen):
    return seen.tank_age_ms


@pytest.mark.parametrize(
    ("tweak", "words"),
    [
        (lambda od: setattr(od[0x1018][4], "default", 4712),
         "1018h:4 is 0x1268, not 0x1267: another serial number"),
        (lambda od: setattr(od[0x1000], "default", 0x191),
         "1000h:0 is 0x191, not 0x194: this is no device by CiA 404"),
        (lambda od: setattr(od[0x6132][2], "access_type", "ro"),
         "6132h:2 is 0x2, not 0x3, and writing it gave .*read only.*set require"),
        (lambda od: setattr(od[0x1A00][3], "default", 0x71300310),
         "1A00h:3 .*mapping is fixed"),
        (lambda od: setattr(od[0x1800][5], "access_type", "ro"),
         "1800h:5 is 0x0, not 0x14.*on a change only"),
        (lambda od: od.indices.pop(0x6132), "6132h:1 .*no object.*set require"),
    ],
)  # fmt: skip
def test_a_sensor_that_is_not_as_its_profile_says_is_refused_by_name(tweak, words):
    def ro(od):
        tweak(od)
        if "fixed" in words:
            for subindex in range(5):
                od[0x1A00][subindex].access_type = "ro"

    gauges = Gauges(tweak=ro)
    seen = gauges.run(250)
    assert now_age(seen) > 1000
    said = gauges.inbox.received(Fault.TANK_SILENT)
    assert re.search(f"node 7: {words}", said), said


def test_another_device_at_the_node_is_found_after_it_was_swapped():
    gauges = Gauges()
    gauges.run(200)
    gauges.node.object_dictionary[0x1018][4].default = 4712
    gauges.node.nmt.state = "PRE-OPERATIONAL"
    gauges.wire.said.append((0x707, b"\0"))
    assert now_age(gauges.run(300)) > 1000
    assert "another serial number" in gauges.inbox.received(Fault.TANK_SILENT)


@pytest.mark.parametrize("told", [True, False])
def test_an_emergency_of_a_sensor_is_an_alarm_until_it_is_over(told):
    """As canopen sends it, CiA 301 7.2.7; also of a sensor that is told nothing."""
    gauges = Gauges({} if told else AS_IT_IS)
    gauges.run(200)
    gauges.node.emcy.send(0x5000, 0x81)
    assert gauges.run(4).device_error
    said = "node 7: emergency 5000h (hardware), register 0x81"
    assert gauges.inbox.received(Fault.DEVICE_ERROR) == f"levels: {said}"
    if told:
        assert gauges.inbox.received(Fault.TANK_SILENT) == f"{said}; {INPUTS}"
    gauges.node.emcy.reset(0x80)  # one is over, and another left
    assert gauges.run(4).device_error
    gauges.node.emcy.reset()
    assert not gauges.run(4).device_error
    assert gauges.inbox.received(Fault.DEVICE_ERROR) == ""
    gauges.node.emcy.send(0x5000, 0x81)
    gauges.run(4)
    gauges.wire.said.append((0x707, b"\0"))  # it starts anew, well
    gauges.node.nmt.state = "PRE-OPERATIONAL"
    assert gauges.run(200).device_error != told


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
    slopes = {"profile": "cia410", "node": 5, "accept_unprotected": True, "bus": "can1"}
    redundancy = {"redundancy": Redundancy(second_motion_sensor=True)}
    found = inbox({"motion": slopes}, **redundancy)
    assert len(found.setups(0)) == 1
    found = inbox({"motion": slopes, "receive_only": ["can1"]}, **redundancy)
    assert found.wakes(0) + found.setups(0) == []


def test_a_silent_node_that_is_not_configured_is_started_each_second():
    found = inbox({"levels": SYSTEC | AS_IT_IS})
    assert found.wakes(0) == [Frame(STANDARD, bytes((1, 7)))]
    assert found.setups(0) == []


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
