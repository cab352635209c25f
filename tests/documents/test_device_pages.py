"""The pages for makers of devices: their frames and limits, computed apart from the product."""

import hashlib
import re
from pathlib import Path

import cantools
import pytest
from cantools.database.can import Database

from utank_hil.canbus import (
    ControlWord,
    Frame,
    HardwiredInputs,
    Mode,
    OperatorCommand,
    PumpCommand,
    Quality,
    SensorMotion,
    Switch,
    ValveCommand,
    ValveControl,
    load_catalogue,
)
from utank_hil.canbus.enumerations import Address
from utank_hil.commands.panel import LOOK_NS
from utank_hil.nodes.commissioning.checks import RATE_SCALE
from utank_hil.nodes.commissioning.precision import SCALE
from utank_hil.nodes.panel import EDGE_NS, SILENT_NS
from utank_hil.safety.faults import FAULTS
from utank_hil.safety.safety_limits import SafetyLimits

PAGES = Path("docs/how-to")
DATABASE = cantools.database.load_file("utank_hil/canbus/utank.dbc")
assert isinstance(DATABASE, Database)
CATALOGUE = load_catalogue()
LIMITS = SafetyLimits()


def text(page):
    return (PAGES / f"{page}.md").read_text(encoding="utf-8")


def hexes(words):
    return [int(each, 16) for each in re.findall(r"0x([0-9A-F]{2})\b", words)]


def registers(data):
    """The CRC's register after each byte, as the page words it."""
    register, found = 0xFF, []
    for byte in data:
        register ^= byte
        for _ in range(8):
            register <<= 1
            if register & 0x100:
                register = (register & 0xFF) ^ 0x2F
        found.append(register)
    return found


def data_id(name, counter):
    dbc = DATABASE.get_message_by_name(name).dbc
    return bytes.fromhex(str(dbc.attributes["DataIDs"].value))[counter]


def encoded(name, counter, **signals):
    message = DATABASE.get_message_by_name(name)
    raw = {"crc": 0, "counter": counter, **signals}
    rest = message.encode(raw, strict=False)[1:]
    return bytes([registers([*rest, data_id(name, counter)])[-1] ^ 0xFF]) + rest


def test_the_worked_frame_is_that_of_the_message_byte_by_byte():
    page = text("device")
    table = page.partition("| byte | value | is |")[2].partition("The CRC is")[0]
    shown = bytes(
        value
        for row in re.findall(r"^\| [\d, ]+ \| ([^|]*) \|", table, re.M)
        for value in hexes(row)
    )
    assert shown == encoded("SENSOR_MOTION", 5, roll_rad=0.1, roll_rate_rad_s=-0.05, quality=0)
    taken, after = (
        hexes(re.search(rf"^\| {start}.*$", page, re.M)[0])
        for start in ("byte taken in", "register after it")
    )
    assert taken == [*shown[1:], data_id("SENSOR_MOTION", 5)]
    assert after == registers(taken)
    assert after[-1] ^ 0xFF == shown[0]
    begins = re.search(r"begins\n([0-9A-F ]+),", page)
    listed = bytes.fromhex(begins[1])
    assert listed == bytes(data_id("SENSOR_MOTION", counter) for counter in range(6))
    frame = Frame(CATALOGUE.codec(SensorMotion).can_id, shown)
    message = CATALOGUE.receiver(SensorMotion).accept(frame)
    assert message.quality is Quality.GOOD
    assert (message.roll_rad, message.roll_rate_rad_s) == pytest.approx((0.1, -0.05))
    assert f"0x{frame.can_id:08X}" in page


@pytest.mark.parametrize(
    ("page", "name", "counter", "signals", "kind", "content"),
    [
        (
            "drive",
            "PUMP_CMD",
            3,
            {"pressure_pa": 12000, "control_word": 0x0F, "timeout_s": 0.05},
            PumpCommand,
            {"control_word": ControlWord.ENABLE_OPERATION, "pressure_pa": 12000.0},
        ),
        (
            "drive",
            "VALVE_CMD",
            3,
            {"control": 1, "opening": 0.4, "timeout_s": 0.05},
            ValveCommand,
            {"control": ValveControl.FOLLOW, "opening": pytest.approx(0.4)},
        ),
        (
            "sensor",
            "HARDWIRED_INPUTS",
            4,
            {"port_high": 0, "starboard_high": 0, "stop_loop": 1, "quality": 0},
            HardwiredInputs,
            {"port_high": Switch.OFF, "starboard_high": Switch.OFF, "stop_loop": Switch.ON},
        ),
        (
            "panel",
            "OPERATOR_CMD",
            9,
            {
                "mode_request": 3,
                "arm": 1,
                **dict.fromkeys(("stop", "reset", "acknowledge", "retune", "undo"), 0),
                "forbid_retuning": 0,
                "take_command": 0,
                "acknowledge_code": 0xFF,
                "power_budget_w": 100 * 0xFFFF,
            },
            OperatorCommand,
            {"mode_request": Mode.ACTIVE, "arm": True, "stop": False, "acknowledge_code": None},
        ),
    ],
)
def test_frames_of_the_other_pages_are_right(page, name, counter, signals, kind, content):
    row = re.search(rf"^\| {name} \| (0x.*)$", text(page), re.M)
    shown = bytes(hexes(row[1]))
    assert shown == encoded(name, counter, **signals)
    assert f"data ID is 0x{data_id(name, counter):02X}" in text(page).replace("\n", " ")
    codec = CATALOGUE.codec(kind, Address.OPERATOR if name == "OPERATOR_CMD" else None)
    assert f"{name} (0x{codec.can_id:08X})" in text(page)
    message = codec.decode(shown)
    assert {key: getattr(message, key) for key in content} == content


FRAMES: dict[str, dict[str, float]] = {
    "DRIVE_STATUS_1": {"pressure_pa": 12000, "speed_rad_s": 0, "state": 0x27, "command_echo": 3},
    "DRIVE_STATUS_2": {
        "bus_voltage_v": 800,
        "current_a": 0,
        "motor_temperature_c": 0xFF - 40,
        "drive_temperature_c": 0xFF - 40,
    },
    "SENSOR_TANK": {"port_level_m": 0.25, "starboard_level_m": -0.25},
    "SENSOR_PUMP": {"pressure_pa": 12000, "flow_m3_s": 0xFFFF * 0.001 - 32},
    "VALVE_STATUS": {"state": 1, "opening": 0.4, "command_echo": 3},
    "HEARTBEAT_SENSORS": {
        "state": 2,
        "catalogue_version": 271,
        "configuration_version": 1437,
        "transmit_error_count": 16 * 0xF,
        "receive_error_count": 16 * 0xF,
    },
}


@pytest.mark.parametrize("name", FRAMES)
def test_frames_to_test_an_encoder_with_are_right(name):
    row = re.search(
        rf"^\| {name} \| .* \| (\d+) \| 0x(..) \| ([0-9A-F ]+) \|$", text("device"), re.M
    )
    counter, shown = int(row[1]), bytes.fromhex(row[3])
    names = {each.name for each in DATABASE.get_message_by_name(name).signals}
    others = dict.fromkeys(names - {"crc", "counter"}, 0.0)
    assert shown == encoded(name, counter, **others | FRAMES[name])
    assert int(row[2], 16) == data_id(name, counter)


def test_the_catalogues_version_is_what_the_page_makes_of_the_dbc():
    """271 where its second number is the hash of the other lines, as a maker computes it."""
    head, _, rest = Path("utank_hil/canbus/utank.dbc").read_text(encoding="utf-8").partition("\n")
    first, second = map(int, re.findall(r"\d+", head))
    found = int.from_bytes(hashlib.sha256(rest.encode()).digest(), "big") % 4095
    assert second == found
    assert first == CATALOGUE.version
    row = re.search(r"^\| catalogue \| (.*)$", text("device"), re.M)[1]
    assert f"first number of the DBC's `VERSION`, {first}," in row
    assert "SHA-256 of all lines after the first" in row


def test_scales_of_the_page_are_those_that_a_commissioning_lets_pass():
    said = re.search(r"rate within (\d+) % .* levels within (\d+) %", text("sensor"), re.S)
    assert [float(each) / 100 for each in said.groups()] == [RATE_SCALE, SCALE]


def test_cycles_of_the_pages_are_the_catalogues():
    found = []
    for page in ("sensor", "drive", "panel"):
        found += re.findall(r"^\| ([A-Z_0-9]+)(?:, \w+)? \| (\d+) ms", text(page), re.M)
    assert len(found) == 14
    for name, cycle in found:
        assert DATABASE.get_message_by_name(name).cycle_time == int(cycle), name


@pytest.mark.parametrize(
    ("page", "words", "limit_ms"),
    [
        ("sensor", "no good SENSOR_MOTION | 40 ms", LIMITS.motion_age_ms),
        ("sensor", "no good SENSOR_TANK | 100 ms; 1 s", LIMITS.tank_degraded_age_ms),
        ("sensor", "no good SENSOR_PUMP | 200 ms; 1 s", LIMITS.pump_degraded_age_ms),
        ("sensor", "no good HARDWIRED_INPUTS | 150 ms", LIMITS.hardwired_age_ms),
        ("drive", "DRIVE_STATUS_1 silent | 60 ms", LIMITS.drive_age_ms),
        (
            "drive",
            "the echo stands still, or is more than three commands behind | 100 ms",
            LIMITS.echo_age_ms,
        ),
        ("drive", "out of OPERATION_ENABLED while active | 40 ms", LIMITS.drive_enabled_within_ms),
        ("drive", "VALVE_STATUS silent | 60 ms", LIMITS.valve_age_ms),
        (
            "drive",
            "the echo stands still, or is more than three commands behind | 100 ms",
            LIMITS.valve_echo_age_ms,
        ),
        ("drive", "not FOLLOWING while active | 100 ms", LIMITS.valve_follows_within_ms),
        ("drive", "by `opening_time_s` | 300 ms", LIMITS.valve_off_within_ms),
        ("panel", "silent, before arming | 600 ms", LIMITS.panel_age_to_arm_ms),
        ("panel", "silent, while armed | 5 s", LIMITS.panel_age_armed_ms),
        ("panel", "No CTRL_STATUS for 300 ms", SILENT_NS / 1e6),
        ("panel", "take it back for 500 ms", EDGE_NS / 1e6),
    ],
)
def test_limits_of_the_pages_are_those_that_are_judged(page, words, limit_ms):
    assert words in text(page)
    number, unit = re.findall(r"([\d.]+) (ms|s)\b", words)[0]
    assert float(number) * (1000 if unit == "s" else 1) == limit_ms


def test_keyboard_panel_keeps_the_time_from_button_to_frame():
    assert "From the button to the frame: 50 ms at most." in text("panel")
    assert 2 * LOOK_NS <= 50_000_000


def test_addresses_and_fault_codes_exist():
    addresses = {f"0x{address:02X}" for address in Address}
    sentence = text("device").partition("Addresses are fixed: ")[2].partition(".")[0]
    assert {f"0x{each:02X}" for each in hexes(sentence)} == addresses
    codes = {row.code.name for row in FAULTS}
    everything = " ".join(map(text, ("device", "sensor", "drive", "panel")))
    for named in ("FOREIGN_SENDER", "ADDRESS_CONFLICT", "PROTECTION", "SIGNAL_DELAYED", "NOISE",
                  "SPIKES"):  # fmt: skip
        assert named in everything
        assert named in codes
