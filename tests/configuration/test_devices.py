"""Section `devices` of a ship's file: what it refuses, and what it changes."""

import math
import re
from pathlib import Path

import cantools
import pytest
import yaml
from others import others_file

from utank_hil.canbus import Address, Frame, Quality, Rejection, SensorMotion, load_catalogue
from utank_hil.canbus.frame import STANDARD
from utank_hil.canbus.profiles.device import ProfiledDevice
from utank_hil.canbus.profiles.device_plan import ForeignDevices, MessageEncoder
from utank_hil.configuration import ControllerConfig, Vessel
from utank_hil.configuration.device_files import shipped_profiles
from utank_hil.configuration.devices import DevicesSection
from utank_hil.configuration.files import ConfigError, load_config
from utank_hil.safety.safety_limits import SafetyLimits

MOTION = load_catalogue().codec(SensorMotion, Address.SENSORS).can_id
SHIP = Path("configs/ships/thesis_first.yaml").resolve()
SBG = {"profile": "sbg_ellipse", "accept_unprotected": True}
PSXN = {"profile": "psxn", "accept_unprotected": True}
SSI2 = {"profile": "j1939_ssi2", "source": 0x20, "accept_unprotected": True}
LEVELS = {
    "profile": "cia404_levels", "node": 9, "high_level_m": 4.6, "accept_unprotected": True,
    "signals": {name: {"scale": 0.25, "offset": -3} for name in
                ("port_level_m", "starboard_level_m")},
}  # fmt: skip
DRIVE = {
    "profile": "cia402", "node": 5, "mode": "torque", "pressure_pa_per_unit": 80.0,
    "speed_rad_s_per_unit": 0.001,
}  # fmt: skip
ON_OFF = {"profile": "cia401_valve", "node": 9, "age_ms": 700, "accept_unprotected": True}
_KEYS = {name: {"start": place, "bits": 1}
         for place, name in enumerate(("ARM", "STOP", "ACCEPT", "TOGGLE"))}  # fmt: skip
PANEL = {
    "profile": "", "messages": {"keys": {"id": 5, "bytes": 1, "signals": _KEYS}},
    "signals": {"arm": {"from": "keys.ARM"}, "stop": {"from": "keys.STOP"},
                "acknowledge": {"from": "keys.ACCEPT"}},
    "protection": {"counters": ["keys.TOGGLE"]}, "cycle_ms": 100, "age_ms": 300,
    "accept_unprotected": True,
}  # fmt: skip


def ship_file(folder, devices, **more):
    content = yaml.safe_load(SHIP.read_text()) | more
    if devices is not None:
        content["devices"] = devices
    path = folder / "ship.yaml"
    path.write_text(yaml.safe_dump(content))
    return path


def ship(folder, devices, **more):
    return load_config(ship_file(folder, devices, **more), Vessel)


def problems(folder, devices, **more):
    with pytest.raises(ConfigError) as refused:
        ship(folder, devices, **more)
    return str(refused.value)


def test_without_the_section_the_version_is_as_it_was(tmp_path):
    assert ship(tmp_path, None).version == load_config(SHIP, Vessel).version


def test_a_change_of_a_device_voids_the_commissioning(tmp_path):
    versions = {
        ship(tmp_path, devices).version
        for devices in (
            None,
            {"motion": SBG},
            {"motion": SBG | {"bus": "can1"}},
            {"motion": SBG | {"latency_ms": 9}},
            {"motion": SBG | {"signals": {"roll_rad": {"sign": -1}}}},
            {"motion": SBG | {"messages": {"attitude": {"id": 0x133}}}},
        )
    }
    assert len(versions) == 6


@pytest.mark.parametrize(
    ("devices", "reason"),
    [
        ({"motion": {"profile": "sbg"}}, "no profile 'sbg': there are native, cia401_valve,"),
        ({"motion": {"profile": "sbg_ellipse"}}, "accept_unprotected: must be set to true"),
        ({"motion": SBG | {"cycle_ms": 100, "age_ms": 300}}, "10 Hz: too slow"),
        ({"levels": LEVELS | {"cycle_ms": 100, "age_ms": 300}}, "levels.cycle_ms: is 100, 10 Hz"),
        ({"motion": SBG | {"age_ms": 10}}, "must be 20 or more, two cycles"),
        ({"motion": SBG | {"protection": {"stamps": []}}}, "unchanged_ms"),
        ({"motion": {"profile": "cia410", "node": 4, "accept_unprotected": True}}, "is derived"),
        ({"motion": {"profile": "cia410", "accept_unprotected": True}}, "motion.node"),
        ({"motion": {"profile": "n2k_attitude", "source": 3, "accept_unprotected": True}}, "10 Hz"),
        ({"motion": PSXN | {"bus": "udp:127.0.0.1:5001"}}, "motion.bus: udp:127.0.0.1:5001"),
        ({"motion": PSXN | {"bus": "udp:10.0.0.1:5001:239.1.1.1"}}, "is no one's own address"),
        ({"motion": PSXN | {"bus": "can1"}}, "attitude comes on a line, and can1 is none"),
        ({"motion": PSXN | {"bus": "serial:/dev/ttyS0:9600"}}, "is derived of the roll"),
        ({"motion": SBG | {"bus": "udp:127.0.0.1:1:127.0.0.1"}}, "is for frames of CAN, and udp:"),
        ({"valve": ON_OFF | {"bus": "serial:/dev/ttyS0:9600"}}, "it can't be commanded"),
        ({"motion_2": SBG}, "second_motion_sensor: true"),
        ({"motion": SBG | {"signals": {"roll_rad": {"from": "attitude.YAW"}}}}, "is no signal"),
        ({"motion": SBG | {"signals": {"heave_m": {"from": "attitude.ROLL"}}}}, "is no value"),
        ({"motion": SBG | {"signals": {"roll_rad": {"scale": 0}}}}, "roll_rad.scale: must not be"),
        ({"valve": ON_OFF | {"commands": {"opening": {"scale": 0}}}}, "opening.scale: must not be"),
        ({"motion": {"bus": "can1"}}, "native nodes"),
        ({"motion": SBG, "receive_only": ["can3"]}, "no device is on can3"),
        ({"motion": SBG | {"dbc": "./none.dbc", "messages": {"a": "B"}}}, "can't be read"),
        ({"motion": {"sources": 5}}, "did you mean source"),
        ({"motion": SBG | {"messages": {"status": {"cycle_ms": 100}, "gyro": {"cycle_ms": 20}}}},
         "messages.gyro.cycle_ms: is 20, and cycle_ms 10"),
        ({"motion": SBG | {"messages": {"attitude": {"id": 0x18F02920}}}}, "must be 29bit: 0x18f0"),
        ({"motion": SBG | {"protection": {"crcs": [{"message": "attitude", "byte": 6}]}}},
         "byte 6 is not in attitude, which has 6"),
        ({"motion": SBG | {"messages": {"attitude": {"only": {"from": "YAW", "in": [1]}}}}},
         "'YAW' is no signal of attitude"),
        ({"motion": SBG | {"messages": {
            "attitude": {"only": {"from": "ROLL", "mask": 1, "in": [2]}}}}},
         "messages.attitude.only: in has 2, and the bits of ROLL that count are 0x1"),
        ({"motion": SSI2 | {"source": 0x80}}, "motion.source: is the address of controller"),
        ({"motion": SBG | {"messages": {"attitude": {"id": MOTION, "format": "29bit"}}}},
         f"{MOTION:#x} is a native node's on this bus"),
        ({"motion": SSI2, "motion_2": SSI2}, "is no second source for itself"),
        ({"levels": LEVELS | {"node": 5}, "pump": DRIVE}, "levels.node: is the drive's"),
        ({"levels": LEVELS | {"node": 127}, "pump": DRIVE}, "levels.node: is the drive's"),
        ({"motion": SBG | {"messages": {"attitude": {"id": 0x185}}}, "pump": DRIVE},
         "motion.messages: 0x185 is the drive's on this bus"),
        ({"valve": ON_OFF}, "devices.valve: is a valve, but the ship has none"),
        ({"valve": ON_OFF | {"commands": {"lift": {"to": "order.OUTPUT"}}}},
         "commands.lift: is no command; there are opening, follow, reset"),
        ({"valve": ON_OFF | {"commands": {"opening": {"to": "order.X"}}}}, "'order.X' is no sig"),
        ({"valve": ON_OFF | {"commands": {"opening": {"to": "position.OPEN"}}}},
         "position is what the valve sends"),
        ({"valve": ON_OFF | {"bus": "can1"}, "receive_only": ["can1"]}, "valve.bus: can1 is rec"),
        ({"valve": ON_OFF | {"accept_unprotected": False}}, "valve.accept_unprotected: must be"),
        ({"valve": ON_OFF | {"signals": {"is_open": {"from": "position.UP"}}}}, "is no signal of"),
        ({"panel": PANEL | {"protection": {}}}, "nothing says that the panel lives"),
        ({"panel": PANEL | {"accept_unprotected": False}}, "Any other sender on that bus may arm"),
        ({"panel": PANEL | {"authentication": {"challenge": "keys", "proof": "p", "key": "./k"}}},
         "authentication.challenge: must be a message of its own with 8 bytes"),
        ({"panel": PANEL | {"signals": {"arm": {"from": "keys.ARM"}}}},
         "panel.signals.stop: is required but missing"),
    ],
)  # fmt: skip
def test_what_is_refused(tmp_path, devices, reason):
    assert reason in problems(tmp_path, devices)


@pytest.mark.parametrize(
    ("signal", "meant"),
    [("attitude.Roll", "did you mean attitude.ROLL?"), ("attitude.ROL", "did you mean attitude.RO"),
     ("ROLL_ANGLE", "write MESSAGE.SIGNAL")],
)  # fmt: skip
def test_a_signal_of_nearly_that_name_is_named(tmp_path, signal, meant):
    motion = SBG | {"signals": {"roll_rad": {"from": signal}}}
    assert f"signals.roll_rad: {signal!r} is no signal of messages: {meant}" in problems(
        tmp_path, {"motion": motion}
    )


@pytest.mark.parametrize(
    ("scale", "why"),
    [(2.5e-4, ""), (0.25, "counts 1.64e+04 m in steps of 0.25, where 4.88 is usual"),
     (2.5e-7, "counts 0.0164 m in steps of 2.5e-07, where 4.88 is usual")],
)  # fmt: skip
def test_gauges_scaled_in_another_unit_are_warned_of(tmp_path, scale, why):
    names = ("port_level_m", "starboard_level_m")
    fields = {name: {"start": 16 * k, "bits": 16} for k, name in enumerate(names)}
    levels = {
        "profile": "", "messages": {"m": {"id": 5, "bytes": 4, "signals": fields}},
        "signals": {name: {"from": f"m.{name}", "scale": scale, "offset": -3} for name in names},
        "high_level_m": 4.6, "cycle_ms": 20, "age_ms": 100, "protection": {"unchanged_ms": 2000},
        "accept_unprotected": True,
    }  # fmt: skip
    warned = dict(ship(tmp_path, {"levels": levels}).warnings())
    said = [warned.get(f"devices.levels.signals.{name}.scale", "") for name in names]
    assert [words.startswith(why) and bool(words) is bool(why) for words in said] == [True, True]


@pytest.mark.parametrize(
    "content", [b"\x01", b'VERSION "', b"BO_ 99999999999999999999 A: 8 B\n", b"SG_ : 1", bytes(9)]
)
def test_a_damaged_dbc_is_refused_by_its_name(tmp_path, content):
    (tmp_path / "theirs.dbc").write_bytes(content)
    motion = SBG | {"dbc": "./theirs.dbc", "messages": {"a": "B"}}
    assert re.search(
        r"theirs\.dbc (is no DBC|has no message)", problems(tmp_path, {"motion": motion})
    )


@pytest.mark.parametrize(
    ("device", "key", "remedy"),
    [
        ({"motion": SBG | {"messages": {"a": "B"}}}, "dbc", "name the maker's .dbc"),
        ({"motion": SBG | {"messages": {"a": "TPDO1"}}}, "eds", "name the maker's .eds or .dcf"),
        ({"pump": DRIVE}, "eds", "name the maker's .eds or .dcf"),
        ({"motion": {"accept_unprotected": True}}, "profile", "or name a file by dbc or eds"),
    ],
)
@pytest.mark.parametrize("file", ["ship.yaml", "./ship.yaml", "./none.yaml", "./empty.dat"])
def test_a_file_of_another_kind_is_refused_in_a_line_with_key_file_and_remedy(
    tmp_path, device, key, remedy, file
):
    (tmp_path / "empty.dat").touch()
    (role, content), *_ = device.items()
    (said,) = problems(tmp_path, {role: content | {key: file}}).splitlines()
    assert said.startswith(f"{tmp_path}/ship.yaml: devices.{role}: ")
    assert key in said
    assert file.removeprefix("./") in said
    assert ("beside the file" if "none" in file and key != "profile" else remedy) in said
    assert len(said) < 400 + len(str(tmp_path)) * 3


@pytest.mark.parametrize("value", [None, 5, [], {}, ""])
@pytest.mark.parametrize("key", ["dbc", "eds"])
def test_a_file_s_name_that_is_none_is_refused(tmp_path, key, value):
    said = problems(tmp_path, {"motion": SBG | {key: value, "messages": {"a": "TPDO1"}}})
    assert f"devices.motion: {key}: must be the path of a file" in said


def test_a_message_of_nearly_that_name_is_named(tmp_path):
    (tmp_path / "theirs.dbc").write_text(
        'VERSION ""\nBO_ 5 EKF_EULER: 8 X\n SG_ R : 0|8@1+ (1,0) [0|0] "" X\n'
    )
    motion = SBG | {"dbc": "./theirs.dbc", "messages": {"a": "EKF_EULR"}}
    assert "has no message EKF_EULR; did you mean EKF_EULER?" in problems(
        tmp_path, {"motion": motion}
    )
    motion["messages"] = {"a": "ATTITUDE"}
    assert "has no message ATTITUDE; it has EKF_EULER" in problems(tmp_path, {"motion": motion})


def test_a_motion_signal_without_unit_is_refused(tmp_path):
    slope = {"id": 5, "signals": {"S": {"start": 0, "bits": 16}, "R": {"start": 16, "bits": 16}}}
    device = {
        "profile": "", "messages": {"slope": slope}, "cycle_ms": 10, "age_ms": 40,
        "signals": {"roll_rad": {"from": "slope.S"}, "roll_rate_rad_s": {"from": "slope.R"}},
        "accept_unprotected": True, "protection": {"unchanged_ms": 500},
    }  # fmt: skip
    assert "slope.S has no unit: give scale, from it to rad" in problems(
        tmp_path, {"motion": device}
    )
    device["signals"]["roll_rad"]["scale"] = device["signals"]["roll_rate_rad_s"]["scale"] = 1e-3
    assert ship(tmp_path, {"motion": device}).devices.motion.step("roll_rad") == 1e-3
    del device["signals"]["roll_rate_rad_s"]
    assert "roll_rate_rad_s: is required but missing, or else {source: derived}" in problems(
        tmp_path, {"motion": device}
    )


def test_every_shipped_profile_is_cited_and_usable(tmp_path):
    needs = {"j1939_ssi2": {"source": 0x20}, "cia410": {"node": 3}, "cia404_levels": {"node": 9}}
    scaled = {name: {"scale": 0.25, "offset": -3} for name in ("port_level_m", "starboard_level_m")}
    needs["cia401_valve"] = {"node": 9, "age_ms": 700}
    needs |= {each: {"bus": "serial:/dev/ttyS0:115200"} for each in ("em3000", "psxn", "tss1")}
    needs["n2k_attitude"] = {"source": 0x20, "cycle_ms": 50}
    needs["cia404_levels"] |= {"signals": scaled, "high_level_m": 4.6}
    both = {"redundancy": {"second_motion_sensor": True}}
    for name in shipped_profiles():
        role = next((each for each in ("levels", "valve") if each in name), "motion")
        device = {"profile": name, "accept_unprotected": True, **needs.get(name, {})}
        more = (
            {"valve": {"kind": "duct", "opening_time_s": 0.5, "leakage": 0.1}}
            if role == "valve"
            else {}
        )
        found = ship(tmp_path, {role: device}, **both, **more)
        section = getattr(found.devices, role)
        assert section.device
        assert section.documents
        assert getattr(found.devices.foreign(), "motions" if role == "motion" else role)


def test_a_slow_sensor_is_refused_by_the_delay_of_the_law_with_the_number(tmp_path):
    ship_file(tmp_path, {"motion": SBG | {"cycle_ms": 50, "age_ms": 120}})
    law = {"name": "c", "vessel": "ship.yaml", "law": {"kind": "pd"}}
    law |= yaml.safe_load(Path("configs/controllers/pd.yaml").read_text())
    law["vessel"] = "ship.yaml"
    path = tmp_path / "c.yaml"
    path.write_text(yaml.safe_dump(law | {"delay_s": 0.05}))
    with pytest.raises(
        ConfigError, match=r"58 ms late.*of 23.8 Hz or more, or set delay_s of the .*file to 0.058"
    ):
        load_config(path, ControllerConfig)
    path.write_text(yaml.safe_dump(law | {"delay_s": 0.06}))
    config = load_config(path, ControllerConfig)
    assert config.safety.motion_age_ms == 120
    assert config.sensor_figures.roll_rate_noise_rad_s == pytest.approx(5e-4)


def test_a_derived_rate_costs_delay_and_noise(tmp_path):
    """The slope over 0.1 s is 50 ms late, and has the noise of two rolls."""
    slopes = {"profile": "cia410", "node": 5, "bus": "can1", "accept_unprotected": True}
    ship_file(tmp_path, {"motion": slopes}, redundancy={"second_motion_sensor": True})
    law = yaml.safe_load(Path("configs/controllers/pd.yaml").read_text()) | {"vessel": "ship.yaml"}
    path = tmp_path / "c.yaml"
    path.write_text(yaml.safe_dump(law | {"delay_s": 0.05}))
    with pytest.raises(ConfigError, match=r"a derived rate 80 ms late.*bears 50: set delay_s"):
        load_config(path, ControllerConfig)
    path.write_text(yaml.safe_dump(law | {"delay_s": 0.08}))
    figures = load_config(path, ControllerConfig).sensor_figures
    assert figures.roll_rate_noise_rad_s == pytest.approx(math.sqrt(2) * 2e-4 / 0.1)


def test_a_ship_that_was_written_out_is_read_again(tmp_path):
    messages = {"a": "SBG_ECAN_MSG_EKF_EULER", "g": "SBG_ECAN_MSG_IMU_GYRO"}
    of_a_file = {
        "dbc": str(others_file("devices/dbc/sbgCan.dbc")), "messages": messages,
        "signals": {"roll_rad": {"from": "a.ROLL"}, "roll_rate_rad_s": {"from": "g.GYRO_X"}},
        "cycle_ms": 10, "age_ms": 40, "accept_unprotected": True,
        "protection": {"unchanged_ms": 100},
    }  # fmt: skip
    for motion in (SBG, of_a_file):
        found = ship(tmp_path, {"motion": motion}).devices
        for mode in ("json", "python"):
            assert DevicesSection.model_validate(found.model_dump(mode=mode)) == found


def test_the_noisier_gauge_counts_and_noise_of_no_value_is_refused(tmp_path):
    levels = {"profile": "cia404_levels", "accept_unprotected": True, "node": 9,
              "high_level_m": 4.6, "noise": {"starboard_level_m": 0.03},
              "signals": {name: {"scale": 0.25, "offset": -3}
                          for name in ("port_level_m", "starboard_level_m")}}  # fmt: skip
    ship_file(tmp_path, {"levels": levels})
    content = yaml.safe_load(Path("configs/controllers/pd.yaml").read_text())
    path = tmp_path / "c.yaml"
    path.write_text(yaml.safe_dump(content | {"vessel": "ship.yaml"}))
    assert load_config(path, ControllerConfig).sensor_figures.level_noise_m == 0.03
    said = problems(tmp_path, {"levels": levels | {"noise": {"level_m": 0.03}}})
    assert "devices.levels.noise.level_m: is no value of it; there are port_level_m" in said


def test_coarse_steps_are_noise():
    section = {"signals": {"roll_rate_rad_s": {"scale": 0.01}}}
    devices = DevicesSection(motion=SBG | section)
    assert devices.noise("motion", "roll_rate_rad_s") == pytest.approx(1e-5 / 12**0.5)


@pytest.mark.parametrize(
    ("can_id", "known"),
    [
        (0x0DF11313, True),  # any priority and source
        (0x15F11301, True),
        (0x0DF11413, False),
        (0x18EA80FE, True),  # PGN 59904, to one
        (1 << 29 | 0x321, True),
        (0x321, False),
    ],
)
def test_declared_devices_are_known(can_id, known):
    others = ForeignDevices(
        other_ids=frozenset([1 << 29 | 0x321]), other_pgns=frozenset([0x1F113, 0xEA00])
    )
    assert others.knows(can_id) is known


SLOPE_ID = 0x18FF3020
INERTIAL = f"""VERSION ""
BO_ {SLOPE_ID | 1 << 31} SLOPE: 8 S
 SG_ ROLL : 0|16@1- (0.001,0) [0|0] "deg" X
BO_ 256 IMU: 8 S
 SG_ PAGE M : 0|8@1+ (1,0) [0|0] "" X
 SG_ ANGLE m0 : 8|16@1- (0.001,0) [0|0] "rad" X
 SG_ TURN m1 : 8|16@1- (0.001,0) [0|0] "rad/s" X
 SG_ YAW m2 : 8|16@1- (0.001,0) [0|0] "rad/s" X
BO_ 257 LONG: 20 S
 SG_ FAR : 100|16@1- (0.001,0) [0|0] "rad" X
BO_ 258 NEST: 8 S
 SG_ BOOK M : 0|8@1+ (1,0) [0|0] "" X
 SG_ PAGE m1M : 8|8@1+ (1,0) [0|0] "" X
 SG_ ANGLE m2 : 16|16@1- (0.001,0) [0|0] "rad" X
BO_ 259 STATE: 8 S
 SG_ OF : 0|4@1- (1,0) [0|0] "" X
 SG_ FIX : 4|4@1+ (1,0) [0|0] "" X
 SG_ BARE : 8|8@1+ (1,0) [0|0] "" X
BA_DEF_ BO_ "GenMsgCycleTime" INT 0 10000;
BA_DEF_DEF_ "GenMsgCycleTime" 0;
BA_ "GenMsgCycleTime" BO_ 256 20;
SG_MUL_VAL_ 258 PAGE BOOK 1-1;
SG_MUL_VAL_ 258 ANGLE PAGE 2-2;
VAL_ 259 OF 3 "VALID" 0 "STARTS" -1 "SPOILT" ;
VAL_ 259 FIX 2 "3D fix" 1 "2D" ;
"""


def inertial(folder, **changes):
    (folder / "theirs.dbc").write_text(INERTIAL)
    return {
        "dbc": "./theirs.dbc", "messages": {"a": "IMU", "b": "IMU"}, "cycle_ms": 10, "age_ms": 40,
        "signals": {"roll_rad": {"from": "a.ANGLE"}, "roll_rate_rad_s": {"from": "b.TURN"}},
        "protection": {"unchanged_ms": 100}, "accept_unprotected": True, **changes,
    }  # fmt: skip


STATE = {"messages": {"a": "IMU", "b": "IMU", "s": "STATE"}}


def test_contents_that_share_an_identifier_are_told_apart(tmp_path):
    found = ProfiledDevice(ship(tmp_path, {"motion": inertial(tmp_path)}).foreign.motions[0])
    heard = []
    found.deliver = lambda message, _: heard.append(message)
    for page, counts in ((0, 250), (2, 999), (1, -40)):
        data = bytes((page,)) + counts.to_bytes(2, "little", signed=True) + bytes(5)
        found.takers[STANDARD | 256].take(Frame(STANDARD | 256, data), 0)
    assert heard == [(pytest.approx(0.25), pytest.approx(-0.04), Quality.GOOD)]


def test_a_short_frame_counts_against_its_own_content_alone(tmp_path):
    """One that counts for both has twice the pace, as of two senders."""
    found = ProfiledDevice(ship(tmp_path, {"motion": inertial(tmp_path)}).foreign.motions[0])
    for data in (bytes(7), bytes((1, *[0] * 6)), bytes((1,)), bytes((2, 0))):
        found.takers[STANDARD | 256].take(Frame(STANDARD | 256, data), 0)
    assert [(each.heard, each.rejected[Rejection.LENGTH]) for each in found.watched] == [
        (1, 1), (2, 2),
    ]  # fmt: skip


def test_what_is_encoded_of_a_shared_identifier_has_its_selector(tmp_path):
    """An emulated device, and a valve's command: cantools reads the right content."""
    plan = ship(tmp_path, {"motion": inertial(tmp_path)}).foreign.motions[0]
    theirs = cantools.database.load_file(tmp_path / "theirs.dbc")
    said = {}
    for each in plan.messages:
        said |= theirs.decode_message(256, MessageEncoder(each).frame([0.25, -0.04], 0).data)
    assert said == {"PAGE": 1, "ANGLE": 0.25, "TURN": -0.04}


@pytest.mark.parametrize(
    ("changes", "reason"),
    [
        ({"messages": {"a": "IMU", "b": "LONG"}}, "LONG has 20 bytes .*fast packet"),
        ({"messages": {"a": "IMU"}, "signals": {"roll_rad": {"from": "a.ANGLE"},
          "roll_rate_rad_s": {"from": "a.TURN"}}}, "of IMU do not come together: name IMU for eac"),
        ({"messages": {"a": {"id": 5}, "b": "IMU"}}, "messages names messages of the file"),
        # ANGLE is another thing's bits where BOOK is not 1
        ({"messages": {"a": "NEST", "b": "IMU"}}, "PAGE of NEST, .* is not in every frame itself"),
        ({"messages": {name: {"of": "IMU", "cycle_ms": 30} for name in "ab"}},
         "cycle_ms: is 30, and cycle_ms 10"),
        # of PAGE's eight bits: one that can't be, one with a sign, a mask with none of them
        ({"valid_when": [{"from": "a.PAGE", "mask": 3, "in": [0, 4]}]}, "in has 4, and the bits"),
        # a signal that is another thing, too
        ({"signals": {"roll_rad": {"from": "b.TURN"}, "roll_rate_rad_s": {"from": "b.TURN"}}},
         "roll_rate_rad_s: b.TURN is that of signals.roll_rad, too: name its own"),
        ({"protection": {"counters": ["a.ANGLE"]}},
         "roll_rad: a.ANGLE is that of protection.counters, too"),
        ({"signals": {"roll_rad": {"from": "a.ANGLE", "sign": 0}}}, "must be one of 1, -1 .got 0"),
        ({"valid_when": [{"from": "a.PAGE", "in": [-1]}]}, "in has -1, and .* without sign"),
        ({"valid_when": [{"from": "a.PAGE", "mask": 0x300, "in": [0]}]}, "0x300 has none of the"),
        ({**STATE, "valid_when": [{"from": "s.OF", "in": ["valid"]}]},
         "names no value valid of s.OF: there are VALID, STARTS, SPOILT"),
        ({**STATE, "valid_when": [{"from": "s.BARE", "in": [1, "GOOD"]}]},
         "names no value GOOD of s.BARE: give its number"),
        ({**STATE, "valid_when": [{"from": "s.O", "in": ["VALID"]}]}, "of s.O: there is no such s"),
        ({**STATE, "valid_when": [{"from": "s.FIX", "in": ["4D"]}]}, "as 18 or 0x12, got '4D'"),
        ({**STATE, "valid_when": [{"from": "s.OF", "in": [True]}]}, "is true, as YAML reads on"),
    ],
)  # fmt: skip
def test_what_a_dbc_does_not_give_is_refused(tmp_path, changes, reason):
    assert re.search(reason, problems(tmp_path, {"motion": inertial(tmp_path, **changes)}))


def test_a_status_may_be_given_by_its_names_in_a_dbc(tmp_path):
    states = [{"from": "s.OF", "in": ["VALID", 1, "SPOILT"]}, {"from": "s.FIX", "in": ["3D fix"]}]
    content = inertial(tmp_path, **STATE, valid_when=states)
    plan = ship(tmp_path, {"motion": content}).foreign.motions[0]
    assert [each.allowed for each in plan.messages[2].conditions] == [{3, 1, 15}, {2}]


def test_identifiers_of_a_dbc_may_be_others_and_its_cycle_counts_where_none_is_given(tmp_path):
    content = inertial(tmp_path, messages={"a": {"of": "IMU", "id": 0x333}, "b": "IMU"})
    del content["cycle_ms"]
    plan = ship(tmp_path, {"motion": content}).foreign.motions[0]
    assert [each.can_ids for each in plan.messages] == [(STANDARD | 0x333,), (STANDARD | 256,)]
    assert plan.cycle_ns == 20_000_000


def test_a_source_finds_a_message_of_a_dbc_by_its_group(tmp_path):
    signals = {"roll_rad": {"from": "s.ROLL"}, "roll_rate_rad_s": {"from": "a.TURN"}}
    content = inertial(tmp_path, source=0x21, messages={"s": "SLOPE", "a": "IMU"}, signals=signals)
    plan = ship(tmp_path, {"motion": content}).foreign.motions[0]
    group = SLOPE_ID >> 8 & 0x3FFFF
    assert {each & 0x3FFFFFF for each in plan.messages[1].can_ids} == {group << 8 | 0x21}
    assert len(plan.messages[1].can_ids) == 8


def test_the_way_of_a_valve_with_switches_and_what_a_panel_of_a_bit_is_told(tmp_path):
    valve = {"valve": {"kind": "duct", "opening_time_s": 0.7, "leakage": 0.1}}
    said = problems(tmp_path, {"valve": ON_OFF}, **valve)
    assert "devices.valve.age_ms: must be 840 or more, its way and a fifth" in said
    found = ship(tmp_path, {"valve": ON_OFF | {"age_ms": 840}, "panel": PANEL}, **valve)
    plan = found.foreign.valve
    assert [each.name for each in plan.messages] == ["position"]
    assert plan.command.can_ids == (STANDARD | 0x209,)
    steps = {str(step.place): step.value for step in plan.steps if step.value}
    assert (steps["1016h:1"], steps["1600h:1"]) == (127 << 16 | 50, 0x62000108)
    assert found.default_safety["valve_age_ms"] == 840
    beats = DevicesSection(valve=ON_OFF, pump=DRIVE).foreign(found.pump)
    assert beats.valve.beat is None  # the drive's command brings it
    assert plan.beat == Frame(STANDARD | 0x77F, b"\x05")


@pytest.mark.parametrize("first", [SBG, {}])
def test_each_of_two_sensors_is_allowed_its_own_age(first):
    slow = SSI2 | {"bus": "can2", "cycle_ms": 50, "age_ms": 150}
    for motion, motion_2, allowed in ((first, slow, (40, 150)), (slow, first, (150, 40))):
        ages = DevicesSection(motion=motion, motion_2=motion_2).default_ages()
        assert SafetyLimits(**ages).motion_ages_ms == allowed
    ages = DevicesSection(motion=SBG, motion_2={}).default_ages()
    limits = SafetyLimits(**ages | {"motion_age_ms": 500})  # one key of a file for both
    assert limits.motion_ages_ms == (500, 500)
