"""Emulated sensors that speak a maker's frames, on a bus of their own."""

import math
from collections import Counter
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from bought_devices import LEVELS, SBG
from pydantic import TypeAdapter

from firmware_sim.fault_injection.bench_parts import FaultyNode
from firmware_sim.fault_injection.kinds import AnyFault
from firmware_sim.scenario import Scenario
from firmware_sim.ship_side import build_ship_side
from utank_hil.assembly import build_controller_node
from utank_hil.canbus import Mode, Quality
from utank_hil.canbus.frame import BUS_SHIFT
from utank_hil.canbus.profiles.device import ProfiledDevice
from utank_hil.configuration import load_config
from utank_hil.configuration.devices import DevicesSection
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


def test_a_cycle_that_is_no_whole_tick_is_refused():
    foreign = DevicesSection(motion=SBG | {"cycle_ms": 5, "age_ms": 20}).foreign()
    from firmware_sim.sensors import ForeignFrames

    with pytest.raises(ValueError, match="5 ms can't be emulated"):
        ForeignFrames(foreign.motions[0], None, None)


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


def test_a_native_node_has_no_identity_to_change():
    scenario = load_config(Path("configs/scenarios/storm.yaml"), Scenario)
    drive = build_ship_side(scenario, 1, scenario.operator).drive
    bench = SimpleNamespace(nodes={"drive": FaultyNode(drive)})
    with pytest.raises(ValueError, match="no CANopen device"):
        fault_of({"kind": "replaced", "node": "drive"}).place(bench, 0, 0)
