"""Emulated sensors that speak a maker's frames, on a bus of their own."""

import math
from collections import Counter
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
import yaml
from bought_devices import LEVELS, SBG
from pydantic import TypeAdapter

from firmware_sim.canopen_node import CanopenSensor
from firmware_sim.fault_injection.bench_parts import FaultyNode
from firmware_sim.fault_injection.kinds import AnyFault
from firmware_sim.scenario import Scenario
from firmware_sim.ship_side import build_ship_side
from utank_hil.assembly import build_controller_node
from utank_hil.canbus import Frame, Mode, Quality
from utank_hil.canbus.frame import BUS_SHIFT, STANDARD
from utank_hil.canbus.profiles.device import ProfiledDevice
from utank_hil.canbus.profiles.drive_plan import Place
from utank_hil.configuration import ConfigError, load_config
from utank_hil.configuration.devices import DevicesSection
from utank_hil.nodes.canopen_setup import CanopenSetup
from utank_hil.nodes.redundancy import Redundancy
from utank_hil.runners import Lockstep, SimulatedBus
from utank_hil.runners.lockstep import with_more

fault_of = TypeAdapter(AnyFault).validate_python
SECOND_NS = 1_000_000_000
LINES = "psxn", "tss1", "em3000"
LINE = "udp:127.0.0.1:5001:127.0.0.1"


def roll_and_shares(devices, *, second, seconds=30):
    scenario = load_config(Path("configs/scenarios/storm.yaml"), Scenario)
    section = None if devices is None else DevicesSection(**devices)
    redundancy = Redundancy(second_motion_sensor=second)
    changed = {"devices": section, "redundancy": redundancy}
    vessel = scenario.vessel.model_copy(update=changed)
    config = scenario.controllers["pd" if "pd" in scenario.controllers else "gpc"]
    config = config.model_copy(update={"vessel": vessel})
    scenario = scenario.model_copy(update={"vessel": vessel})
    ship = build_ship_side(scenario, 1, scenario.operator)
    node = build_controller_node(config, commissioned=True)
    more = len(vessel.foreign.buses) - 1
    buses = Counter()
    run = Lockstep(
        [*ship.nodes, node],
        with_more(SimulatedBus(), more, 250_000),
        trace=lambda _, sender, frame: buses.update([(sender, frame.can_id >> BUS_SHIFT)]),
    )
    rolls, shares = [], []
    for k in range(10 * seconds):
        run.run_until(k * SECOND_NS // 10 + 1)
        rolls.append(ship.plant.roll_rad)
        if k > 150:
            assert (node.mode, node.fault) == (Mode.ACTIVE, 0)
            shares.append(node.judgement.share)
    return np.array(rolls), shares, buses


@pytest.mark.evidence
def test_with_two_sensors_the_ship_rolls_as_with_native_nodes():
    native, _, _ = roll_and_shares(None, second=True, seconds=60)
    devices = {"motion": SBG, "levels": LEVELS}
    foreign, shares, buses = roll_and_shares(devices, second=True, seconds=60)
    # it is armed later by 0.8 s, in which the gauges are configured
    native, foreign = native[300:], foreign[300:]
    assert set(shares) == {1.0}
    rms = np.sqrt(np.mean(native**2))
    assert np.sqrt(np.mean((foreign - native) ** 2)) < 0.03 * rms
    assert ("sensors", 1) in buses
    assert ("sensors", 2) in buses
    # the gauges are configured and started, as a CANopen device has to be; nothing goes elsewhere
    said = {number: count for (sender, number), count in buses.items() if sender == "controller"}
    assert said == {0: said[0], 2: said[2]}
    assert 30 < said[2] < 100


@pytest.mark.slow
@pytest.mark.parametrize("name", LINES)
def test_with_motion_sentences_the_ship_rolls_as_with_native_nodes(name):
    native, _, _ = roll_and_shares(None, second=True)
    motion = {"profile": name, "bus": LINE, "accept_unprotected": True}
    foreign, shares, buses = roll_and_shares({"motion": motion}, second=True)
    assert set(shares) == {1.0}
    rms = np.sqrt(np.mean(native**2))
    assert 1e-6 < np.sqrt(np.mean((foreign - native) ** 2)) < 0.03 * rms
    assert [sender for sender, number in buses if number] == ["sensors"]


@pytest.mark.slow
def test_alone_without_counter_or_checksum_it_has_half_the_pressure():
    _, shares, _ = roll_and_shares({"motion": SBG}, second=False, seconds=18)
    assert set(shares) == {0.5}


def with_motion(tmp_path, **motion):
    def read(path):
        return yaml.safe_load(Path("configs", path).read_text())

    law = {"name": "PD", "law": read("controllers/pd.yaml")["law"], "vessel": "ship.yaml"}
    files = {
        "ship": read("ships/thesis_first.yaml") | {"devices": {"motion": SBG | motion}},
        "law": law,
        "calm": read("scenarios/still_water.yaml")
        | {"vessel": "ship.yaml", "controllers": {"pd": "law.yaml"}},
    }
    for name, content in files.items():
        (tmp_path / f"{name}.yaml").write_text(yaml.safe_dump(content))
    return load_config(tmp_path / "calm.yaml", Scenario)


def test_a_cycle_shorter_than_a_tick_is_refused_where_it_would_be_emulated(tmp_path):
    with pytest.raises(ConfigError, match=r"devices\.motion\.cycle_ms: must be 10 or more"):
        with_motion(tmp_path, cycle_ms=5, age_ms=20)


def test_a_cycle_that_is_no_whole_tick_has_its_pace(tmp_path):
    """Of 40 Hz each frame leaves 0 or 5 ms late: 0, 30, 50, 80 ms and on."""
    scenario = with_motion(tmp_path, cycle_ms=25, age_ms=60)
    node = build_ship_side(scenario, 1, scenario.operator).sensors
    attitude = STANDARD | 0x132 | 1 << BUS_SHIFT
    came = [
        k * 10
        for k in range(100)
        if any(frame.can_id == attitude for frame in node.tick(k * SECOND_NS // 100))
    ]
    assert came == [10 * math.ceil(2.5 * k) for k in range(40)]


@pytest.mark.parametrize(
    "device",
    [
        SBG,
        {"profile": "j1939_ssi2", "source": 0x20, "accept_unprotected": True},
        *({"profile": name, "bus": LINE, "accept_unprotected": True} for name in LINES),
    ],
)
@pytest.mark.parametrize(
    ("fault", "usable"),
    [
        ({"kind": "value", "values": {"roll_rad": None}}, 0),
        ({"kind": "offset", "signals": ["roll_rad"], "by": 0.25}, 20),
        ({"kind": "lost"}, 0),
        ({"kind": "frozen"}, 20),
    ],
)
def test_faults_of_a_message_are_those_of_the_device_that_stands_for_it(device, fault, usable):
    """What the faults of the campaign do to another maker's frames, as the controller hears it."""
    scenario = load_config(Path("configs/scenarios/storm.yaml"), Scenario)
    devices = DevicesSection(motion=device)
    vessel = scenario.vessel.model_copy(update={"devices": devices})
    scenario = scenario.model_copy(update={"vessel": vessel})
    node = FaultyNode(build_ship_side(scenario, 1, scenario.operator).sensors)
    bench = SimpleNamespace(nodes={"sensors": node})
    fault_of(fault | {"message": "SENSOR_MOTION"}).place(bench, SECOND_NS // 5, 0)
    found, heard = ProfiledDevice(vessel.foreign.motions[0]), []
    found.deliver = lambda message, now_ns: heard.append((now_ns, message))
    for k in range(40):
        for frame in node.tick(k * SECOND_NS // 100):
            if frame.can_id in found.takers:
                found.takers[frame.can_id].take(frame, k * SECOND_NS // 100)
    good = [m for now, m in heard if m.quality is Quality.GOOD and math.isfinite(m.roll_rad)]
    before = [m for now, m in heard if now < SECOND_NS // 5]
    after = good[len(before) :]
    assert len(before) in (19, 20)  # the first stamp tells nothing yet
    if fault["kind"] == "frozen" and device is SBG:  # its stamps stand
        usable = 1
    assert len(after) == usable
    if fault["kind"] == "offset":
        assert after[0].roll_rad == pytest.approx(before[-1].roll_rad + 0.25, abs=2e-3)
    if fault["kind"] == "frozen":
        assert len({m.roll_rad for m in after}) == 1


def test_an_emulated_sensor_claims_its_address_at_its_start_and_when_asked(tmp_path):
    """SAE J1939-81: PGN 60928 to all, from its source, with the NAME; asked for by PGN 59904."""
    name = 0xC050820000A0F35C
    motion = {"profile": "j1939_ssi2", "source": 0x5C, "bus": "can1", "cycle_ms": 10}
    scenario = with_motion(tmp_path, **motion, protection={"n2k_name": name})
    node = build_ship_side(scenario, 1, scenario.operator).sensors
    asks = Frame(0x18EA5CFE | 1 << BUS_SHIFT, b"\x00\xee\x00")
    assert asks.can_id in node.hears
    came = []
    for k in range(20):
        if k == 10:
            node.receive(asks, k * SECOND_NS // 100)
        sent = node.tick(k * SECOND_NS // 100)
        came += [(k, each.data) for each in sent if each.can_id == 0x18EEFF5C | 1 << BUS_SHIFT]
    assert came == [(k, name.to_bytes(8, "little")) for k in (0, 10)]


def test_an_emulated_node_maps_objects_of_any_number_and_gaps():
    """CiA 404 has its process values in 9130h: bit 31 of the mapping is no bit of a COB-ID."""
    gap = {"start": 32, "bits": 8, "object": "0005h"}
    fields = {
        name: {"start": start, "bits": 32, "object": f"9130h:{part}"}
        for part, (name, start) in enumerate((("A", 0), ("B", 32)), 1)
    }
    messages = {"a": {"cob": 0x180, "pdo": 1, "bytes": 5, "signals": {"A": fields["A"], "G": gap}},
                "b": {"cob": 0x280, "pdo": 2, "signals": fields}}  # fmt: skip
    levels = {
        "profile": "", "node": 12, "canopen_profile": 404, "messages": messages, "cycle_ms": 20,
        "signals": {"port_level_m": {"from": "a.A", "scale": 1e-4},
                    "starboard_level_m": {"from": "b.B", "scale": 1e-4}},
        "high_level_m": 4.0, "age_ms": 60, "accept_unprotected": True,
        "protection": {"unchanged_ms": 2000},
    }  # fmt: skip
    plan = DevicesSection(levels=levels).foreign().levels
    setup, node = CanopenSetup(0, 12, plan.steps), CanopenSensor(plan)
    for k in range(100):
        for frame in setup.frames(k * SECOND_NS // 100):
            node.receive(frame, 0)
        for frame in node.tick(0):
            if frame.can_id in setup.takers:
                setup.takers[frame.can_id].take(frame, 0)
    assert (setup.problem, setup.done) == ("", True)
    assert [node.entries[Place(0x1A00, n)].value for n in (1, 2)] == [0x91300120, 0x00050008]


@pytest.mark.parametrize(
    ("fault", "node"),
    [({"kind": "replaced"}, "drive"), ({"kind": "emergency", "code": 0x4210}, "sensors")],
)
def test_a_native_node_has_no_identity_to_change_and_no_emergencies(fault, node):
    scenario = load_config(Path("configs/scenarios/storm.yaml"), Scenario)
    side = build_ship_side(scenario, 1, scenario.operator)
    bench = SimpleNamespace(nodes={each.name: FaultyNode(each) for each in side.nodes})
    with pytest.raises(ValueError, match=f"{node} is no CANopen device"):
        fault_of({**fault, "node": node}).place(bench, 0, 0)


def test_a_slow_sensor_of_another_maker_takes_the_place_of_a_fast_one_that_is_gone():
    """J1939 at 20 Hz beside an Ellipse at 100 Hz, each on a bus of its own."""
    slow = {"profile": "j1939_ssi2", "source": 0x20, "bus": "can2", "accept_unprotected": True,
            "cycle_ms": 50, "age_ms": 150}  # fmt: skip
    scenario = load_config(Path("configs/scenarios/storm.yaml"), Scenario)
    changes = {
        "devices": DevicesSection(motion=SBG, motion_2=slow),
        "redundancy": Redundancy(second_motion_sensor=True),
    }
    vessel = scenario.vessel.model_copy(update=changes)
    config = scenario.controllers["gpc"]
    safety = replace(config.safety, **vessel.default_safety)
    config = config.model_copy(update={"vessel": vessel, "safety": safety})
    ship = build_ship_side(scenario.model_copy(update={"vessel": vessel}), 1, scenario.operator)
    node = build_controller_node(config, commissioned=True)
    gone = []
    run = Lockstep(
        [Silent(each, gone) if each is ship.sensors else each for each in ship.nodes] + [node],
        with_more(SimulatedBus(), 2, 250_000),
    )
    run.run_until(20 * SECOND_NS)
    assert (node.mode, node.fault) == (Mode.ACTIVE, 0)
    gone += vessel.foreign.motions[0].messages
    for k in range(100):
        run.run_until(run.now_ns + SECOND_NS // 10)
        assert (node.mode, node.fault) == (Mode.ACTIVE, 0), k
    assert node.measured.motions[0].age_ms > 9000


class Silent:
    """A node that sends none of some messages any more."""

    def __init__(self, node, gone):
        self._node, self._gone = node, gone
        self.name, self.period_ns, self.receive = node.name, node.period_ns, node.receive

    def tick(self, now_ns):
        out = {can_id for each in self._gone for can_id in each.can_ids}
        return [frame for frame in self._node.tick(now_ns) if frame.can_id not in out]
