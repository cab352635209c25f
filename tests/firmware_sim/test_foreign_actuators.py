"""A valve and a panel of other makers: commanded, heard, armed from, on buses of their own."""

import re
import subprocess
from dataclasses import replace
from pathlib import Path

import canopen
import numpy as np
import pytest
from cantools.database.can import Database

from firmware_sim.bench import BenchOptions, run_bench
from firmware_sim.figures import mark_of
from firmware_sim.scenario import Scenario
from firmware_sim.ship_side import build_ship_side
from tests.canopen_nodes import Wire, valve_dictionary
from utank_hil.assembly import build_controller_node, build_law
from utank_hil.canbus import Fault, Frame, Mode, OperatorCommand, Rejection, load_catalogue
from utank_hil.canbus.cmac import KeyFileError
from utank_hil.canbus.frame import BUS_SHIFT, STANDARD
from utank_hil.canbus.profiles.acting import ProfiledPanel
from utank_hil.configuration import ControllerConfig, load_config
from utank_hil.configuration.device_files import with_profile
from utank_hil.configuration.devices import ROLES, DevicesSection, PanelSection
from utank_hil.console.ship_report import print_devices
from utank_hil.console.terminal import Terminal
from utank_hil.nodes.commissioning.conformance import SensorTrial, ValveTrial
from utank_hil.nodes.panel import Action, OperatorPanel, TimedAction
from utank_hil.runners import Lockstep, SimulatedBus
from utank_hil.runners.lockstep import with_more
from utank_hil.telemetry.frame_log import Kind
from utank_hil.telemetry.replay import Entry, replay

SECOND_NS = 1_000_000_000
DBC = """VERSION ""
NS_ :
BS_:
BU_: C V P
BO_ 801 VALVE_ORDER: 4 C
 SG_ SETPOINT : 0|16@1+ (0.01,0) [0|100] "%" V
 SG_ FOLLOW : 16|1@1+ (1,0) [0|1] "" V
 SG_ COUNT : 20|4@1+ (1,0) [0|15] "" V
 SG_ CRC : 24|8@1+ (1,0) [0|255] "" V
BO_ 802 VALVE_POSITION: 4 V
 SG_ ACTUAL : 7|16@0+ (0.01,0) [0|100] "%" C
 SG_ STATE : 16|4@1+ (1,0) [0|15] "" C
 SG_ COUNT : 20|4@1+ (1,0) [0|15] "" C
 SG_ CRC : 24|8@1+ (1,0) [0|255] "" C
BO_ 2566841389 PANEL_KEYS: 3 P
 SG_ ARM : 0|2@1+ (1,0) [0|1] "" C
 SG_ STOP_CLOSED : 2|2@1+ (1,0) [0|1] "" C
 SG_ ACCEPT : 4|2@1+ (1,0) [0|1] "" C
 SG_ RESET : 6|2@1+ (1,0) [0|1] "" C
 SG_ COUNT : 8|4@1+ (1,0) [0|15] "" C
 SG_ CRC : 16|8@1+ (1,0) [0|255] "" C
BO_ 2566842157 PANEL_CHALLENGE: 8 C
BO_ 2566842413 PANEL_PROOF: 8 P
BO_ 2566841645 PANEL_LIFE: 1 P
 SG_ TOGGLE : 0|1@1+ (1,0) [0|1] "" C
 SG_ STATE : 1|3@1+ (1,0) [0|7] "" C
"""
CRC = {"byte": 3}
VALVE = {
    "bus": "can1", "messages": {"order": "VALVE_ORDER", "position": "VALVE_POSITION"},
    "commands": {"opening": {"to": "order.SETPOINT"}, "follow": {"to": "order.FOLLOW"}},
    "signals": {"opening": {"from": "position.ACTUAL"}},
    "valid_when": [{"from": "position.STATE", "in": [1]}],
    "protection": {
        "counters": ["order.COUNT", "position.COUNT"],
        "crcs": [{"message": "order", **CRC}, {"message": "position", **CRC}],
    },
    "cycle_ms": 20, "age_ms": 60,
}  # fmt: skip
ON_OFF = {
    "profile": "cia401_valve", "bus": "can2", "node": 9, "age_ms": 700,
    "accept_unprotected": True,
    "commands": {"opening": {"sign": -1, "offset": -1}},
}  # fmt: skip
PANEL = {
    "bus": "can1", "messages": {"keys": "PANEL_KEYS", "life": "PANEL_LIFE"},
    "signals": {"arm": {"from": "keys.ARM"}, "acknowledge": {"from": "keys.ACCEPT"},
                "stop": {"from": "keys.STOP_CLOSED", "scale": -1, "offset": 1},
                "reset": {"from": "keys.RESET"}},
    "valid_when": [{"from": "life.STATE", "in": [2]}],
    "protection": {"counters": ["keys.COUNT", "life.TOGGLE"],
                   "crcs": [{"message": "keys", "byte": 2}]},
    "cycle_ms": 100, "age_ms": 300,
}  # fmt: skip
KEY = bytes(range(16))


@pytest.fixture
def theirs(tmp_path):
    path = tmp_path / "theirs.dbc"
    path.write_text(DBC)

    def section(**devices):
        return {
            role: device if "profile" in device else {"dbc": str(path), **device}
            for role, device in devices.items()
        }

    return section


class Bench:
    """The semi-active ship of a scenario with devices, and its controller."""

    def __init__(self, devices, controller="clipped", leave_out=()):
        scenario = load_config(Path("configs/scenarios/semi_active.yaml"), Scenario)
        section = DevicesSection(**devices) if devices else None
        vessel = scenario.vessel.model_copy(update={"devices": section})
        config = scenario.controllers[controller]
        safety = replace(config.safety, **vessel.default_safety)
        config = config.model_copy(update={"vessel": vessel, "safety": safety})
        scenario = scenario.model_copy(update={"vessel": vessel})
        self.ship = build_ship_side(scenario, 1, scenario.operator)
        self.config, self.node = config, build_controller_node(config, commissioned=True)
        nodes = [each for each in self.ship.nodes if each.name not in leave_out]
        self.sent = []
        self.run = Lockstep(
            [*nodes, self.node],
            with_more(SimulatedBus(), len(vessel.foreign.buses) - 1, 250_000),
            trace=lambda now_ns, sender, frame: self.sent.append((now_ns, sender, frame)),
        )

    def to(self, seconds):
        rolls = []
        while self.run.now_ns < seconds * SECOND_NS:
            self.run.run_until(self.run.now_ns + SECOND_NS // 10)
            rolls.append(self.ship.plant.roll_rad)
        return np.array(rolls)


@pytest.mark.slow
def test_a_valve_and_a_panel_by_their_dbc_do_as_the_native_ones(theirs):
    native, foreign = Bench(None), Bench(theirs(valve=VALVE, panel=PANEL))
    for bench in (native, foreign):
        bench.to(7)
        assert (bench.node.mode, bench.node.fault) == (Mode.ACTIVE, 0)
    both = [bench.to(60) for bench in (native, foreign)]
    assert (foreign.node.mode, foreign.node.fault) == (Mode.ACTIVE, 0)
    assert np.sqrt(np.mean((both[0] - both[1]) ** 2)) < 0.03 * np.sqrt(np.mean(both[0] ** 2))
    openings = {round(each, 1) for each in (foreign.ship.valve.opening, native.ship.valve.opening)}
    assert len(openings) == 1
    # as the maker's own library reads it
    database = Database()
    database.add_dbc_string(DBC)
    orders = [f.data for _, by, f in foreign.sent
              if by == "controller" and f.can_id == 1 << BUS_SHIFT | STANDARD | 801]  # fmt: skip
    told = [database.decode_message(801, data) for data in orders]
    assert {each["FOLLOW"] for each in told} == {0, 1}
    assert {each["SETPOINT"] for each in told} >= {100.0, 0.0}
    assert [each["COUNT"] for each in told[:20]] == [n % 16 for n in range(1, 21)]


@pytest.mark.slow
def test_an_open_or_shut_valve_by_cia_401_with_its_switches(theirs):
    bench = Bench(theirs(valve=ON_OFF), "on_off")
    bench.to(8)
    assert (bench.node.mode, bench.node.fault) == (Mode.ACTIVE, 0)
    openings = set()
    for second in range(9, 30):
        bench.to(second)
        openings.add(round(bench.ship.valve.opening))
    assert (bench.node.mode, bench.node.fault) == (Mode.ACTIVE, 0)
    assert openings == {0, 1}


@pytest.mark.parametrize("law", ["clipped", "pump_with_valve"])
def test_a_law_that_throttles_is_refused_for_a_valve_of_one_bit(law):
    controller = load_config(Path("configs/scenarios/semi_active.yaml"), Scenario).controllers[law]
    vessel = controller.vessel.model_copy(update={"devices": DevicesSection(valve=ON_OFF)})
    with pytest.raises(ValueError, match=r"devices\.valve has one bit.*valve_on_off"):
        ControllerConfig(name="L", vessel=vessel, law=controller.law)


@pytest.mark.parametrize(
    ("break_it", "fault"),
    [
        (lambda bench: setattr(bench.ship.valve, "stuck", True), Fault.VALVE_NOT_FOLLOWING),
        (lambda bench: setattr(bench.ship.valve, "powered", False), Fault.VALVE_SILENT),
    ],
)
@pytest.mark.slow
def test_a_valve_that_is_stuck_or_dead_is_found(theirs, break_it, fault):
    bench = Bench(theirs(valve=VALVE))
    bench.to(7)
    break_it(bench)
    bench.to(17)
    assert (bench.node.mode, bench.node.fault) == (Mode.FAULT, fault)


@pytest.mark.usefixtures("one_process")
def test_a_panel_that_cannot_ask_for_passive_leaves_the_bench_its_reference(theirs):
    scenario = load_config(Path("configs/scenarios/semi_active.yaml"), Scenario)
    section = DevicesSection(**theirs(panel=PANEL))
    vessel = scenario.vessel.model_copy(update={"devices": section})
    config = scenario.controllers["clipped"].model_copy(update={"vessel": vessel})
    changes = {"vessel": vessel, "controllers": {"clipped": config}, "settle_s": 5.0}
    scenario = scenario.model_copy(update=changes)
    result = run_bench(scenario, BenchOptions(duration_s=20.0), lambda *_: None)
    assert [mark_of(result, run) for run in result.runs] == [None, None]
    # its report reads the section as it was written: an open mask is a whole number of 64 bits
    assert DevicesSection.model_validate(section.model_dump(mode="json")) == section


@pytest.fixture
def station(theirs):
    database = Database()
    database.add_dbc_string(DBC)
    bench = Bench(theirs(panel=PANEL), leave_out=("panel",))
    return Station(bench, database)


class Station:
    """A panel by cantools, on the first interface of its own."""

    def __init__(self, bench, database):
        self.bench, self.database = bench, database
        self.keys = {"ARM": 0, "STOP_CLOSED": 1, "ACCEPT": 0, "RESET": 0}
        self.count = self.toggle = 0
        self.lives, self.state, self.counts, self.sends = True, 2, True, True

    def frames(self):
        self.count = (self.count + self.counts) % 16
        self.toggle ^= self.lives
        data = bytearray(
            self.database.encode_message(
                "PANEL_KEYS", {**self.keys, "COUNT": self.count, "CRC": 0}, strict=False
            )
        )
        data[2] = crc8(data[:2])
        life = self.database.encode_message(
            "PANEL_LIFE", {"TOGGLE": self.toggle, "STATE": self.state}
        )
        ids = (self.database.get_message_by_name(name).frame_id
               for name in ("PANEL_KEYS", "PANEL_LIFE"))  # fmt: skip
        pairs = zip(ids, (bytes(data), bytes(life)), strict=True)
        return [Frame(1 << BUS_SHIFT | can_id, content) for can_id, content in pairs]

    def to(self, seconds):
        bench = self.bench
        while bench.run.now_ns < seconds * SECOND_NS:
            if self.sends:
                for frame in self.frames():
                    bench.node.receive(frame, bench.run.now_ns)
            bench.run.run_until(bench.run.now_ns + SECOND_NS // 10)

    @property
    def mode(self):
        return self.bench.node.mode


def crc8(data):
    """SAE J1850, bit by bit."""
    register = 0xFF
    for byte in data:
        register ^= byte
        for _ in range(8):
            register = ((register << 1) ^ (0x1D if register & 0x80 else 0)) & 0xFF
    return register ^ 0xFF


def authenticated(theirs, tmp_path, mode=0o600, content=None):
    path = tmp_path / "panel.key"
    path.write_text(KEY.hex() if content is None else content)
    path.chmod(mode)
    messages = PANEL["messages"] | {"challenge": "PANEL_CHALLENGE", "proof": "PANEL_PROOF"}
    of = {"challenge": "challenge", "proof": "proof", "key": str(path)}
    return theirs(panel=PANEL | {"messages": messages, "authentication": of})


class Prover(Station):
    """A panel that has a key, and a thief who has recorded it."""

    def __init__(self, bench, database, key=KEY):
        super().__init__(bench, database)
        self.key, self.recorded, self.thief, self.proves_all = key, [], None, False
        self.proof, self.challenge = (
            1 << BUS_SHIFT | database.get_message_by_name(name).frame_id
            for name in ("PANEL_PROOF", "PANEL_CHALLENGE")
        )

    def frames(self):
        frames = super().frames()
        said = [f.data for _, by, f in self.bench.sent
                if by == "controller" and f.can_id == self.challenge]  # fmt: skip
        if (self.keys["ARM"] or self.proves_all) and said:
            proof = openssl_cmac(self.key, said[-1] + frames[0].data)[:8]
            frames.insert(1, Frame(self.proof, proof))
        self.recorded.append(frames)
        return frames if self.thief is None else self.thief.pop(0) if self.thief else []


def openssl_cmac(key, message):
    """AES-CMAC by another program."""
    done = subprocess.run(
        ["openssl", "mac", "-cipher", "AES-128-CBC", "-macopt", f"hexkey:{key.hex()}", "CMAC"],
        input=message, capture_output=True, check=True,
    )  # fmt: skip
    return bytes.fromhex(done.stdout.decode())


def prover(theirs, tmp_path, key=KEY):
    database = Database()
    database.add_dbc_string(DBC)
    return Prover(Bench(authenticated(theirs, tmp_path), leave_out=("panel",)), database, key)


def wrong_proofs(station):
    return station.bench.node.inbox.panel.rejected[Rejection.PROOF]


def test_a_panel_with_the_key_arms_and_its_recording_does_not(theirs, tmp_path):
    station = armed(prover(theirs, tmp_path))
    recorded = list(station.recorded)
    another = prover(theirs, tmp_path)
    another.thief = list(recorded)
    another.to(7.9)
    assert another.mode is Mode.STANDBY
    assert wrong_proofs(another) > 3
    # nor does it later in the same run
    panel = station.bench.node.inbox.panel
    assert panel.proved
    station.keys["ARM"] = 0
    station.to(10)
    assert not panel.proved
    station.thief = recorded[-60:]
    station.to(15.9)
    assert station.mode is not Mode.ACTIVE
    assert not panel.proved
    assert wrong_proofs(station) > 3


def test_without_the_key_it_stops_and_does_not_arm(theirs, tmp_path):
    station = prover(theirs, tmp_path, key=bytes(16))
    station.to(3)
    station.keys["ARM"] = 1
    station.to(6)
    assert station.mode is Mode.STANDBY
    node = station.bench.node
    assert node.safety.alarms.codes == {Fault.PROTECTION}
    said = re.fullmatch(
        r"panel: keys 0x[0-9A-F]+ on can1, (\d+) with a proof of another key",
        node.inbox.received(Fault.PROTECTION),
    )
    assert int(said[1]) > 10
    station.key = KEY
    station.keys["ARM"] = 0
    station.to(7)
    station.keys["ARM"] = 1
    station.to(12)
    assert station.mode is Mode.ACTIVE
    station.key = bytes(16)
    station.keys["STOP_CLOSED"] = 0
    station.to(12.2)
    assert station.mode is Mode.STANDBY


def test_a_key_that_was_turned_before_the_start_arms_by_no_proof(theirs, tmp_path):
    station = prover(theirs, tmp_path)
    station.keys["ARM"] = 1  # so it is where the controller's process starts anew
    station.to(8)
    assert station.bench.node.inbox.panel.proved
    assert station.mode is Mode.STANDBY
    station.keys["ARM"] = 0
    armed(station, 9)


def test_a_frame_that_disarms_is_undone_by_no_proof(theirs, tmp_path):
    station = armed(prover(theirs, tmp_path))
    station.keys["ARM"] = 0
    forged = station.frames()[0]
    station.keys["ARM"] = 1
    station.bench.node.receive(forged, station.bench.run.now_ns)
    station.to(14)
    assert station.mode is not Mode.ACTIVE


def test_a_proof_of_an_order_without_arm_lets_nobody_arm(theirs, tmp_path):
    station = prover(theirs, tmp_path)
    station.proves_all = True
    station.to(3)
    assert not station.bench.node.inbox.panel.proved
    station.key = bytes(16)
    station.keys["ARM"] = 1
    station.to(8)
    assert station.mode is Mode.STANDBY


def test_a_stop_ends_an_arm_that_waits_for_its_proof(theirs, tmp_path):
    station = prover(theirs, tmp_path, key=bytes(16))
    station.to(3)
    station.keys["ARM"] = 1
    station.to(5)
    station.keys["STOP_CLOSED"] = 0
    station.to(5.5)
    station.keys["STOP_CLOSED"], station.key = 1, KEY
    station.to(10)
    assert station.bench.node.inbox.panel.proved
    assert station.mode is Mode.STANDBY


def test_another_content_of_the_keys_identifier_presses_nothing(theirs):
    devices = theirs(panel=PANEL)["panel"]
    keys = with_profile(devices)["messages"]["keys"]
    only = keys | {"only": {"from": "COUNT", "in": [1, 2]}}
    panel = PanelSection(
        **with_profile(devices)
        | {"messages": {"keys": only}, "valid_when": []}
        | {"protection": {"crcs": [{"message": "keys", "byte": 2}], "counters": ["keys.COUNT"]}}
    )
    device = ProfiledPanel(panel.plan(OperatorCommand, "panel", 0))
    said = []
    device.overhear = said.append
    (taker,) = {*device.takers.values()}
    for count, stopped in ((1, False), (3, None), (2, True)):
        data = bytes([0 if stopped is not False else 4, count])
        taker.take(Frame(0, data + bytes([crc8(data)])), 0)
    assert [order.stop for order in said] == [False, True]


@pytest.mark.parametrize("right", [True, False])
def test_a_panel_with_a_key_conforms_and_one_with_another_does_not(theirs, tmp_path, right):
    panel = authenticated(theirs, tmp_path)["panel"]
    wrong = conformed(theirs, "panel", panel, pressed, KEY if right else bytes(16))
    assert wrong == (set() if right else {"arm_sign"})


@pytest.mark.parametrize(
    ("mode", "content", "words"),
    [(0o640, KEY.hex(), "chmod 600"), (0o600, "0123", "a key is 32 hexadecimal digits"),
     (0o600, "zz" * 16, "a key is 32"), (0o000, None, "can't be read")],
)  # fmt: skip
def test_a_key_that_is_not_there_or_others_may_read_is_refused(
    theirs, tmp_path, mode, content, words
):
    devices = authenticated(theirs, tmp_path, mode, content)
    if content is None:
        (tmp_path / "panel.key").unlink()
    with pytest.raises(KeyFileError, match=words) as refused:
        Bench(devices)
    assert "panel.key" in str(refused.value)


def test_a_run_with_authentication_is_replayed_with_its_key_and_not_without(theirs, tmp_path):
    devices = authenticated(theirs, tmp_path)
    bench = Bench(devices)
    tap = [[Entry(0, b"\x01", Kind.STARTED, 0)]]

    def noted(node):
        receive, tick = node.receive, node.tick

        def hear(frame, now_ns):
            tap[0].append(Entry(frame.can_id, frame.data, Kind.RECEIVED, now_ns))
            receive(frame, now_ns)

        def sends(now_ns):
            tap[0].append(Entry(0, b"", Kind.TICK, now_ns))
            frames = list(tick(now_ns))
            tap[0].extend(Entry(f.can_id, f.data, Kind.SENT, now_ns) for f in frames)
            return frames

        node.receive, node.tick = hear, sends

    noted(bench.node)
    bench.run = Lockstep([*bench.ship.nodes, bench.node],
                         with_more(SimulatedBus(), 1, 250_000))  # fmt: skip
    bench.to(12)
    assert bench.node.mode is Mode.ACTIVE
    law = build_law(bench.config)
    assert replay(tap[0], bench.config, law).exact
    (tmp_path / "panel.key").unlink()
    with pytest.raises(KeyFileError, match="no log of the ship be replayed"):
        replay(tap[0], bench.config, law)


def armed(station, begin_s=3):
    station.to(begin_s)
    station.keys["ARM"] = 1
    station.to(begin_s + 5)
    assert station.mode is Mode.ACTIVE
    return station


def test_a_panel_by_its_dbc_arms_and_stops(station):
    armed(station)
    station.keys["STOP_CLOSED"] = 0
    station.to(8.2)
    assert station.mode is Mode.STANDBY
    station.keys |= {"STOP_CLOSED": 1, "ARM": 0}
    station.to(9)
    station.keys["ARM"] = 1
    station.to(13)
    assert station.mode is Mode.ACTIVE
    station.keys["ARM"] = 0
    station.to(15)
    assert station.mode is not Mode.ACTIVE


def test_a_stop_counts_out_of_sequence_from_a_sick_panel_and_where_its_wire_is_broken(station):
    armed(station)
    station.counts, station.state = False, 5
    station.keys["STOP_CLOSED"] = 3  # not available
    station.to(8.2)
    assert station.mode is Mode.STANDBY


@pytest.mark.parametrize("sick", [{"lives": False}, {"state": 3}, {"counts": False}])
def test_a_panel_that_hangs_does_not_arm_and_ends_what_it_armed(station, sick):
    armed(station)
    for name, value in sick.items():
        setattr(station, name, value)
    station.to(15)
    assert (station.mode, station.bench.node.fault) == (Mode.FAULT, Fault.OPERATOR_SILENT)


@pytest.mark.parametrize("sick", [{"lives": False}, {"state": 3}, {"counts": False}])
def test_a_sick_panel_does_not_arm(station, sick):
    for name, value in sick.items():
        setattr(station, name, value)
    station.to(3)
    station.keys["ARM"] = 1
    station.to(8)
    assert station.mode is Mode.STANDBY


def test_the_native_panel_of_that_station_does_not_arm(theirs):
    bench = Bench(theirs(panel=PANEL), leave_out=("panel",))
    version = bench.ship.vessel.version
    panel = OperatorPanel(load_catalogue(), configuration_version=version,
                          script=[TimedAction(1.0, Action.ARM)])  # fmt: skip
    for k in range(80):
        for frame in panel.tick(k * SECOND_NS // 10):
            bench.node.receive(frame, bench.run.now_ns)
        bench.run.run_until(bench.run.now_ns + SECOND_NS // 10)
    assert bench.node.mode is Mode.STANDBY


def conformed(*asked, **changes):
    """What a trial of an emulated device finds wrong."""
    return {each.name for each in tried(*asked, **changes) if not each.passed}


def tried(theirs, role, device, moves, key=b"", spoil=lambda frame: frame):
    """Checks of an emulated device; a person does what is asked in two seconds."""
    bench = Bench(theirs(**{role: device}))
    vessel = bench.ship.vessel
    plan = vessel.devices.devices()[role].plan(ROLES[role], role, 0)
    node = bench.ship.valve if role == "valve" else Buttons(bench.ship.panel)
    asked = []

    def ask(what):
        begin_ns = now_ns
        asked.append(what)
        moves(node, what)
        return lambda: now_ns - begin_ns > 2 * SECOND_NS

    trial = SensorTrial(plan, ask, 2.0, key)
    if role == "valve":
        trial = ValveTrial(plan, vessel.valve, ask, 2.0)
    own, now_ns = 1 << BUS_SHIFT, 0
    while not trial.done:
        assert now_ns < 90 * SECOND_NS
        off = asked and "off the bus" in asked[-1]
        for frame in node.tick(now_ns):
            if frame.can_id >= own and not off:
                trial.receive(spoil(frame._replace(can_id=frame.can_id & (own - 1))), now_ns)
        for frame in trial.tick(now_ns):
            node.receive(frame._replace(can_id=frame.can_id | own), now_ns)
        now_ns += SECOND_NS // 100
    return trial.checks


def test_a_valve_conforms_and_one_that_is_slow_or_stays_where_it_is_does_not(theirs):
    assert conformed(theirs, "valve", VALVE, lambda *_: None) == set()

    def slow(valve, _):
        valve._most_step = 0.01

    assert "way_ms" in conformed(theirs, "valve", VALVE, slow)

    def stays(valve, _):
        valve._valve = replace(valve._valve, fail_position="shut")

    assert conformed(theirs, "valve", VALVE, stays) >= {"silence_ms"}


class Stands:
    """The first frame again and again."""

    def __init__(self):
        self.first = None

    def __call__(self, frame):
        self.first = self.first or frame
        return self.first


def altered(data):
    return bytes([*data[:-1], data[-1] ^ 1])


@pytest.mark.parametrize(
    ("spoil", "name", "remedy"),
    [
        (lambda frame: frame._replace(data=altered(frame.data)), "rejected", "keys wrong CRC or"),
        (lambda frame: frame._replace(data=frame.data[:-1]), "rejected", "keys wrong length: comp"),
        (Stands(), "rejected", "keys counter repeated: "),
        (lambda frame: frame._replace(can_id=frame.can_id + 1), "heard", "Never heard: keys. Look"),
    ],
)  # fmt: skip
def test_a_panel_that_says_it_wrong_is_refused_by_message_and_reason(theirs, spoil, name, remedy):
    checks = tried(theirs, "panel", PANEL, lambda *_: None,
                   spoil=lambda frame: spoil(frame) if len(frame.data) == 3 else frame)  # fmt: skip
    wrong = {each.name: each.remedy for each in checks if not each.passed}
    assert {"heard", name} == wrong.keys()
    assert wrong[name].startswith(remedy)


def test_check_says_what_protects_them_and_what_does_not(theirs, capsys):
    print_devices(Terminal(), DevicesSection(**theirs(valve=ON_OFF, panel=PANEL)))
    said = " ".join(capsys.readouterr().out.split())
    assert "valve: CiA 401 module with an open or shut valve on can2" in said
    assert "opening: told by order.OUTPUT each 20 ms" in said
    assert "1029h:1 = 0x2, 6206h:1 = 0x1, 6207h:1 = 0x0, mapping and pace of RPDO1" in said
    assert "not protected by counter, checksum, time stamp, status, identity, echo" in said
    assert "panel: DBC theirs.dbc on can1" in said
    assert "stop: on or off" in said
    assert "protected by length, range, cycle, counter, checksum, status" in said


def test_a_module_that_canopen_plays_is_configured_commanded_and_heard(theirs):
    bench = Bench(theirs(valve=ON_OFF | {"bus": ""}), "on_off", leave_out=("valve",))
    wire, module = Wire(), canopen.LocalNode(9, valve_dictionary())
    wire.add_node(module)
    module.nmt.state = "PRE-OPERATIONAL"
    inbox, valve = bench.node.inbox, bench.node.actuators.valve
    seen, openings = {}, []
    for tick in range(400):
        now_ns = tick * SECOND_NS // 100
        told = float(tick // 100 % 2)
        valve._asked = told
        for frame in [*inbox.setups(now_ns), *valve.frames(now_ns, faulted=False, follow=True)]:
            wire.notify(frame.can_id & 0x7FF, bytearray(frame.data), 0.0)
            seen.setdefault(frame.can_id & 0x7FF, []).append(frame.data)
        sdo = module.sdo
        if module.nmt.state == "OPERATIONAL":
            module.rpdo.read()
            module.rpdo[1].on_message(0x209, bytearray(seen[0x209][-1]), 0.0)
            output = module.rpdo[1].map[0].raw
            sdo[0x6000][1].raw = 2 if output & 1 else 1  # switched on it is shut
            module.tpdo.read()
            module.tpdo[1].map[0].raw = sdo[0x6000][1].raw
            module.tpdo[1].transmit()
            openings.append((told, inbox.snapshot(now_ns).valve_opening))
        for can_id, data in wire.said:
            inbox.receive(Frame(can_id | STANDARD, data), now_ns)
        wire.said.clear()
    assert module.nmt.state == "OPERATIONAL", inbox.received(Fault.VALVE_SILENT)
    assert [sdo[0x1600][n].raw for n in (0, 1)] == [1, 0x62000108]
    assert [sdo[0x1A00][n].raw for n in (0, 1)] == [1, 0x60000108]
    assert (sdo[0x1016][1].raw, sdo[0x1029][1].raw) == (127 << 16 | 50, 2)
    assert (sdo[0x6206][1].raw, sdo[0x6207][1].raw) == (1, 0)
    assert set(seen[0x77F]) == {b"\x05"}
    assert openings[-120][1] == openings[-120][0]
    assert {each for each, _ in openings} == {each for _, each in openings} == {0.0, 1.0}


class Buttons:
    """Sends what is pressed in the frames of a panel."""

    def __init__(self, panel):
        self.frames, self.held, self.ticks = panel._frames, "", -1
        self.proves, self.challenge = panel._proves, b""

    def tick(self, now_ns):
        self.ticks += 1
        order = OperatorCommand(
            Mode.STANDBY, "to arm" in self.held, "ress stop" in self.held, False,
            "press acknowledge" in self.held,
        )  # fmt: skip
        frames = self.frames.frames(order, now_ns, self.ticks)
        if frames and order.arm and self.challenge:
            proof = openssl_cmac(KEY, self.challenge + frames[0].data)[:8]
            frames.append(Frame(self.proves.proof_ids[-1], proof))
        return frames

    def receive(self, frame, now_ns):
        """Take the challenge."""
        if self.proves is not None and frame.can_id == self.proves.challenge_id:
            self.challenge = frame.data


def pressed(buttons, what):
    buttons.held = what


def test_a_panel_conforms_by_its_buttons(theirs):
    assert conformed(theirs, "panel", PANEL, pressed) == set()
    assert conformed(theirs, "panel", PANEL, lambda *_: None) == {
        "stop_sign", "acknowledge_sign", "arm_sign"
    }  # fmt: skip
